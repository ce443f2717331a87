"""Noisy gyros against a master: how its delay is known, alone and with a long arm between the two."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_turns import KNOWN, MEAN, UNKNOWN, push_of, spins_at, turns_at
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

CONSUMER = replace(imu_spec("consumer"), gyro_scale_factor=0.0, gyro_misalignment=0.0, accel_scale_factor=0.0)
CONSUMER = replace(CONSUMER, accel_misalignment=0.0)
LATE, ARM = 0.03, (1.0, -25.0, 5.0)  # s; m: of the slave from the master
SPAN = 90.0


@pytest.fixture(scope="module")
def ship():
    """8 m/s, rolling by 3.5 and pitching by 1 deg."""
    along = course(Position.from_degrees(20.0, 115.0, 5.0), straight(SPAN + 5.0), heading=0.7, speed=8.0)
    return Disturbed(along, roll_tones=(Tone(np.radians(3.5), 9.0),), pitch_tones=(Tone(np.radians(1.0), 7.0, 0.4),))


@pytest.mark.slow
@few_and_all(2, few=1)
@pytest.mark.parametrize("matching", ["attitude", "both"])
def test_gyro_noise_tells_no_delay(ship, matching, runs):
    """Before: by attitude and velocity the delay was 40 and 20 ms off, 74 and 36 of its sigmas, on a good status."""
    for run in range(runs):
        slave = simulate(ship, imu=CONSUMER, rate=100.0, duration=SPAN, seed=3, run=run).record
        spec = MasterSpec(latency=LATE, lever_arm=ARM, velocity_noise=0.02, attitude_noise=2e-5)
        master = simulate_sensor(ship, spec, duration=SPAN, seed=3, run=run).record
        answer = align_transfer(slave, master, CONSUMER, matching=matching, lever_arm=ARM, lever_arm_sigma=0.3)
        phi = -rotation_vector_from_dcm(answer.C_nb @ ship.states(np.array(answer.time)).C_nb.T)
        found = answer.transfer
        assert answer.status == "aligned"
        assert abs(found.delay - LATE) < 4.0 * found.delay_sigma < 0.04
        assert phi @ np.linalg.solve(answer.phi_covariance, phi) < 21.1  # one of 10,000 is beyond


def rolling(walk):
    """A log at 100 Hz that rolls by 3.5 deg in 9 s, whose gyros walk."""
    time = 0.01 * np.arange(1.0, 6001.0)
    w = 2.0 * np.pi / 9.0
    gyro = np.zeros((6000, 3))
    gyro[:, 1] = np.radians(3.5) * w * np.cos(w * time)
    gyro += walk / 0.1 * np.random.default_rng(4).standard_normal(gyro.shape)
    return ImuRecord(time, gyro, np.tile([0.0, 0.0, 9.8], (6000, 1)))


def test_a_rate_is_a_mean_over_as_long_as_its_changes_need():
    """Of a good gyro the instant does, of a consumer's a mean, of one that drowns the roll nothing."""
    times = np.arange(5.0, 55.0, 0.1)
    assert turns_at(rolling(1e-6), times, 1e-6, 1e-4)[0] is None
    mean, variance = turns_at(rolling(3e-4), times, 3e-4, 1e-4)
    w, half = 2.0 * np.pi / 9.0, 3e-4**2 / (2.0 * variance)
    true = np.radians(3.5) * w * np.cos(w * times) * np.sin(w * half) / (w * half)
    assert np.std(mean[:, 1] - true) == pytest.approx(np.sqrt(variance), rel=0.3)
    assert turns_at(rolling(0.1), times, 0.1, 1e-4) == (None, np.inf)


def test_a_long_arm_needs_quiet_gyros_to_show_the_acceleration_of_the_master():
    """An acceleration of .3 m/s^2, at arms of 1 and 30 m."""
    time = np.arange(0.0, 60.0, 0.1)
    push = push_of(time, np.outer(0.3 * np.sqrt(2.0) * np.sin(time), [1.0, 0.0, 0.0]))
    assert push == pytest.approx(0.3, rel=0.05)  # of means over a second
    known = {
        (walk, arm): spins_at(rolling(walk), time, walk, arm, push)[1]
        for walk in (1e-6, 1.5e-5, 3e-4)
        for arm in (1.0, 30.0)
    }
    assert known[1e-6, 30.0] == known[1.5e-5, 1.0] == KNOWN
    assert known[1.5e-5, 30.0] == MEAN
    assert known[3e-4, 30.0] == UNKNOWN
