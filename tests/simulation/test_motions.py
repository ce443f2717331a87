"""Every kind of motion through the strapdown, and against the laws that it follows."""

import numpy as np
import pytest
from scipy.interpolate import PPoly

from tests.helpers import come_back
from tests.physics.test_strapdown_coning import residual
from tests.runs import some
from tests.simulation.test_route import TOWN
from truenorth.core.attitude import euler_from_dcm, rotation_vector_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.simulation import Disturbed, Motion, Sway, Tone, rest
from truenorth.simulation.course import Leg, course, ring
from truenorth.simulation.ideal import ideal_log
from truenorth.simulation.manoeuvres import accelerate, climb, s_turn, straight, turn, wing_rock
from truenorth.simulation.profile import Ramp, profile, pulse
from truenorth.simulation.route import Driving, route
from truenorth.simulation.sea import Hull, WaveSpectrum, narrow_band, sea_motion
from truenorth.simulation.tones import cosines
from truenorth.simulation.turntable import Hold, positions, turntable

PLACE = Position.from_degrees(45.0, 10.0, 100.0)
deg = np.radians


def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def flight() -> Motion:
    legs = [
        *straight(20.0),
        *turn(deg(90), deg(3), "coordinated"),
        *s_turn(deg(30), deg(3)),
        *accelerate(250.0, 3.0, 200.0),
        *climb(deg(4), 60.0),
        *turn(deg(-60), deg(3)),
    ]
    motion = course(PLACE, legs, heading=deg(30), speed=200.0, lever_arm=(2.0, -3.0, 1.0))
    return wing_rock(motion, 400.0, 500.0, deg(15), 8.0)


FAMILIES = {
    "ring": ring(PLACE, radius=140.0, speed=15.0, wait=10.0, lever_arm=(0.5, 1.0, 0.3)),
    "flight": flight(),
    "drive": course(PLACE, [Leg(20), Leg(20, speed=15), Leg(60, turn=3.0), Leg(20, slope=0.05), Leg(15, speed=0)]),
    "route": route(TOWN, Driving(radius=12.0), wait=20.0, lever_arm=(0.3, 0.8, 0.5)),
    "sea": Sway(PLACE, 0.5, lever_arm=(5.0, 10.0, 8.0), **sea_motion(WaveSpectrum(3, 9), Hull(), rng(), direction=1.0)),
    "ship under way": Disturbed(
        course(PLACE, [Leg(300), Leg(120, turn=1.5)], heading=0.7, speed=8.0),
        **sea_motion(WaveSpectrum.of_wind(12.0), Hull(), rng(), direction=2.0, heading=0.7, speed=8.0),
    ),
    "swell": Sway(
        PLACE, roll_tones=narrow_band(deg(5), 6.0, 0.15, rng()), pitch_tones=narrow_band(deg(3), 5, 0.15, rng())
    ),
    "turntable": turntable(
        PLACE, [*positions(deg([0, 180, 90]), 60.0), Hold(60, deg(90), deg(80), deg(30))], rate=deg(30)
    ),
}


@pytest.mark.parametrize("name", some([name for name in FAMILIES if name != "swell"], ["swell"]))
def test_an_ideal_imu_comes_back_from_every_smooth_motion(name):
    """720 s at 100 Hz: .05 arcsec, 1e-4 m/s; the position follows within a centimetre."""
    _, turned, v, moved = come_back(FAMILIES[name], 100.0, 720.0, every=10)
    assert np.degrees(np.max(np.abs(turned))) * 3600 < 0.05
    assert np.max(np.abs(v)) < 1e-4
    assert np.max(np.abs(moved)) < 1e-2


def test_a_base_at_rest_senses_one_rate_all_along():
    """A tone too small for a digit takes the long way, by quadrature."""
    quick, slow = (
        ideal_log(Sway(PLACE, 0.7, 0.1, -0.2, lever_arm=(1.0, 2.0, 3.0), roll_tones=tones), rate=100.0, duration=20.0)
        for tones in ((), (Tone(1e-300, 5.0),))
    )
    np.testing.assert_allclose(quick.dtheta, slow.dtheta, rtol=1e-12)
    np.testing.assert_allclose(quick.dvel, slow.dvel, rtol=1e-12)
    np.testing.assert_allclose(quick.leverage, slow.leverage, rtol=1e-9, atol=1e-20)


