"""The gyros' noise in a log that something has smoothed: by it their unit is known, and a part of it would be a better sensor."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from tests.runs import few_and_all
from truenorth.core.earth import EARTH_RATE
from truenorth.formats.behaviour import DEG, SURE_GYRO, gyro_facts, gyro_readings

HERTZ, WALK, FORCE_WALK = 150.0, 0.13 * DEG / 60.0, 60e-6  # rad/sqrt(s), g sqrt(s): of a phone's IMU


def at_rest(rng, smooth, mean=54.7):
    """A minute of such an IMU whose gyros show so many rates of the earth: rad/s and g."""
    noise = rng.standard_normal((int(60 * HERTZ) + 1000, 6)) * np.sqrt(HERTZ) * np.repeat([WALK, FORCE_WALK], 3)
    noise = smooth(noise)[1000:]
    toward = rng.standard_normal(3)
    gyro = noise[:, :3] + mean * EARTH_RATE * toward / np.linalg.norm(toward)
    return np.arange(len(noise)) / HERTZ, gyro, noise[:, 3:] + [0.0, 0.0, 1.0]


def as_written(noise):
    return noise


def low_pass(noise):
    """Of second order at 7 Hz, as the sensors have it."""
    return lfilter(*butter(2, 7.0 / (HERTZ / 2.0)), noise, axis=0)


def interpolated(noise):
    """By lines between every fourth row."""
    known = np.arange(0, len(noise), 4)
    return np.stack([np.interp(np.arange(len(noise)), known, column) for column in noise[known].T / 2.0], axis=1)


@pytest.mark.parametrize("smooth", [as_written, low_pass, interpolated])
@few_and_all(40, few=5)
def test_the_noise_is_that_of_the_sensor(smooth, runs):
    for run in range(runs):
        facts = gyro_facts(*at_rest(np.random.default_rng([run, 1]), smooth), "rates")
        assert 0.6 < facts.walk / WALK < 1.5
        assert 0.6 < facts.force_walk / FORCE_WALK < 1.5


@pytest.mark.parametrize("smooth", [as_written, low_pass, interpolated])
@few_and_all(40, few=5)
def test_a_bias_that_is_the_earths_rate_in_another_unit_is_not_taken_for_it(smooth, runs):
    """A walk with a phone's sensor, in rad/s, was read in deg/s: so smooth a log had the noise of a ring laser."""
    for run in range(runs):
        time, gyro, accel = at_rest(np.random.default_rng([run, 2]), smooth)
        facts = gyro_facts(time, gyro, accel, "rates")
        best = gyro_readings(facts, "rates", "g")[0]
        assert best.unit == "rad/s" or best.probability < SURE_GYRO


def test_a_sway_is_no_noise():
    """It is smooth in tenths of a second, too: the step of the rows counts there."""
    time, gyro, accel = at_rest(np.random.default_rng(3), as_written)
    sway = 0.003 * np.cos(2.0 * np.pi * time / 4.0)[:, None] * [1.0, -1.0, 0.5]
    assert 0.9 < gyro_facts(time, gyro + sway, accel, "rates").walk / WALK < 1.5
