"""A cheap IMU with an odometer alone: no heading is known, and level is what turns between biases and tilts tell."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth
from truenorth.alignment.in_motion_hidden import HELD, hidden_from
from truenorth.alignment.in_motion_passes import turn_between
from truenorth.alignment.in_motion_start import guesses_all_round
from truenorth.alignment.in_motion_task import moving_task
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.simulation.odometer import OdometerSpec

SPAN, SPEED = 120.0, 12.0
PLACE = Position.from_degrees(40.0, 10.0, 100.0)


def way(heading=1.0):
    turns = s_turn(np.radians(40.0), np.radians(8.0))
    return course(PLACE, [*straight(10.0), *turns, *turns, *turns, *straight(SPAN)], heading=heading, speed=SPEED)


def logs(run, imu="consumer", heading=1.0):
    motion = way(heading)
    record = simulate(motion, rate=50.0, duration=SPAN, seed=78, run=run, imu=imu_spec(imu)).record
    wheel = OdometerSpec(noise=0.02)
    return motion, record, simulate_sensor(motion, wheel, duration=SPAN, seed=78, run=run).record


def task_of(record, odometer, imu="consumer"):
    return moving_task(record, imu, odometer, None, PLACE, None, None, (), True, None, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("runs", [30])
def test_level_is_what_turns_tell(runs):
    """Before: level 3.9 of its sigma, up to 10.5. Two numbers a run; false alarms 1 in 1000."""
    total = 0.0
    for run in range(runs):
        motion, record, odometer = logs(run, heading=0.7 * run)
        answer = truenorth.align(record, PLACE, "consumer", aid=[truenorth.Odometer(odometer)])
        true_up = answer.C_nb @ np.cross(answer.C_nb[2], motion.states(np.array(answer.time)).C_nb[2])
        ratio = true_up[:2] / np.sqrt(np.diag(answer.phi_covariance))[:2]
        assert answer.status == "level_only"
        assert not answer.heading_known
        assert np.abs(ratio).max() < 4.0
        total += float(ratio @ ratio)
    assert total / (2 * runs) < 1.0 + 3.1 * np.sqrt(2 / (2 * runs))


def test_a_heading_that_is_held_stays():
    """It moves by no more than second order, and the level does not depend on which heading it is."""
    _, record, odometer = logs(0)
    task = task_of(record, odometer)
    guess = replace(guesses_all_round(record, odometer, None, task.wheel, task.antenna)[0], heading_sigma=HELD)
    tracks = [
        task.run(replace(guess, C_nb=dcm_from_euler(turn, 0.0, 0.0) @ guess.C_nb), gated=True) for turn in (0.0, 2.0)
    ]
    one, other = tracks
    assert turn_between(one.C_nb[-1], other.C_nb[-1]) == pytest.approx(2.0, abs=np.radians(1.0))
    assert np.degrees(np.abs(one.C_nb[-1, 2] - other.C_nb[-1, 2])).max() < 0.3 * np.degrees(one.sigma[-1, :2].min())


@pytest.mark.parametrize(
    ("imu", "hidden"), [("navigation", False), ("tactical", False), ("industrial", True), ("consumer", True)]
)
def test_gyros_that_hide_the_earths_rate(imu, hidden):
    """By noise and slow parts of their biases: what is constant in the body parts from the earth's rate in turns."""
    _, record, odometer = logs(0, imu)
    assert hidden_from(task_of(record, odometer, imu)) is hidden


@pytest.mark.slow
@pytest.mark.parametrize("swing", [0.0, 5.0, 20.0])
def test_a_vehicle_that_hardly_turns_is_levelled_by_gravity(swing):
    """Passes with a held heading do not part its biases from tilts: level was up to 26 of their sigmas off, straight on."""
    turns = s_turn(np.radians(swing), np.radians(2.0)) if swing else []
    motion = course(PLACE, [*straight(10.0), *turns, *straight(SPAN)], heading=1.0, speed=SPEED)
    record = simulate(motion, rate=50.0, duration=100.0, seed=91, run=0, imu=imu_spec("consumer")).record
    odometer = simulate_sensor(motion, OdometerSpec(noise=0.02), duration=100.0, seed=91, run=0).record
    answer = truenorth.align(record, PLACE, "consumer", aid=[truenorth.Odometer(odometer)])
    sigma = np.sqrt(np.diag(answer.phi_covariance))
    off = answer.C_nb @ np.cross(answer.C_nb[2], motion.states(np.array(answer.time)).C_nb[2])
    assert answer.status == "level_only"
    assert np.abs(off[:2] / sigma[:2]).max() < 4.0
    if not swing:
        assert sigma[:2].min() > 0.9 * imu_spec("consumer").accel_bias / 9.8