def test_a_cone_leaves_what_coning_theory_says_and_falls_with_the_rate():
    """Pitch and roll of 2 mrad at 12 Hz, a quarter of a period apart."""
    a, f = 2e-3, 12.0
    cone = Sway(PLACE, pitch_tones=(Tone(a, 1 / f),), roll_tones=(Tone(a, 1 / f, -np.pi / 2),))
    drift = {}
    for rate in (100.0, 200.0):
        t, turned, _, _ = come_back(cone, rate, 20.0, every=10)
        drift[rate] = np.polyfit(t, turned[:, 2], 1)[0]
        theory = a**2 * residual("previous", np.array(2 * np.pi * f / rate)) * rate
        assert abs(drift[rate]) == pytest.approx(abs(theory), rel=0.2)
    assert drift[100.0] / drift[200.0] == pytest.approx(16.0, rel=0.25)  # the fourth power of the interval


def test_a_shaken_mount_leaves_what_sculling_theory_says():
    """Roll of 2 mrad and a lateral vibration of 1 g at 12 Hz in phase; without a correction, then with it."""
    theta, f = 2e-3, 12.0
    w = 2 * np.pi * f
    sculling = Disturbed(
        rest(PLACE), roll_tones=(Tone(theta, 1 / f),), mount_tones=((Tone(9.8 / w**2, 1 / f),), (), ())
    )
    for rate, algorithm in ((100.0, "1"), (100.0, "previous"), (200.0, "previous")):
        t, _, v, _ = come_back(sculling, rate, 20.0, every=10, algorithm=algorithm)
        theory = theta * 9.8 / w * residual(algorithm, np.array(w / rate)) * rate
        assert abs(np.polyfit(t, v[:, 2], 1)[0]) == pytest.approx(abs(theory), rel=0.2)


@pytest.mark.slow
def test_two_days_at_sea_do_not_drift():
    """East along the parallel for 48 h: latitude stays, longitude is distance over the parallel's radius."""
    from truenorth.core.earth import radii

    ship = course(PLACE, [Leg(10.0)], heading=np.pi / 2, speed=10.0)
    at = ship.states(np.array(48 * 3600.0))
    assert abs(float(at.lat) - PLACE.lat) * 6.37e6 < 1e-6
    parallel = (radii(PLACE.lat)[1] + PLACE.alt) * np.cos(PLACE.lat)
    assert abs(float(at.lon) - PLACE.lon - 48 * 3600 * 10.0 / parallel) * parallel < 1e-6


@pytest.mark.slow
def test_a_long_log_is_not_integrated_anew_for_every_block():
    """Blocks in order, as the simulator takes them; their order does not change the bits."""
    ahead, back = (course(PLACE, [Leg(100.0, speed=10.0)], heading=0.4) for _ in range(2))
    starts = np.arange(0.0, 86400.0, 1024.0)
    forwards = [ahead.states(start + np.linspace(0, 1023, 4)).lat for start in starts]
    backwards = [back.states(start + np.linspace(0, 1023, 4)).lat for start in starts[::-1]]
    np.testing.assert_array_equal(forwards, backwards[::-1])
    assert sorted(ahead._tables) == [1, 2, 4, 8, 16, 32, 64, 128]


@pytest.mark.parametrize("name", FAMILIES)
def test_velocity_and_rate_are_derivatives(name):
    """Central differences of position and attitude, at times away from the corners and on them."""
    from truenorth.core.earth import earth_rate_n, radii, transport_rate_n

    motion = FAMILIES[name]
    t, h = np.array([3.3, 77.7, 150.2, 433.1]), 1e-4
    ahead, at, behind = (motion.states(t + s * h) for s in (1, 0, -1))
    R_M, R_N = radii(at.lat)
    north = (ahead.lat - behind.lat) / (2 * h) * (R_M + at.alt)
    east = (ahead.lon - behind.lon) / (2 * h) * (R_N + at.alt) * np.cos(at.lat)
    up = (ahead.alt - behind.alt) / (2 * h)
    np.testing.assert_allclose(np.stack([east, north, up], -1), at.v_n, rtol=1e-8, atol=1e-5)
    w_nb_n = rotation_vector_from_dcm(ahead.C_nb @ np.swapaxes(behind.C_nb, 1, 2)) / (2 * h)
    w_in_n = earth_rate_n(at.lat) + transport_rate_n(at.lat, at.alt, at.v_n)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", at.C_nb, at.w_ib_b), w_nb_n + w_in_n, atol=1e-8)
    dw = (ahead.w_ib_b - behind.w_ib_b) / (2 * h)
    np.testing.assert_allclose(dw, at.dw_ib_b, atol=2e-7)


