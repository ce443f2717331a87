"""The state from which a pass over a log on the move begins."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_start import (
    BANK_LEVEL,
    GNSS_START,
    HEADINGS,
    LEVEL_TIME,
    Guess,
    guesses_all_round,
    start_at,
)
from truenorth.core.attitude import misalignment
from truenorth.core.position import Position
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate, simulate_sensor
from truenorth.simulation.course import Leg, course
from truenorth.simulation.gnss import GnssSpec
from truenorth.state.layout import DV, PHI
from truenorth.state.mounting import Mounting

SPEC = imu_spec("tactical")


@pytest.mark.parametrize(
    ("mounting", "arm"), [({"lever_arm": np.array([0.0, 3.0, 4.0])}, 5.0), ({"lever_arm_sigma": 2.0}, 3.46)]
)
def test_an_antenna_that_swings_does_not_show_the_velocity_of_the_imu(mounting, arm):
    """Rolling by 15 deg/s RMS on an arm of 5 m: 1.3 m/s that the IMU does not have, and by .3 m/s of sigma were rejected."""
    dt, size = 0.01, np.radians(15.0) * np.sqrt(2.0)
    time = dt * np.arange(1, 2001)
    gyro = size * np.sin(2.0 * np.pi * time)[:, None] * [0.0, 1.0, 0.0]
    record = ImuRecord(time, dt * gyro, np.tile([0.0, 0.0, 9.8 * dt], (len(time), 1)), kind="increments")
    fixes = np.arange(0.0, 20.0)
    gnss = GnssRecord(fixes, 0.0 * fixes + 0.8, 0.0 * fixes, 0.0 * fixes, v_n=np.zeros((len(fixes), 3)))
    guess = Guess(np.eye(3), 0.01, 0.1)
    place = Position(0.8, 0.0, 0.0)
    start = start_at(record, guess, place, SPEC, None, gnss, Mounting(), Mounting(**mounting))
    still = start_at(record, guess, place, SPEC, None, gnss, Mounting(), Mounting())
    assert np.sqrt(np.diag(still.P)[DV]) == pytest.approx(GNSS_START)
    assert np.sqrt(np.diag(start.P)[DV]) == pytest.approx(np.hypot(GNSS_START, arm * np.radians(15.0)), rel=0.01)


@pytest.mark.parametrize("heading", [0.0, 1.0, 2.5, 4.0, 5.5])
@pytest.mark.parametrize("late", [-0.2, 0.0, 0.2])
def test_a_bank_of_guesses_in_a_steep_turn_holds_the_attitude(heading, late):
    """Of an aircraft that banks by 60 deg, one guess is half a step off about the vertical that it feels, and little across."""
    rate, speed = math.radians(24.0), 40.0
    legs = [Leg(62.0, turn=60.0 * rate, bank="coordinated")]
    motion = course(Position(0.8, 0.1, 500.0), legs, heading=heading, speed=speed)
    sim = simulate(motion, rate=50.0, duration=40.0, imu="navigation", seed=1)
    receiver = GnssSpec(rate=5.0, position_noise=1.0, velocity_noise=0.1)
    gnss = simulate_sensor(motion, receiver, duration=40.0, seed=1).record.shifted(late).between(10.0, None)
    record = sim.record.between(10.0, None)
    first, last = np.searchsorted(sim.truth.time, record.time[0] - record.steps[0] + np.array([0.0, LEVEL_TIME]) - 1e-6)
    truth = sim.truth.C_nb[first]
    assert math.acos(truth[2, 2]) == pytest.approx(math.atan(speed * rate / 9.8), abs=0.02)
    felt = sim.truth.v_n[last] - sim.truth.v_n[first] + np.array([0.0, 0.0, 9.806 * LEVEL_TIME])
    axis = felt / np.linalg.norm(felt)
    guesses = guesses_all_round(record, None, gnss, Mounting(), Mounting(latency_sigma=0.2))
    off = min((misalignment(guess.C_nb, truth) for guess in guesses), key=lambda phi: float(np.linalg.norm(phi)))
    about, across = float(off @ axis), float(np.linalg.norm(off - (off @ axis) * axis))
    assert abs(about) < math.pi / HEADINGS + 0.01
    assert across < math.radians(5.0 if late else 1.0)
    assert across < guesses[0].level_sigma


def test_noise_of_a_receiver_tilts_no_bank():
    """At rest, with the receiver that is supposed where nobody says more: level as the force shows it."""
    place = Position(0.8, 0.1, 500.0)
    record = simulate(rest(place, 0.3), rate=50.0, duration=20.0, imu="navigation", seed=1).record
    for seed in range(10):
        spec = GnssSpec(rate=5.0, position_noise=1.0, velocity_noise=0.1)
        gnss = simulate_sensor(rest(place, 0.3), spec, duration=20.0, seed=seed).record
        for guess in guesses_all_round(record, None, gnss, Mounting(), Mounting(latency_sigma=0.2)):
            assert guess.C_nb[2, 2] == pytest.approx(1.0, abs=1e-6)
            assert guess.level_sigma == BANK_LEVEL


@pytest.mark.parametrize("shows", ["places", "velocities"])
@pytest.mark.parametrize("apart", [0.1, 1.0])
def test_an_aircraft_that_turns_begins_with_the_velocity_of_its_first_moment(shows, apart):
    """Not with that of half a second or a second later, which is what fixes show first: 4.6 m/s^2 at 25 deg of bank."""
    speed, bank = 50.0, math.radians(25.0)
    rate = 9.8 * math.tan(bank) / speed
    motion = course(
        Position(0.8, 0.1, 500.0), [Leg(62.0, turn=60.0 * rate, bank="coordinated")], heading=1.0, speed=speed
    )
    sim = simulate(motion, rate=100.0, duration=40.0, imu="tactical", seed=1)
    receiver = GnssSpec(rate=1.0 / apart, position_noise=0.02, velocity_noise=0.05)
    gnss = simulate_sensor(motion, receiver, duration=40.0, seed=1).record.between(10.5, None)
    if shows == "places":
        gnss = replace(gnss, v_n=None, velocity_sigma=None)
    record = sim.record.between(10.0, None)
    begin = int(np.searchsorted(sim.truth.time, record.time[0] - record.steps[0] - 1e-6))
    guess = Guess(sim.truth.C_nb[begin], math.radians(0.5), math.radians(3.0))
    antenna = Mounting(latency_sigma=0.2)
    start = start_at(record, guess, Position(0.8, 0.1, 500.0), SPEC, None, gnss, Mounting(), antenna)
    sigma = np.sqrt(np.diag(start.P)[DV])
    assert np.all(np.abs(start.v_n - sim.truth.v_n[begin]) < 0.5)
    assert np.all(sigma < 1.5)


def test_a_receiver_that_comes_late_to_a_vehicle_at_rest_shows_its_velocity():
    """A minute by the IMU alone would make it unsure by tens of m/s, and it rests."""
    place = Position(0.8, 0.1, 500.0)
    record = simulate(rest(place, 0.3), rate=50.0, duration=80.0, imu="navigation", seed=1).record
    receiver = GnssSpec(rate=5.0, position_noise=1.0, velocity_noise=0.1)
    gnss = simulate_sensor(rest(place, 0.3), receiver, duration=80.0, seed=1).record.between(60.0, None)
    start = start_at(record, Guess(np.eye(3), 0.01, 0.1), place, SPEC, None, gnss, Mounting(), Mounting())
    assert np.all(np.sqrt(np.diag(start.P)[DV]) < 1.0)


@pytest.mark.parametrize(
    ("imu", "seed", "rate", "late"), some([("tactical", 1, 10.0, -0.4)], [("navigation", 2, 1.0, 0.0)])
)
def test_an_aircraft_that_turns_is_aligned_by_fixes_of_centimetres_alone(imu, seed, rate, late):
    """With the velocity of half a second later nine fixes of ten were refused; and so with .4 s taken along the tangent."""
    speed = 40.0 + 10.0 * seed
    turn = 20.0 * 9.8 * math.tan(math.radians(25.0)) / speed * (-1.0) ** seed
    legs = [Leg(20.0, turn=way * turn, bank="coordinated") for way in (1.0, -1.0, 1.0)]
    motion = course(Position(0.8, 0.1, 500.0), legs, heading=float(seed), speed=speed)
    sim = simulate(motion, rate=100.0, duration=60.0, imu=imu, seed=seed)
    receiver = GnssSpec(rate=rate, position_noise=0.02, velocity_noise=0.05)
    gnss = simulate_sensor(motion, receiver, duration=60.0, seed=seed).record.shifted(late).between(8.5, None)
    gnss = replace(gnss, v_n=None, velocity_sigma=None)
    answer = align_in_motion(sim.record.between(8.0, None), imu, gnss=gnss, antenna=Mounting(latency_sigma=0.2))
    moving = answer.moving
    assert answer.status == "aligned"
    off = misalignment(answer.C_nb, sim.truth.C_nb[-1]) / moving.track.sigma[-1, PHI]
    assert np.all(np.abs(off) < 3.5)
    delay, sigma = moving.delays["GNSS"]
    assert abs(delay - late) < 3.5 * sigma
    assert sigma < 0.01


def test_first_fixes_that_are_poor_show_a_poor_velocity():
    """Of 50 m, though all later ones are good to 2 cm: the median counted, and level was 17 sigmas off."""
    place = Position(0.8, 0.1, 500.0)
    record = simulate(rest(place), rate=50.0, duration=60.0, imu=SPEC, seed=1).record
    t, said = np.arange(0.2, 60.0), np.full((60, 3), 0.02)
    said[:5] = 50.0
    ones = np.ones(60)
    for sigma, least, most in ((said, 70.0, 75.0), (np.full((60, 3), 0.02), 0.3, 0.5)):
        gnss = GnssRecord(t, 0.8 * ones, 0.1 * ones, 500.0 * ones, position_sigma=sigma)
        start = start_at(record, Guess(np.eye(3), 0.01, 0.1), place, SPEC, None, gnss, Mounting(), Mounting())
        assert least < math.sqrt(start.P[DV, DV][0, 0]) < most
