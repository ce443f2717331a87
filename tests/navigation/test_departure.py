"""A start at rest ends before the vehicle departs, however gently; a base that sways in the sea is at rest."""

import math
from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.errors import AlignmentError
from truenorth.navigation.departure import departure
from truenorth.simulation import Sway, rest, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

PLACE = tn.Position.from_degrees(48.0, 11.0, 500.0)
HEADING, SIGMA = math.radians(123.0), math.radians(0.5)
STILL = 30.0  # s
GRADES = ("tactical", "industrial", "consumer")


def _off(start, motion):
    """What a start is off by, in its sigmas: level and velocity."""
    true = motion.states(start.time)
    tilt = -rotation_vector_from_dcm(start.C_nb @ true.C_nb.T)
    sigma = np.sqrt(np.diag(start.P))
    return np.abs(np.append(tilt[:2], start.v_n - true.v_n)) / np.append(sigma[:2], sigma[3:6])


@pytest.mark.parametrize("imu", GRADES)
@pytest.mark.parametrize(("acceleration", "onset"), some([(0.3, 15.0)], [(0.6, 8.0)]))
def test_a_gentle_departure_ends_the_rest(imu, acceleration, onset):
    """A train gains half a metre a second in five to ten seconds; a look of half a minute takes that for a tilt."""
    motion = course(
        PLACE, [*straight(STILL), *accelerate(12.0, acceleration, 0.0, onset), *straight(60.0)], heading=HEADING
    )
    log = simulate(motion, rate=25.0, duration=70.0, imu=imu, seed=5).record
    start = tn.known_start(log, PLACE, imu, HEADING, SIGMA)
    assert start.time <= STILL + 0.2 * onset
    assert (_off(start, motion) < 4.0).all()
    time = np.arange(1.0, 69.0)
    s = motion.states(time)
    fixes = tn.GnssRecord(time, s.lat, s.lon, s.alt, s.v_n)
    assert tn.navigate(log, start, aid=tn.Gnss(fixes), imu=imu).status == "navigated"


def test_a_base_that_begins_to_turn_leaves():
    """A crane turns where it stands."""
    motion = course(
        PLACE, [*straight(STILL), *turn(math.radians(90.0), math.radians(6.0)), *straight(20.0)], heading=HEADING
    )
    log = simulate(motion, rate=50.0, duration=60.0, imu="consumer", seed=6).record
    assert 15.0 < departure(log).time <= STILL


@pytest.mark.parametrize("imu", [*GRADES, "navigation"])
def test_a_base_that_stays_does_not_leave(imu):
    for seed in range(5):
        log = simulate(rest(PLACE, HEADING, 0.02, -0.03), rate=50.0, duration=120.0, imu=imu, seed=seed).record
        assert departure(log) is None


def test_a_buoy_is_at_rest():
    """The waves push it by metres a second; it goes nowhere."""
    roll = (Tone(math.radians(8.0), 5.0, 0.3), Tone(math.radians(5.0), 6.3, 1.0))
    east = (Tone(0.6, 5.0, 0.1), Tone(0.4, 6.3, 2.0))
    still = rest(PLACE, HEADING, 0.02, -0.03)
    motion = Disturbed(
        roll_tones=roll, pitch_tones=roll[::-1], east_tones=east, north_tones=east, up_tones=east, motion=still
    )
    log = simulate(motion, rate=50.0, duration=150.0, imu="industrial", seed=7).record
    start = tn.known_start(log, PLACE, "industrial", HEADING, SIGMA)
    assert start.time == pytest.approx(120.0, abs=1.0)
    assert (_off(start, motion) < 4.0).all()


@pytest.mark.parametrize("imu", ["tactical", "industrial"])
@pytest.mark.parametrize("way", ["east", "north", "up"])
def test_a_base_that_surges_without_a_roll_has_its_speed_in_sigma(imu, way):
    """It came from the means of an industrial IMU, which said nothing of it: the start was 16 to 226 of its sigmas off."""
    tones = {f"{way}_tones": (Tone(0.15, 11.0, 0.4), Tone(0.08, 14.3, 2.0))}
    motion = Sway(PLACE, heading=HEADING, **tones)
    log = simulate(motion, rate=25.0, duration=121.0, imu=imu, seed=4).record
    start = tn.known_start(log, PLACE, imu, HEADING, SIGMA)
    assert (_off(start, motion) < 4.0).all()
    assert np.sqrt(np.diag(start.P)[3:6]).max() < 0.3


@pytest.mark.parametrize("imu", GRADES)
def test_a_base_at_rest_has_a_velocity_of_millimetres(imu):
    motion = rest(PLACE, HEADING, 0.02, -0.03)
    start = tn.known_start(
        simulate(motion, rate=50.0, duration=60.0, imu=imu, seed=8).record, PLACE, imu, HEADING, SIGMA
    )
    assert (_off(start, motion) < 4.0).all()
    assert np.sqrt(np.diag(start.P)[3:6]).max() < {"tactical": 0.002, "industrial": 0.004, "consumer": 0.012}[imu]