def test_a_coordinated_turn_has_no_lateral_force():
    motion = course(PLACE, turn(deg(180), deg(3), "coordinated"), speed=200.0)
    at = motion.states(np.array([20.0, 30.0, 40.0]))
    _, _, roll = euler_from_dcm(at.C_nb)
    np.testing.assert_allclose(np.tan(roll), 200.0 * deg(3) / 9.806, rtol=1e-3)
    assert np.max(np.abs(at.f_b[:, 0])) < 0.03  # Coriolis, 2 V w_ie sin L, is what is left


def test_a_turn_has_its_angle_and_its_rate():
    motion = course(PLACE, [*straight(10.0), *turn(deg(-90), deg(3), onset=2.0), *straight(10.0)], speed=50.0)
    at = motion.states(np.array([5.0, 26.0, 60.0]))
    heading = np.degrees(euler_from_dcm(at.C_nb)[0])
    assert (heading[2] + 180) % 360 - 180 == pytest.approx(-90.0, abs=1e-9)
    assert np.degrees(at.w_ib_b[1, 2]) == pytest.approx(3.0, abs=0.01)  # the earth's rate is .003


def test_a_sea_has_its_height_and_its_spectrum():
    """Variance of the elevation is exactly (height/4)^2; of a stiff hull's heave, over time, within 5 %."""
    sea = WaveSpectrum(4.0, 10.0)
    w = np.linspace(0.4, 4.0, 20001) * 2 * np.pi / 10
    assert np.trapezoid(sea.density(w), w) == pytest.approx(1.0, rel=1e-6)
    assert w[np.argmax(sea.density(w))] == pytest.approx(2 * np.pi / 10, rel=1e-3)
    small = Hull(length=0.1, beam=0.1, heave_period=0.01, pitch_period=0.01, roll_period=0.01)
    tones = sea_motion(sea, small, rng(), direction=0.3, components=200)
    assert sum(t.amplitude**2 / 2 for t in tones["up_tones"]) == pytest.approx(1.0, rel=0.01)
    buoy = Sway(PLACE, **tones)
    t = np.arange(0, 20000.0, 0.5)
    assert np.var(buoy.states(t).alt) == pytest.approx(1.0, rel=0.05)
    # A small buoy follows the water's slope. Which frequencies stand for the spectrum's tail is drawn: the mean of 60 seas.
    slope = np.trapezoid(sea.density(w) * w**4, w) / 9.80665**2
    drawn = []
    for seed in range(60):
        tones = sea_motion(sea, small, np.random.default_rng(seed), direction=0.3, components=200)
        drawn.append(sum(t.amplitude**2 / 2 for name in ("pitch_tones", "roll_tones") for t in tones[name]))
    error = np.std(drawn) / np.sqrt(60)
    assert error < 0.03 * slope
    assert abs(np.mean(drawn) - slope) < 3.3 * error  # a false alarm in a thousand


def test_a_fully_developed_sea_follows_the_wind():
    """Pierson and Moskowitz: height .21 U^2/g, peak at .877 g/U."""
    sea = WaveSpectrum.of_wind(15.0)
    assert sea.height == pytest.approx(0.21 * 15**2 / 9.81, rel=0.01)
    assert 2 * np.pi / sea.period == pytest.approx(0.877 * 9.81 / 15, rel=0.01)


def test_waves_on_the_bow_come_oftener_than_waves_astern():
    periods = {}
    for direction in (0.0, np.pi):
        tones = sea_motion(WaveSpectrum(3, 9), Hull(), rng(), direction=direction, heading=0.0, speed=6.0)
        periods[direction] = np.median([t.period for t in tones["up_tones"]])
    assert periods[0.0] > 1.3 * periods[np.pi]


