"""The filters' measurements against the truth they stand for, what cancels in them, the fusion, and honest sigmas."""

import math

import numpy as np
import pytest

from tests.damping.marine_case import DEG_PER_HOUR, HOUR, MICRO_G, ideal_and_truth
from tests.runs import few_and_all
from truenorth.core.errors import UsageError
from truenorth.core.units import parse
from truenorth.damping.course import errors_of, linearised, without_errors
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.prior import carried_prior, paper_prior
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import BA, BG, DP, DV, OF_INS, PHI, REF, MarineModel
from truenorth.simulation import simulate
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.level import mechanise

SIGMA = np.zeros(13)  # of the paper's errors
SIGMA[DV], SIGMA[DP], SIGMA[PHI] = 0.1, 62.0, np.radians(np.array([0.7, 0.7, 7.7]) / 60.0)
SIGMA[BG], SIGMA[BA] = 0.005 * DEG_PER_HOUR, 50.0 * MICRO_G
WALKS = {
    "accel_random_walk": parse("10 ug/sqrt(Hz)", "velocity_random_walk"),
    "gyro_random_walk": parse("0.001 deg/sqrt(h)", "angle_random_walk"),
}
PAPER = MarineModel.of_paper()
START = 900  # 2.5 h


@pytest.fixture(scope="module")
def linear():
    """Truth, true errors and course of the linear model with the paper's errors, at 10 s."""
    _, truth = ideal_and_truth(hours=24.0)
    _, Phi = linearised(truth, MarineModel(0.0, 0.0))
    states = [SIGMA]
    for step in Phi:
        states.append(step @ states[-1])
    x = np.array(states)
    return truth, x, without_errors(truth, -x[:, :7])


def reference(truth, c, seed=0, sigma=0.05):
    noise = sigma * np.random.default_rng(seed).standard_normal((len(truth.time), 2))
    return truth.v_n[:, :2] + np.asarray(c) + noise


def paper_filters(course):
    P0 = paper_prior(course, START)
    return {
        "filter1": Filter(PAPER, P0, 0.05),
        "filter2": Filter(PAPER, P0, 0.001, window=10.0),
        "filter2_raw": Filter(PAPER, P0, 0.01, window=10.0),
    }


@pytest.mark.slow
def test_the_mean_of_the_rows_of_F_is_the_change_of_velocity(linear):
    """``H x`` of filter 2 against ``(dv(t) - dv(t - T))/T`` of the truth: the biases are constant here, T is 30 s."""
    truth, x, _ = linear
    F, _ = linearised(truth, MarineModel(0.0, 0.0))
    m = 3
    H = np.stack([F[k - m : k, DV].mean(axis=0) for k in range(m, len(F))])
    middle = 0.5 * (x[m:-1] + x[: -m - 1])
    change = (x[m:-1, DV] - x[: -m - 1, DV]) / (m * truth.interval)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", H, middle), change, atol=0.003 * np.abs(change).max())


@pytest.mark.slow
def test_a_constant_reference_error_cancels(linear):
    """In filter 2 on the raw reference to rounding, on the smoothed one to 1 %; in filter 1 not at all."""
    truth, _, course = linear
    none, some = (
        run_filters(course, reference(truth, c), start=START, kinds=paper_filters(course)) for c in (0.0, -0.3)
    )
    sizes = np.abs(none["filter2_raw"].x).max(axis=0)
    np.testing.assert_array_less(np.abs(none["filter2_raw"].x - some["filter2_raw"].x).max(axis=0), 1e-9 * sizes)
    late = slice(360, None)  # an hour after the switch
    difference = np.abs(none["filter2"].x - some["filter2"].x)[late].max(axis=0)
    np.testing.assert_array_less(difference, 0.01 * np.abs(none["filter2"].x[late]).max(axis=0))
    moved = np.mean((none["filter1"].x - some["filter1"].x)[late, DV], axis=0)
    np.testing.assert_allclose(moved, -0.3, atol=0.01)


def test_filter1_is_the_kalman_filter_of_the_whole(linear):
    """Blocks have the estimate of one batch."""
    from truenorth.filters import LinearSystem, kalman

    truth, _, course = linear
    part, ref = course[:5001], reference(truth, -0.1)[:5001]
    P0 = paper_prior(course, START)
    found = run_filters(part, ref, start=START, kinds={"filter1": Filter(PAPER, P0, 0.05)})["filter1"]
    _, Phi = linearised(part[START:], PAPER)
    H = np.zeros((1, 2, 13))
    H[0, :, DV] = np.eye(2)
    z = (part.v_n[:, :2] - ref)[START + 1 :]
    system = LinearSystem(Phi, np.diag(PAPER.noise * 10.0)[None], H, 0.05**2 * np.eye(2)[None], z, np.zeros(13), P0)
    np.testing.assert_allclose(found.x[-1], kalman(system).x[-1], rtol=1e-9)


