"""Noise of sensors on a swaying base: asked of the level axes, along which the motion of the base is fitted well."""

import math

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import indexed, moored
from truenorth.alignment.sway_noise import noisier_sensors
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import StaticModel
from truenorth.errors.sway import AxisMotion, Oscillator
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec

RATE, DURATION = 10.0, 300.0  # Hz, s: rows too few to show the noise above the sway
SPEC = imu_spec("industrial")
NOISE = StaticModel.of(SPEC)
PLACE = Position(math.radians(45.0), 0.0, 0.0)
SEA, SECOND, SLOW = (2.0 * math.pi / period for period in (5.0, 11.0, 100.0))
LEVEL = AxisMotion(1e-3, (Oscillator(1, 0.05, SEA, 1e-6), Oscillator(1, 0.01, SLOW, 1e-2)))
HEAVE = AxisMotion(1e-3, (Oscillator(1, 0.08, SEA, 1e-6),))


def noisier(louder, seed):
    """Of a level IMU in a sea, that heaves in two tones of which the fit of its motion has one; `louder`: its accelerometers."""
    rng = np.random.default_rng(seed)
    t = np.arange(1, round(RATE * DURATION) + 1) / RATE
    phase = rng.uniform(0.0, 2.0 * math.pi, 7)

    def pushed(size, w, k):
        return math.sqrt(2.0) * size * w * np.cos(w * t + phase[k])

    level = [pushed(0.05, SEA, k) + pushed(0.01, SLOW, 2 + k) for k in (0, 1)]
    up = gravity_of_place(PLACE.lat, PLACE.alt) + pushed(0.08, SEA, 4) + pushed(0.06, SECOND, 5)
    accel = np.stack([*level, up], axis=1)
    accel += louder * NOISE.accel_random_walk * math.sqrt(RATE) * rng.standard_normal(accel.shape)
    gyro = np.tile(EARTH_RATE * np.array([0.0, math.cos(PLACE.lat), math.sin(PLACE.lat)]), (len(t), 1))
    gyro += NOISE.gyro_random_walk * math.sqrt(RATE) * rng.standard_normal(gyro.shape)
    record = ImuRecord(t, gyro, accel, "rates")
    log = StayingLog(record, np.eye(3), PLACE, NOISE, prior_of(np.diag(SPEC.bias_variance)), 1.0, sways=True)
    return noisier_sensors(log, (LEVEL, LEVEL, HEAVE), 1.0, lambda: 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_heave_of_two_tones_is_no_noise(seed):
    assert noisier(1.0, seed) == {}


@pytest.mark.parametrize("seed", range(4))
def test_noise_of_accelerometers_shows_along_the_level(seed):
    assert noisier(6.0, seed).get("accel", 0.0) >= 4.0


@pytest.mark.slow
@pytest.mark.parametrize("number", [16, 19])
def test_an_indexer_of_a_ship_that_heaves_in_two_tones(number):
    """Both were refused for accelerometers four times as noisy as they are."""
    outcome = indexed(moored, "industrial", 400.0)(1, number)
    assert not outcome.refused
    assert np.abs(outcome.ratios["level"]).max() < 4.0