def test_narrow_swell_has_its_width():
    """Half of a Gaussian's height lies 1.177 standard deviations out: 76 % of its energy within."""
    tones = narrow_band(1.0, 6.0, 0.15, rng(), 2000)
    f = np.array([1 / t.period for t in tones])
    assert sum(t.amplitude**2 / 2 for t in tones) == pytest.approx(1.0)
    assert np.mean(np.abs(f * 6 - 1) < 0.075) == pytest.approx(0.761, abs=0.005)


def test_a_table_slews_at_its_rate_and_rests():
    table = turntable(PLACE, positions(deg([0, 180]), 30.0), rate=deg(10), onset=0.5)
    middle, after = table.states(np.array([30 + 9.25, 60.0])).w_ib_b
    assert np.degrees(middle[2]) == pytest.approx(-10.0, abs=0.01)  # heading is clockwise, z is up
    assert np.degrees(np.linalg.norm(after)) * 3600 == pytest.approx(15.04, abs=0.01)


def test_ramps_and_pulses_are_smooth_and_whole():
    p = profile(1.0, [Ramp(2.0, 4.0, 3.0, 1.0), Ramp(7.0, 1.0, -1.0, 0.5)])
    np.testing.assert_allclose(p([0.0, 6.5, 99.0])[0], [1.0, 4.0, 3.0], atol=1e-12)
    x = np.linspace(-1, 10, 11001)
    value, first, second = p(x)
    np.testing.assert_allclose(np.gradient(value, x)[1:-1], first[1:-1], atol=1e-4)
    np.testing.assert_allclose(np.gradient(first, x)[1:-1], second[1:-1], atol=1e-2)
    assert np.max(first) == pytest.approx(3.0 / 3.0)  # change over length less onset
    window, _, _ = pulse(1.0, 9.0, 2.0)(x)
    assert np.max(np.abs(window[x < 1])) == 0.0
    np.testing.assert_allclose(window[(x > 3) & (x < 7)], 1.0, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Tone(1.0, 0.0), "positive period"),
        (lambda: WaveSpectrum(-1.0, 8.0), "significant height"),
        (lambda: Hull(length=0.0), "hull: length"),
        (lambda: turn(0.0, 0.1), "expected an angle"),
        (lambda: accelerate(10.0, 1.0, 10.0), "expected another speed"),
        (lambda: turntable(PLACE, []), "one position at least"),
        (lambda: turntable(PLACE, [Hold(10), Hold(-1, 1.0)]), "position 2"),
        (lambda: course(PLACE, [Leg(10), Leg(10, speed=-1)]), "leg 2"),
        (lambda: ring(PLACE, radius=0.0, speed=5.0), "ring of radius"),
        (lambda: wing_rock(rest(PLACE), 0.0, 1.0, 0.1, 5.0), "window"),
        (lambda: narrow_band(1.0, 5.0, 2.0, rng()), "bandwidth"),
    ],
)
def test_what_cannot_move_so_is_refused(make, words):
    with pytest.raises(UsageError, match=words):
        make()


def test_four_columns_of_times_are_as_each_by_itself():
    """The nodes of the quadrature share registers, two tones at once; of steps that differ each column goes its own way."""
    swell = narrow_band(0.02, 9.0, 0.2, rng(), components=7)
    times = np.arange(200)[:, None] / 100 + np.array([0.001, 0.003, 0.007, 0.009])
    uneven = times + np.where(np.arange(200) > 150, 0.004, 0.0)[:, None]
    for t in (times, uneven):
        for together, own in zip(cosines(swell, t), zip(*(cosines(swell, t[:, [m]]) for m in range(4))), strict=True):
            np.testing.assert_array_equal(together, np.hstack(own))


def test_a_profile_is_its_polynomials():
    """Also beyond its ends, at its breaks, and at times in any order."""
    speed = profile(0.3, [Ramp(1.0, 4.0, 2.0, 1.0), Ramp(7.0, 3.0, -1.0, 0.4)])
    piece = PPoly(speed.coefficients, speed.breaks)
    for x in (rng().uniform(-5.0, 20.0, (50, 4)), speed.breaks, np.array(2.5)):
        for k, found in enumerate(speed(x)):
            np.testing.assert_array_equal(found, piece.derivative(k)(x) if k else piece(x))