def test_fusion_by_hand():
    """Weights from the diagonals; the difference counts only as gamma grows."""
    K, n = 11, 3
    one = Estimate(0, np.full((K, n), 2.0), np.full((K, n), 1.0), np.eye(n), np.ones((K, 2)))
    two = Estimate(0, np.zeros((K, n)), np.full((K, n), 2.0), np.eye(n), np.ones((K, 2)))
    fusion = Fusion(rate=1.0, middle=5.0, samples=4)
    fused = fusion(one, two, 1.0)
    for k in (0, 5, 10):
        gamma = 1.0 / (1.0 + math.exp(-(k - 5.0)))
        enlarged = 1.0 + gamma * 4.0
        weight = 4.0 / (4.0 + enlarged)
        assert fused.x[k] == pytest.approx(np.full(n, 2.0 * weight))
        assert fused.sigma[k] == pytest.approx(np.full(n, math.sqrt(weight * enlarged)))
    assert fusion.gamma([0.0, 5.0, 1e4]) == pytest.approx([1 / (1 + math.exp(5)), 0.5, 1.0])


def test_the_prior_is_that_of_the_navigation():
    """P0 carried to the switch against the covariance that the navigation's own driver carries (in another frame)."""
    from truenorth.errors.model import InsModel
    from truenorth.estimate.run import navigate_track
    from truenorth.state.state import Start

    ideal, truth = ideal_and_truth(hours=3.0)
    P15 = np.zeros((15, 15))
    rows = np.ix_(OF_INS, OF_INS)
    P15[rows] = np.diag(SIGMA**2)
    lat, lon, alt = truth.position[0]
    start = Start(0.0, truth.C_nb[0], truth.v_n[0], lat, lon, alt, np.zeros(3), np.zeros(3), P15)
    model = InsModel(WALKS["gyro_random_walk"], WALKS["accel_random_walk"], fixed_altitude=True)
    track = navigate_track(simulate(ideal).record, start, model, interval=10.0, every=1)
    carried = carried_prior(truth, START + 3, MarineModel(**WALKS), np.diag(SIGMA**2))
    expected = track.P[START + 3][rows]
    scale = np.sqrt(np.outer(np.diagonal(expected), np.diagonal(expected)))
    np.testing.assert_allclose(carried / scale, expected / scale, atol=0.01)


@pytest.mark.slow
@few_and_all(30)
def test_the_augmented_filter_is_honest(runs):
    """Errors, biases and log error drawn from what it is given; NEES of fifteen numbers a run in its 99.9 % band.

    Full strapdown at 10 s over 24 h, its course re-linearised midway; ARW .001 deg/sqrt(h), VRW 10 ug/sqrt(Hz).
    """
    ideal, truth = ideal_and_truth(hours=24.0)
    model = MarineModel(**WALKS, groups=LogErrors(0.3).groups())
    P0 = carried_prior(truth, START, model, np.diag(SIGMA**2))
    spec = _spec()
    nees = {hours: [] for hours in (4, 8, 24)}
    for run in range(runs):
        rng = np.random.default_rng([17, run])
        x0 = SIGMA * rng.standard_normal(13)
        c = 0.3 * rng.standard_normal(2)
        course = _navigated(ideal, truth, x0, spec, run)
        found = run_filters(
            course,
            reference(truth, c, seed=1000 + run),
            start=START,
            kinds={"augmented": Filter(model, P0, 0.05, relinearise=True)},
        )["augmented"]
        e = errors_of(course, truth)
        for hours in nees:
            k = round(hours * HOUR / truth.interval)
            error = np.concatenate(
                [e[k] - found.x[k - START, :7], x0[7:] - found.x[k - START, 7:13], c - found.x[k - START, REF]]
            )
            if hours == 24:
                nees[hours].append(error @ np.linalg.solve(found.P, error) / 15)
            else:  # sigma alone is kept on the way: the measured directions
                nees[hours].append(np.mean((error / found.sigma[k - START]) ** 2))
    low, high = 1 - 3.3 * math.sqrt(2 / (15 * runs)), 1 + 3.3 * math.sqrt(2 / (15 * runs))
    assert low < np.mean(nees[24]) < high
    for hours in (4, 8):  # correlated states: the scatter of their mean is at most that of one number a run
        assert abs(np.mean(nees[hours]) - 1) < 3.3 * math.sqrt(2 / runs)


def _spec():
    from truenorth.records.specs import ImuSpec

    return ImuSpec(gyro_random_walk=WALKS["gyro_random_walk"], accel_random_walk=WALKS["accel_random_walk"])


def _navigated(ideal, truth, x0, spec, run):
    """As `navigate`, with random walks."""
    sim = simulate(ideal, imu=spec, seed=5, run=run, errors={"gyro_bias": x0[BG], "accel_bias": x0[BA]})
    begin = without_errors(truth[:2], -x0[:7])
    start = State.at(begin.C_nb[0], *begin.position[0], v_n=begin.v_n[0])
    out = mechanise(sim.record, start, altitude="fixed")

    def joined(first, rest):
        return np.concatenate([first[:1], rest])

    return Track.of_motion(
        truth.time, joined(begin.C_nb, out.C_nb), joined(begin.v_n, out.v_n), joined(begin.position, out.position)
    )


def test_what_is_refused(linear):
    truth, _, course = linear
    P0 = paper_prior(course, START)
    ref = reference(truth, 0.0)
    with pytest.raises(UsageError, match="that filter1 smooths"):
        run_filters(course, ref, start=START, kinds={"filter2": Filter(PAPER, P0, 0.001, window=10.0)})
    with pytest.raises(UsageError, match="start at epoch"):
        run_filters(course, ref, start=10**6, kinds={"filter1": Filter(PAPER, P0, 0.05)})
    with pytest.raises(UsageError, match=r"expected \(15, 15\)"):
        Filter(MarineModel(0.0, 0.0, groups=LogErrors(0.3).groups()), P0, 0.05)