def _ship(seed):
    """That rolls little and surges; drawn."""
    rng = np.random.default_rng([7, seed])
    period, amplitude = rng.uniform(6.0, 14.0), rng.uniform(0.05, 0.4)
    roll = Tone(math.radians(rng.uniform(0.3, 3.0)), rng.uniform(5.0, 12.0), rng.uniform(0.0, 6.0))
    yaw = Tone(math.radians(rng.uniform(0.1, 1.0)), rng.uniform(8.0, 20.0), rng.uniform(0.0, 6.0))
    first = Tone(amplitude, period, rng.uniform(0.0, 6.0))
    surge = (first, Tone(0.5 * amplitude, 1.3 * period, rng.uniform(0.0, 6.0)))
    return Sway(PLACE, heading=HEADING, roll_tones=(roll,), heading_tones=(yaw,), north_tones=surge)


@pytest.mark.parametrize("seed", [10, 24, 29, 31])
def test_a_ship_that_rolls_little_and_surges_has_not_departed(seed):
    """Of 40 drawn ships these were refused: the first half of the first ten seconds is less than a wave."""
    motion = _ship(seed)
    log = simulate(motion, rate=25.0, duration=121.0, imu="industrial", seed=seed).record
    assert departure(log) is None
    start = tn.known_start(log, PLACE, "industrial", HEADING, SIGMA)
    assert start.time == pytest.approx(120.0, abs=1.0)
    assert (_off(start, motion) < 4.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("imu", ["tactical", "industrial"])
def test_ships_that_roll_little_and_surge_have_starts(imu):
    for seed in range(20):
        motion = _ship(seed)
        log = simulate(motion, rate=25.0, duration=121.0, imu=imu, seed=seed).record
        assert (_off(tn.known_start(log, PLACE, imu, HEADING, SIGMA), motion) < 4.0).all()


def test_a_ship_that_departs_in_a_seaway_leaves():
    """The waves push it by more than it gains in a second; without them it is seen to go."""
    course_of = course(PLACE, [*straight(46.0), *accelerate(10.0, 0.08, 0.0, 15.0), *straight(60.0)], heading=HEADING)
    roll, surge = (Tone(math.radians(1.5), 7.0, 1.0),), (Tone(0.1, 9.0, 2.0),)
    motion = Disturbed(roll_tones=roll, north_tones=surge, motion=course_of)
    log = simulate(motion, rate=25.0, duration=121.0, imu="industrial", seed=37).record
    start = tn.known_start(log, PLACE, "industrial", HEADING, SIGMA)
    assert start.time < 70.0
    assert (_off(start, motion) < 4.0).all()


@pytest.mark.parametrize(("still", "acceleration"), [(1.0, 0.3), (3.0, 0.05), (5.0, 0.6)])
def test_one_that_departs_before_it_is_seen_to_stay_is_refused(still, acceleration):
    """Its start was taken at 10 s, with a velocity up to 41 of its sigmas off."""
    motion = course(
        PLACE, [*straight(still), *accelerate(12.0, acceleration, 0.0, 5.0), *straight(60.0)], heading=HEADING
    )
    log = simulate(motion, rate=50.0, duration=90.0, imu="tactical", seed=5).record
    with pytest.raises(AlignmentError, match="the vehicle moves within the first"):
        tn.known_start(log, PLACE, "tactical", HEADING, SIGMA)


@pytest.mark.parametrize("imu", ["tactical", "industrial"])
def test_a_base_that_rests_and_then_shuttles_has_left(imu):
    """A forklift to and fro at 1 m/s: taken for a sway, its start was under way, 27 sigmas off."""
    log = simulate(rest(PLACE, HEADING), rate=50.0, duration=120.0, imu=imu, seed=3).record
    phase = np.where(log.time > 16.0, (log.time - 16.0) % 14.0, np.nan)  # there, a stop of a second, and back
    pushes = sum(sign * ((phase >= at) & (phase < at + 2.0)) for at, sign in ((0, 1), (4, -1), (7, -1), (11, 1)))
    scale = log.interval if log.kind == "increments" else 1.0
    shuttled = replace(log, accel=log.accel + scale * 0.5 * np.outer(pushes, [0.0, 1.0, 0.0]))
    start = tn.known_start(shuttled, PLACE, imu, HEADING, SIGMA)
    assert start.time < 16.0
    assert _off(start, rest(PLACE, HEADING)).max() < 4.0


def test_accelerometers_that_settle_are_no_departure():
    """By 2 mg within half a minute, of 8 mg that they may be off by: refused as a vehicle that had left."""
    log = simulate(rest(PLACE, HEADING), rate=50.0, duration=120.0, imu="industrial", seed=1).record
    scale = log.interval if log.kind == "increments" else 1.0
    settles = 0.02 * np.exp(-log.time / 15.0)
    assert departure(replace(log, accel=log.accel + scale * np.outer(settles, [1.0, 0.3, 0.2]))) is None


def test_a_ship_that_sways_by_ten_degrees_has_not_departed():
    """The ship of the demo: of her waves means of half a minute leave more than of noise."""
    of = (("heading_tones", 5.0, 7.0, 1.05), ("pitch_tones", 7.0, 5.0, 0.79), ("roll_tones", 10.0, 6.0, 0.45))
    turns = {name: (Tone(math.radians(size), period, phase),) for name, size, period, phase in of}
    pushes = {"north_tones": (Tone(0.03, 6.0, 1.0),), "up_tones": (Tone(0.3, 8.0, 2.0),)}
    ship = Sway(PLACE, heading=math.radians(330.0), **turns, **pushes)
    log = simulate(ship, rate=50.0, duration=300.0, imu="navigation", seed=1).record
    for begin in range(0, 180, 30):
        assert departure(log.between(begin, begin + 120.0)) is None
