"""Errors of the log: what they show, whether bands hold them, and how fast a drift is."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.damping.marine_case import HOUR, fix_rows, ideal_and_truth
from tests.damping.test_filters import SIGMA, WALKS, reference
from tests.runs import few_and_all
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.damping.bands import filter_bands
from truenorth.damping.course import linearised, without_errors
from truenorth.damping.drift import likely_drifts
from truenorth.damping.filters import Filter, Fusion, run_filters
from truenorth.damping.methods import change_filter
from truenorth.errors.log import BIAS, LOGS, LogErrors, log_errors, log_rows
from truenorth.errors.marine import BA, BG, DP, PHI, MarineModel
from truenorth.simulation.processes import gauss_markov


def test_rows_are_what_a_log_shows():
    """A log turned, scaled and biased on the hull, against the rows: exact but for the product of two errors."""
    errors = LogErrors(drift=1.0, scale=1.0, mounting=1.0, bias=1.0)
    heading, v_b = 0.7, np.array([0.4, 9.0, 0.0])
    C = dcm_from_euler(heading, 0.0, 0.0)
    d, k, mu, b = np.array([0.3, -0.2]), 1e-5, 2e-5, np.array([0.02, -0.01])
    turned = dcm_from_euler(heading + mu, 0.0, 0.0)  # clockwise by mu
    shown = (1.0 + k) * turned @ v_b + np.append(d, 0.0) + C @ np.append(b, 0.0)
    rows = log_rows(errors.groups(), C, C @ v_b)
    np.testing.assert_allclose(rows @ np.concatenate([d, [k, mu], b]), (shown - C @ v_b)[:2], atol=1e-8)


def test_kinds_of_logs():
    assert log_errors(None, "body") == LOGS["em"]
    assert log_errors(None, "navigation") == LOGS["reference"]
    assert log_errors("doppler-bottom", "body").drift == 0.0  # over the ground there is no current
    assert [g.name for g in LOGS["doppler-bottom"].groups()][-1] == BIAS
    with pytest.raises(UsageError, match="one of reference, em"):
        log_errors("pitot", "body")
    with pytest.raises(UsageError, match="zero or more"):
        LogErrors(drift=-0.1)


@pytest.fixture(scope="module")
def truth():
    return ideal_and_truth(hours=12.0)[1]


def free(truth, model, rng, sigma=SIGMA):
    """A course with errors of the linear model, drawn from `sigma`."""
    x = sigma * rng.standard_normal(13)
    _, Phi = linearised(truth, MarineModel(**WALKS))
    noise = np.sqrt(model.noise[:13] * truth.interval)
    states = [x]
    for step in Phi:
        states.append(step @ states[-1] + noise * rng.standard_normal(13))
    return np.array(states), without_errors(truth, -np.array(states)[:, :7])


def test_bands_of_a_filter_that_knows_all_are_its_own(truth):
    """The covariance of truth and filter together gives back the filter's, where their models are one."""
    model = MarineModel(**WALKS)
    kind = Filter(model, np.diag(SIGMA**2), 0.05)
    found = run_filters(truth, reference(truth, 0.0), start=0, kinds={"one": kind})["one"]
    bands = filter_bands(truth, kind, kind)
    np.testing.assert_allclose(bands.errors[1:], found.sigma[1:, :7], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("time", [math.inf, 1.0 * HOUR])
def test_bands_hold_what_a_filter_does_not_know(truth, time):
    """A drift of .3 m/s that filter 1 knows nothing of: RMS over 20 voyages against the bands, 99.9 %."""
    errors = LogErrors(0.3, time)
    model, whole_model = MarineModel(**WALKS), MarineModel(**WALKS, groups=errors.groups())
    kind = Filter(model, np.diag(SIGMA**2), 0.05)
    bands = filter_bands(truth, Filter(whole_model, whole_model.prior(np.diag(SIGMA**2)), 0.05), kind)
    ratios = []
    for run in range(20):
        rng = np.random.default_rng([5, run])
        x, course = free(truth, model, rng)
        constant = np.broadcast_to(0.3 * rng.standard_normal(2), (len(truth.time), 2))
        drift = constant if math.isinf(time) else gauss_markov(0.3, time, truth.interval, len(truth.time), rng, axes=2)
        found = run_filters(course, reference(truth, drift, seed=run), start=0, kinds={"one": kind})["one"]
        ratios.append((found.x[-1, :7] - x[-1, :7]) / bands.errors[-1])
    rms = np.sqrt(np.mean(np.array(ratios) ** 2, axis=0))
    np.testing.assert_array_less(rms, 1 + 4.0 / math.sqrt(40))
    np.testing.assert_array_less(1 - 4.0 / math.sqrt(40), rms)


@pytest.mark.slow
@pytest.mark.parametrize(("hours", "low", "high"), [(math.inf, 48.0, math.inf), (1.0, 0.37, 3.0), (6.0, 1.5, 24.0)])
def test_the_time_of_a_drift_is_found(truth, hours, low, high):
    rng = np.random.default_rng(8)
    model = MarineModel(**WALKS, groups=LogErrors(0.5).groups())
    _, course = free(truth, model, rng)
    drift = np.array([0.5, -0.3])
    if math.isfinite(hours):
        drift = gauss_markov(0.5, hours * HOUR, truth.interval, len(truth.time), rng, axes=2)
    kind = Filter(model, model.prior(np.diag(SIGMA**2)), 0.05)
    found = likely_drifts(course, reference(truth, drift), 0, kind, LogErrors(0.3))[0]
    assert low * HOUR <= found.time <= high * HOUR
    if math.isfinite(hours):  # the walk, which the data show, to a quarter
        assert found.drift / math.sqrt(found.time) == pytest.approx(0.5 / math.sqrt(hours * HOUR), rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_drift_that_wanders_a_little_is_no_constant(truth, seed):
    """A fifth of the usual size, and slow: a walk as small as that is kept, not none."""
    rng = np.random.default_rng(seed)
    model = MarineModel(**WALKS, groups=LogErrors(0.5).groups())
    _, course = free(truth, model, rng)
    drift = gauss_markov(0.1, 12.0 * HOUR, truth.interval, len(truth.time), rng, axes=2)
    kind = Filter(model, model.prior(np.diag(SIGMA**2)), 0.05)
    assert likely_drifts(course, reference(truth, drift), 0, kind, LogErrors(0.5))[0].time <= 768.0 * HOUR


def test_a_gate_goes_on_past_a_part_with_a_fix(truth):
    """Parts of 3600 epochs, a fix in the second of them alone: a gate that lets all pass is no gate."""
    course = truth[: round(11.9 * HOUR / 10)]
    z, sigma = np.full((len(course.time), 3), np.nan), np.ones((len(course.time), 3))
    z[4000], sigma[4000] = [20.0, -10.0, 1e-4], [10.0, 10.0, 1e-4]
    whole = Filter(MarineModel(**WALKS), np.diag(SIGMA**2), 0.05, fixes=fix_rows(course, z, sigma))
    shown = reference(course, np.zeros(2))
    kinds = {"plain": whole, "gated": replace(whole, gate=1.0 - 1e-12)}
    plain, gated = run_filters(course, shown, start=0, kinds=kinds).values()
    np.testing.assert_allclose(gated.x, plain.x, rtol=1e-9, atol=1e-12)
    assert plain.sigma[4000, DP.start] < 0.5 * plain.sigma[3999, DP.start]


@pytest.mark.slow
def test_two_fixes_calibrate_the_gyros(truth):
    """Position and azimuth at two times give the drifts by ``psi_2 = A psi_1 - B eps``, and the filter finds them.

    ``psi' = -w_in x psi - C eps`` with ``psi = phi - theta``; the tilt is left to the filter.
    """
    from scipy.linalg import expm

    from truenorth.core.earth import earth_rate_n, radii, transport_rate_n

    model = MarineModel(**WALKS)
    x, course = free(truth, MarineModel(0.0, 0.0), np.random.default_rng(3))
    first, second = round(2 * HOUR / 10), round(11 * HOUR / 10)
    z, sigma = np.full((len(truth.time), 3), np.nan), np.ones((len(truth.time), 3))
    for k in (first, second):
        z[k], sigma[k] = [*x[k, DP], x[k, PHI.stop - 1]], [1.0, 1.0, np.radians(0.1 / 60)]
    prior = SIGMA.copy()
    prior[BG] *= 20.0  # the fixes tell, not the prior
    kind = Filter(model, np.diag(prior**2), 0.05, fixes=fix_rows(course, z, sigma))
    silent = np.full((len(truth.time), 2), np.nan)
    found = run_filters(course, silent, start=0, kinds={"free": kind})["free"]

    def theta(k):
        lat, _, alt = truth.position[k]
        R_M, R_N = radii(lat)
        east, north = x[k, DP]
        return np.array([-north / (R_M + alt), east / (R_N + alt), east / (R_N + alt) * math.tan(lat)])

    psi = [x[k, PHI] - theta(k) for k in (first, second)]
    A, B = np.eye(3), np.zeros((3, 3))
    for k in range(first, second):
        lat, _, alt = truth.position[k]
        w = earth_rate_n(lat) + transport_rate_n(lat, alt, truth.v_n[k])
        cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        step = expm(-cross * truth.interval)
        A, B = step @ A, step @ B + truth.interval * truth.C_nb[k]
    eps = np.linalg.solve(B, A @ psi[0] - psi[1])
    size = np.linalg.norm(x[0, BG])
    np.testing.assert_allclose(eps, x[0, BG], atol=0.02 * size)  # the law, by the true errors
    np.testing.assert_array_less(found.sigma[-1, BG], 0.3 * prior[BG])
    np.testing.assert_array_less(np.abs(found.x[-1, BG] - x[-1, BG]), 4.0 * found.sigma[-1, BG])
    np.testing.assert_array_less(np.abs(found.x[second, DP] - x[second, DP]), 4.0)
    assert np.abs(found.x[first - 1, DP] - x[first - 1, DP]).max() > 100.0  # before the fix it was off


@pytest.mark.slow
@few_and_all(24, few=4)
def test_bands_of_the_double_filter_follow_imu_and_place(runs):
    """Filters 1 and 2 fused, as `navigate` runs them: place, heading, IMU (five times better to worse) drawn in each voyage.

    RMS against the bands, all states at the end: some four of seven are independent, 99.9 % of ``sqrt(chi2/n)``. Against the
    fusion's own sigma, which knows of no error of the log, they would be tens off.
    """
    errors, ratios, own = LogErrors(0.3, math.inf), [], []
    for run in range(runs):
        rng = np.random.default_rng([6, run])
        truth = ideal_and_truth.__wrapped__(rng.uniform(-70.0, 70.0), rng.uniform(0.0, 360.0), hours=12.0)[1]
        factor = 5.0 ** rng.uniform(-1.0, 1.0)
        walks, sigma = {name: factor * value for name, value in WALKS.items()}, SIGMA.copy()
        sigma[[*range(13)[BG], *range(13)[BA]]] *= factor
        model, whole_model = MarineModel(**walks), MarineModel(**walks, groups=errors.groups())
        x, course = free(truth, model, rng, sigma)
        ref = reference(truth, 0.3 * rng.standard_normal(2), seed=run)
        P0 = np.diag(sigma**2)
        one = Filter(model, P0, 0.05, relinearise=True)
        two = change_filter(one, errors, truth.interval)
        whole = Filter(whole_model, whole_model.prior(P0), 0.05, relinearise=True)
        found = run_filters(course, ref, start=0, kinds={"filter1": one, "filter2": two})
        fused = Fusion(samples=360)(found["filter1"], found["filter2"], truth.interval)
        apart = (found["filter1"].x - found["filter2"].x)[:, :7]
        bands = filter_bands(course, whole, one, two, (fused.weight[:, :7], apart))
        off = fused.x[-1, :7] - x[-1, :7]
        ratios.append(off / bands.errors[-1])
        own.append(off / fused.sigma[-1, :7])
    rms, own_rms = (float(np.sqrt(np.mean(np.array(r) ** 2))) for r in (ratios, own))
    room = 3.3 / math.sqrt(8 * runs)
    assert 1.0 - room < rms < 1.0 + room
    assert own_rms > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_current_that_is_smooth_from_row_to_row_is_no_constant(truth, seed):
    """A sea's current does not step: over minutes the errors of the INS follow it, and over hours it wanders all the same."""
    rng = np.random.default_rng(20 + seed)
    model = MarineModel(**WALKS, groups=LogErrors(0.5).groups())
    _, course = free(truth, model, rng)
    steps = gauss_markov(0.4, 3.0 * HOUR, truth.interval, len(truth.time), rng, axes=2)
    window = np.hanning(2 * round(300.0 / truth.interval) + 1)
    drift = np.stack(
        [np.convolve(np.pad(x, len(window) // 2, "edge"), window / window.sum(), "valid") for x in steps.T], axis=1
    )
    kind = Filter(model, model.prior(np.diag(SIGMA**2)), 0.05)
    assert likely_drifts(course, reference(truth, drift), 0, kind, LogErrors(0.5))[0].time < 48.0 * HOUR


@pytest.mark.slow
@pytest.mark.parametrize("run", [0, 8])
def test_a_log_that_is_off_by_the_same_all_the_time_and_looks_as_if_it_wandered(run):
    """Taken for a drift of 22 min alone, place was 3.3 and 4.4 sigmas off; it may as well be a constant."""
    from benchmarks.honesty.damping import CONSTANT, damped

    outcome = damped("augmented", CONSTANT)(99001, run)
    assert not outcome.refused
    assert max(np.abs(ratios).max() for ratios in outcome.ratios.values()) < 3.0
