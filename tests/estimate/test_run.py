"""The closed loop: its mechanisation, its covariance against Monte Carlo, its measurements, its smoother."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all, said_by_a_second_process
from truenorth.aiding.source import Aiding
from truenorth.analysis.consistency import nees
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, normal_gravity, radii
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.simulation import ideal_log, rest, simulate
from truenorth.simulation.course import Leg, course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.layout import BA, BG, DP, DV, PHI, STATES
from truenorth.state.state import Start
from truenorth.strapdown.level import mechanise

SPEC = ImuSpec(
    gyro_bias=np.radians(0.1) / 3600,
    gyro_random_walk=np.radians(0.01) / 60,
    gyro_bias_instability=np.radians(0.05) / 3600,
    accel_bias=2e-3,
    accel_random_walk=2e-4,
    accel_bias_instability=5e-4,
    correlation_time=200.0,
)
SIGMA = np.repeat([2e-4, 0.2, 10.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
GNSS_SIGMA = np.array([2.0, 2.0, 4.0])


def flight(lat=60.0, seconds=300.0):
    legs = [*straight(20.0), *s_turn(np.radians(60.0), np.radians(3.0), 4), *straight(seconds)]
    return course(Position.from_degrees(lat, 10.0, 3000.0), legs, heading=0.5, speed=200.0)


def start_at(motion, dx=None):
    """The true state with the first nine errors of `dx`, and P of `SIGMA`."""
    s = motion.states(0.0)
    dx = np.zeros(STATES) if dx is None else dx
    R_M, R_N = radii(s.lat)
    return Start(
        0.0,
        dcm_from_rotation_vector(-dx[PHI]) @ s.C_nb,
        s.v_n + dx[DV],
        float(s.lat + dx[DP][1] / (R_M + s.alt)),
        float(s.lon + dx[DP][0] / ((R_N + s.alt) * np.cos(s.lat))),
        float(s.alt + dx[DP][2]),
        np.zeros(3),
        np.zeros(3),
        np.diag(SIGMA**2),
    )


def displaced(position, metres):
    """Positions moved by metres east, north, up."""
    R_M, R_N = radii(position[:, 0])
    h = position[:, 2]
    return position + np.stack(
        [metres[:, 1] / (R_M + h), metres[:, 0] / ((R_N + h) * np.cos(position[:, 0])), metres[:, 2]], axis=1
    )


def errors_of(track, truth, errors):
    """(K, 15) errors of a track in the order of the states; what is left of the biases, their slow parts apart."""
    at = truth.states(track.time)
    phi = -rotation_vector_from_dcm(track.C_nb @ np.swapaxes(at.C_nb, 1, 2))
    R_M, R_N = radii(at.lat)
    true = np.stack([at.lat, at.lon, at.alt], axis=1)
    d = track.position - true
    dp = np.stack([(R_N + at.alt) * np.cos(at.lat) * d[:, 1], (R_M + at.alt) * d[:, 0], d[:, 2]], axis=1)
    bias = [errors.gyro_bias - track.sensors[:, BG], errors.accel_bias - track.sensors[:, BA]]
    return np.hstack([phi, track.v_n - at.v_n, dp, *bias])


def gnss(motion, seconds, rng, arm=(0.0, 0.0, 0.0), offset=0.0):
    """Positions of an antenna at odd times, with noise."""
    time = np.arange(1.0, seconds) + 0.3337
    at = motion.states(time + offset)
    position = displaced(np.stack([at.lat, at.lon, at.alt], axis=1), at.C_nb @ np.asarray(arm))
    noise = GNSS_SIGMA * rng.standard_normal((len(time), 3))
    return Aiding("GNSS position", "position", time, displaced(position, noise), GNSS_SIGMA, np.array(arm))


def test_free_inertial_is_the_mechanisation_in_the_local_level_frame():
    """Two forms of the same equations: 5 min at 200 m/s part by less than a millimetre, 1e-6 m/s and 1e-9 rad."""
    motion = flight()
    record = simulate(motion, rate=100.0, duration=300.0).record
    start = start_at(motion)
    track = navigate_track(record, start, InsModel(0.0, 0.0), covariance=False, interval=1.0, every=10)
    out = mechanise(record, start, every=1000)
    assert track.time[-1] == pytest.approx(out.time[-1])
    np.testing.assert_allclose(track.v_n[1:], out.v_n, rtol=0, atol=1e-6)
    away = (track.position[1:] - out.position) * [6.4e6, 3.2e6, 1.0]
    np.testing.assert_allclose(away, 0.0, atol=1e-3)
    turned = rotation_vector_from_dcm(track.C_nb[1:] @ np.swapaxes(out.C_nb, 1, 2))
    np.testing.assert_allclose(turned, 0.0, atol=1e-9)


@pytest.mark.parametrize("lat", [90.0, 89.9999, -90.0, 0.0])
def test_rest_anywhere_stays_at_rest(lat):
    """Also 11 m from the pole and on it, where the local level frame has no north."""
    rad = np.radians(lat)
    count = 6000
    dtheta = np.tile(0.1 * earth_rate_n(rad), (count, 1))
    dvel = np.tile([0, 0, 0.1 * normal_gravity(rad, 0.0)], (count, 1))
    record = ImuRecord(0.1 * np.arange(1, count + 1), dtheta, dvel, "increments")
    start = Start(0.0, np.eye(3), np.zeros(3), rad, 0.3, 0.0, np.zeros(3), np.zeros(3), np.diag(SIGMA**2))
    track = navigate_track(record, start, InsModel(0.0, 0.0, fixed_altitude=True), interval=1.0, every=60)
    assert np.abs(track.v_n).max() < 1e-6
    assert np.abs(track.position[:, 0] - rad).max() * 6.4e6 < 1e-3
    assert np.all(np.isfinite(track.P))


def test_flight_over_the_pole():
    """Along a meridian to the pole and on, at 300 m/s: an ideal IMU's log made in axes that know of no pole.

    The body keeps level in the plane of the meridian; in earth axes the track is that ellipse, at constant height.
    """
    V, rate, half = 300.0, 20.0, 400.0
    t = np.arange(round(2 * half * rate) + 1) / rate
    # Normal's angle beyond the equator along the whole meridian ellipse: 90 deg at t = half.
    fine = np.linspace(0.0, 2 * half, 200001)
    lat = np.empty_like(fine)
    lat[100000] = np.pi / 2
    step = fine[1]
    for way in (1, -1):
        angle = np.pi / 2
        for k in range(100000):
            middle = angle + way * 0.5 * step * V / radii(angle)[0]
            angle += way * step * V / radii(middle)[0]
            lat[100000 + way * (k + 1)] = angle
    angle = np.interp(t, fine, lat)
    # Axes e: x to the start's meridian, z the pole. Body: y along the track, z up, x = y cross z.
    y = np.stack([-np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
    z = np.stack([np.cos(angle), np.zeros_like(angle), np.sin(angle)], axis=1)
    C_eb = np.stack([np.cross(y, z), y, z], axis=-1)
    w_ie = np.array([0.0, 0.0, 7.292115e-5])
    R_M = radii(angle)[0]
    w_eb = np.einsum("kij,j->ki", np.swapaxes(C_eb, 1, 2), w_ie) + np.stack([-V / R_M, 0 * t, 0 * t], axis=1)
    # f = a_e + 2 w x v - g, in e, into b.
    a = -(V**2 / R_M)[:, None] * z
    f = a + 2 * np.cross(w_ie, V * y) + normal_gravity(angle, 0.0)[:, None] * z
    f_b = np.einsum("kji,kj->ki", C_eb, f)
    trapezoid = lambda u: 0.5 * (u[1:] + u[:-1]) / rate  # noqa: E731
    record = ImuRecord(t[1:], trapezoid(w_eb), trapezoid(f_b), "increments")
    start = Start(
        0.0, np.eye(3), np.array([0.0, V, 0.0]), lat[0], 0.0, 0.0, np.zeros(3), np.zeros(3), np.diag(SIGMA**2)
    )
    track = navigate_track(record, start, InsModel(1e-7, 1e-5), interval=1.0, every=10)
    end = track.position[-1]
    # Beyond the pole: the same latitude on the other side, heading south.
    assert abs(end[0] - (np.pi - lat[-1])) * 6.4e6 < 1.0
    assert abs(abs(end[1]) - np.pi) * 6.4e6 * np.cos(end[0]) < 1.0
    np.testing.assert_allclose(track.v_n[-1], [0.0, -V, 0.0], atol=5e-3)
    middle = track.P[np.argmin(np.abs(track.time - half))]
    assert np.sqrt(middle[6, 6] + middle[7, 7]) < 2000.0  # finite and sane where tan L is not


@few_and_all(100)
@pytest.mark.parametrize(
    ("lat", "aided", "fixed"), [(60.0, False, False), (60.0, True, False), (85.0, True, False), (-30.0, False, True)]
)
def test_covariance_is_that_of_many_runs(lat, aided, fixed, runs):
    """A manoeuvring flight, every error drawn as the model says.

    NEES of all 15 errors over the runs at the end, chi-square of 1500 degrees of 100 runs: its band of 99.9 % is passed by a false
    alarm in 1e-3 of tests, and so is each of the 15 variance ratios' band (99.98 %).
    """
    from scipy.stats import chi2

    seconds = 240.0
    motion = flight(lat, seconds)
    log = ideal_log(motion, rate=50.0, duration=seconds)
    model = InsModel.from_spec(SPEC)
    root = np.random.default_rng(12)
    last, P = [], None
    states = list(range(STATES))
    if fixed:
        level = course(Position.from_degrees(lat, 10.0, 0.0), straight(seconds), heading=0.5, speed=10.0)
        motion, log = level, ideal_log(level, rate=50.0, duration=seconds)
        model = InsModel.from_spec(SPEC, fixed_altitude=True)
        states.remove(5)
        states.remove(14)  # the vertical accelerometer is not used at all: its bias stays what it was
    for run in range(runs):
        simulation = simulate(log, imu=SPEC, seed=5, run=run)
        dx = SIGMA * root.standard_normal(STATES)
        if fixed:
            dx[5] = 0.0
        aiding = [gnss(motion, seconds, root)] if aided else []
        track = navigate_track(simulation.record, start_at(motion, dx), model, aiding, interval=0.5, every=100)
        last.append(errors_of(track, motion, simulation.errors)[-1])
        P = track.P[-1] if P is None else P
    if fixed:
        assert P[5, 5] == 0.0  # vertical velocity is zero by definition, and so is its error
    e = np.array(last)[:, states]
    P = P[:STATES, :STATES][np.ix_(states, states)]
    total = np.sum(nees(e, np.broadcast_to(P, (runs, *P.shape))))
    low, high = chi2.ppf([5e-4, 1 - 5e-4], runs * len(states))
    assert low < total < high
    ratio = np.mean(e**2, axis=0) / np.diag(P)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], runs) / runs
    assert np.all((low < ratio) & (ratio < high))


@few_and_all(60)
def test_smoother_is_better_than_the_filter_and_as_honest(runs):
    """GNSS with an outage of 100 s: errors in its middle, NEES of position and velocity in its 99.9 % band."""
    from scipy.stats import chi2

    seconds = 240.0
    motion = flight(45.0, seconds)
    log = ideal_log(motion, rate=50.0, duration=seconds)
    model, root = InsModel.from_spec(SPEC), np.random.default_rng(2)
    filtered, smoothed = [], []
    values = []
    for run in range(runs):
        simulation = simulate(log, imu=SPEC, seed=6, run=run)
        start = start_at(motion, SIGMA * root.standard_normal(STATES))
        fixes = gnss(motion, seconds, root)
        kept = (fixes.time < 80.0) | (fixes.time > 180.0)
        fixes = Aiding("GNSS position", "position", fixes.time[kept], fixes.measured[kept], fixes.sigma[kept])
        for smooth, errors in ((False, filtered), (True, smoothed)):
            track = navigate_track(simulation.record, start, model, [fixes], interval=0.5, every=10, smooth=smooth)
            k = int(np.argmin(np.abs(track.time - 150.0)))
            errors.append(errors_of(track, motion, simulation.errors)[k, :9])
        values.append(float(nees(errors[-1], track.P[k][:9, :9])))
    better = np.std(smoothed, axis=0) / np.std(filtered, axis=0)
    assert np.all(better[DP] < 0.5)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 9 * runs)
    assert low < np.sum(values) < high


def test_measurements_in_any_order_at_any_time():
    """Rows in disorder give the bits of rows in order; late ones, given how late, those of the same rows in time."""
    seconds = 60.0
    motion = flight(45.0, seconds)
    record = simulate(motion, rate=50.0, duration=seconds, imu=SPEC, seed=7).record
    s = motion.states(0.0)
    start = Start(0.0, s.C_nb, s.v_n, s.lat, s.lon, s.alt, np.zeros(3), np.zeros(3), np.diag(SIGMA**2))
    model = InsModel.from_spec(SPEC)
    fixes = gnss(motion, seconds, np.random.default_rng(4), (0.0, 0.0, 0.0))
    between = replace(fixes, time=fixes.time + 0.0137)  # amid a sample
    order = np.random.default_rng(5).permutation(len(fixes.time))
    mixed = replace(between, time=between.time[order], measured=between.measured[order], sigma=between.sigma[order])
    a, b = (navigate_track(record, start, model, [aiding]) for aiding in (between, mixed))
    for name in ("C_nb", "v_n", "position", "sensors", "P"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    # From two sensors, one of which hands in seconds later than the other: the filter meets them by the time they hold at.
    first, second = (
        replace(between, time=between.time[k::2], measured=between.measured[k::2], sigma=between.sigma[k::2])
        for k in range(2)
    )
    c = navigate_track(record, start, model, [second, first])
    np.testing.assert_allclose(c.position, a.position, rtol=1e-12)
    np.testing.assert_allclose(c.P, a.P, rtol=1e-6, atol=1e-20)


def test_a_lever_arm_a_lag_and_an_outlier():
    """Lever arm and lag left to the filter are found within 4 sigma; fixes 100 m off are rejected, the sound ones kept."""
    from truenorth.aiding.source import state
    from truenorth.estimate.run import with_states

    seconds, rng = 200.0, np.random.default_rng(4)
    motion = flight(45.0, seconds)
    simulation = simulate(motion, rate=50.0, duration=seconds, imu=SPEC, seed=7)
    fixes = gnss(motion, seconds, rng, arm=(2.0, 5.0, 1.0), offset=-0.15)
    measured = fixes.measured.copy()
    wrong = np.arange(60, 190, 13)
    measured[wrong] = displaced(measured[wrong], np.tile([100.0, -100.0, 0.0], (len(wrong), 1)))
    states = state("GNSS", "lever arm", [3.0, 6.0, 3.0]) | state("GNSS", "lag", 0.2)
    aiding = [Aiding("GNSS position", "position", fixes.time, measured, fixes.sigma, states=states)]
    model = with_states(InsModel.from_spec(SPEC), aiding)
    dx = SIGMA * rng.standard_normal(STATES)
    track = navigate_track(simulation.record, start_at(motion, dx), model, aiding, interval=0.5)
    for name, true in (("GNSS lever arm", [2.0, 5.0, 1.0]), ("GNSS lag", [0.15])):
        where = model.layout.slice_of(name)
        off = track.sensors[-1, where] - true
        assert np.all(np.abs(off) < 4 * track.sigma[-1, where])
    # At constant speed a forward arm and a lag are one combination, seen to centimetres; the arm's prior parts them.
    forward, lag = model.layout.slice_of("GNSS lever arm").start + 1, model.layout.slice_of("GNSS lag").start
    combination = np.zeros(model.states)
    combination[[forward, lag]] = 1.0, -200.0
    off = combination @ track.sensors[-1] - (5.0 - 200.0 * 0.15)
    sigma = np.sqrt(combination @ track.P[-1] @ combination)
    assert sigma < 1.0
    assert abs(off) < 4 * sigma
    assert track.sigma[-1, lag] > 0.9 * 6.0 / 200.0
    assert not np.any(track.residuals[0].used[wrong])
    assert track.residuals[0].rejected == len(wrong)


def test_misalignment_in_a_turn_is_in_the_sigma():
    """200 runs of a flat turn by 90 degrees: RMS tilt over its sigma.

    The turn's noise stands for errors that are the same throughout: it is right for a steady turn of 10 s; this one, with
    its onsets, is a little shorter, and the sigma a little large.
    """
    spec = ImuSpec(gyro_misalignment=np.radians(0.5), gyro_scale_factor=0.01)
    turning = [*straight(2.0), Leg(10.0, turn=np.radians(90.0), bank="flat"), *straight(2.0)]
    motion = course(Position.from_degrees(45.0), turning, speed=5.0)
    log = ideal_log(motion, rate=50.0, duration=14.0)
    model = InsModel.from_spec(spec)
    start = start_at(motion)
    phi = []
    for run in range(200):
        simulation = simulate(log, imu=spec, seed=9, run=run)
        track = navigate_track(simulation.record, replace(start, P=np.zeros((STATES, STATES))), model, every=100)
        phi.append(errors_of(track, motion, simulation.errors)[-1, :3])
    ratio = np.sqrt(np.mean(np.square(phi), axis=0)) / track.sigma[-1, :3]
    assert np.all((ratio > 0.65) & (ratio < 1.1))


def test_third_order_loop_damps_as_its_poles_say():
    """A level IMU at rest, 5 m too high and with an accelerometer bias, under a perfect barometer.

    Three poles at -1/tau: the height error is a polynomial of second order times ``exp(-t/tau)``, and the bias is found.
    """
    lat, tau, T, bias = np.radians(45.0), 60.0, 0.1, 0.01
    count = 12000
    dtheta = np.tile(T * earth_rate_n(lat), (count, 1))
    dvel = np.tile([0.0, 0.0, T * (normal_gravity(lat, 0.0) + bias)], (count, 1))
    record = ImuRecord(T * np.arange(1, count + 1), dtheta, dvel, "increments")
    start = Start(0.0, np.eye(3), np.zeros(3), lat, 0.0, 5.0, np.zeros(3), np.zeros(3), np.diag(SIGMA**2))
    time = record.time[::2]
    baro = Aiding(
        "barometer", "height", time, np.tile([0.0, np.nan, np.nan], (len(time), 1)), np.ones((len(time), 3)), loop=tau
    )
    track = navigate_track(record, start, InsModel(0.0, 0.0), [baro], interval=T, every=10)
    t = track.time / tau
    # e_h(0) = 5, e_v(0) = 0, b(0) = bias: e_h' = -3/tau 5, e_h'' = 9/tau^2 5 - 3/tau^2 5 + bias (c2 - 2g/R = 3/tau^2).
    first, second = -3.0 * 5.0, 6.0 * 5.0 + bias * tau**2
    a, b = first + 5.0, 0.5 * (second + 2.0 * first + 5.0)
    expected = (5.0 + a * t + b * t**2) * np.exp(-t)
    np.testing.assert_allclose(track.position[:, 2], expected, rtol=0, atol=0.02 * np.abs(expected).max())
    assert track.accel_bias[-1, 2] == pytest.approx(bias, rel=1e-3)
    with pytest.raises(UsageError, match="cannot be smoothed"):
        navigate_track(record, start, InsModel(0.0, 0.0), [baro], smooth=True)


@few_and_all(100)
def test_covariance_of_the_loop_is_that_of_many_runs(runs):
    """Noise and bias under the loop: variance of height and vertical velocity in their 99.98 % band."""
    from scipy.stats import chi2

    seconds = 300.0
    motion = rest(Position.from_degrees(45.0))
    log = ideal_log(motion, rate=20.0, duration=seconds)
    model, rng = InsModel.from_spec(SPEC), np.random.default_rng(8)
    time = np.arange(0.5, seconds, 0.5)
    last = []
    for run in range(runs):
        simulation = simulate(log, imu=SPEC, seed=11, run=run)
        measured = np.full((len(time), 3), np.nan)
        measured[:, 0] = rng.standard_normal(len(time))
        baro = Aiding("barometer", "height", time, measured, np.ones((len(time), 3)), gate=0.0, loop=40.0)
        start = start_at(motion, SIGMA * rng.standard_normal(STATES))
        track = navigate_track(simulation.record, start, model, [baro], interval=0.5, every=100)
        last.append(errors_of(track, motion, simulation.errors)[-1])
    ratio = np.mean(np.square(last), axis=0) / np.diag(track.P[-1])[:STATES]
    low, high = chi2.ppf([1e-4, 1 - 1e-4], runs) / runs
    assert np.all((low < ratio) & (ratio < high))


PROGRAM = """
import numpy as np
from truenorth.estimate import loop as kernel
from truenorth.aiding.aids import Barometer, Gnss, Odometer
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import GnssRecord, HeightRecord, ImuRecord, OdometerRecord
from truenorth.records.specs import imu_spec
t, seconds = 0.02 * np.arange(1, 1001), np.arange(1.0, 20.0)
still = np.tile([0.0, 0.0, 9.8], (len(t), 1))
start = Start(0.0, np.eye(3), np.zeros(3), 0.6, 0.1, 0.0, np.zeros(3), np.zeros(3), 1e-4 * np.eye(15))
place = [np.full(19, x) for x in (0.6, 0.1, 0.0)]
aids = {"aid": [
    Gnss(GnssRecord(seconds, *place)), Barometer(HeightRecord(seconds, np.zeros(19)), Mounting()),
    Odometer(OdometerRecord(seconds, np.zeros(19), "speed")),
]}
for kind, scale in (("rates", 1.0), ("increments", 0.02)):
    record = ImuRecord(t, np.zeros((1000, 3)), still * scale, kind)
    for options in ({}, {"zupt": "auto"}, {"smooth": True, "altitude": "free"}, aids):
        navigate(record, start, imu=imu_spec("navigation"), check_clocks=False, **options)
stats = kernel.run.stats
print(len(kernel.run.signatures), sum(stats.cache_misses.values()), sum(stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_a_second_process_compiles_nothing():
    """One specialisation a padded size of the filter's states, whatever the sensors; from the disk the second time."""
    signatures, misses, hits = map(int, said_by_a_second_process(PROGRAM, lambda words: words[1] == "0"))
    assert misses == 0
    assert hits == signatures <= 2
