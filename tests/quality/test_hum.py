"""Gyros that hum without a tilt of gravity, and a base that really trembles."""

import math

import numpy as np
import pytest

from truenorth.campaign.faults import run_faults
from truenorth.quality.hum import hum_evidence, hum_of
from truenorth.records import ImuRecord
from truenorth.records.vibration import share_left

RATE, ROWS, G = 100.0, 6000, 9.8
TIME = np.arange(ROWS) / RATE
LAT = math.radians(40.0)
NOISE = (3e-7 * math.sqrt(RATE), 1e-4 * math.sqrt(RATE))  # of a navigation-grade IMU: rad/s, m/s^2


def log(rng, frequency, size, *, tilts, arm=0.0):
    """A cone of `size` (rad) about x and y, as gyros show it; where it tilts, with what it makes of gravity and on an arm up."""
    w = 2.0 * np.pi * frequency
    turn = size * np.column_stack([np.sin(w * TIME), np.cos(w * TIME), np.zeros(ROWS)])
    rate = size * w * np.column_stack([np.cos(w * TIME), -np.sin(w * TIME), np.zeros(ROWS)])
    force = np.tile([0.0, 0.0, G], (ROWS, 1))
    if tilts:
        force += np.cross([0.0, 0.0, G - w**2 * arm], turn)
    gyro, accel = (
        values + sigma * rng.standard_normal((ROWS, 3)) for values, sigma in zip((rate, force), NOISE, strict=True)
    )
    return ImuRecord(TIME, gyro, accel, "rates")


@pytest.mark.parametrize("frequency", [7.0, 20.0, 40.0])
@pytest.mark.parametrize("size", [2.5e-5, 1e-3])
def test_a_hum_is_a_drift_and_a_turn_that_nothing_has(frequency, size):
    found = hum_of(log(np.random.default_rng(1), frequency, size, tilts=False))
    x = 2.0 * np.pi * frequency / RATE
    drift = (
        0.5 * RATE * x * size**2 * (1.0 + float(share_left(x)))
    )  # of which the integration makes less the fewer rows there are
    assert np.linalg.norm(found.drift) == pytest.approx(drift, rel=0.05)
    assert found.turn == pytest.approx(size / math.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("frequency", [7.0, 20.0, 40.0])
@pytest.mark.parametrize("arm", [0.0, -0.02, 0.05, 1.0])
def test_a_base_that_trembles_hums_in_nothing(frequency, arm):
    for size in (3e-5, 1e-3):
        assert hum_evidence(log(np.random.default_rng(2), frequency, size, tilts=True, arm=arm), LAT) == []


def test_noise_alone_is_no_hum():
    for seed in range(20):
        assert hum_evidence(log(np.random.default_rng(seed), 20.0, 0.0, tilts=False), LAT) == []


def test_a_log_too_short_or_too_slow_says_nothing():
    record = log(np.random.default_rng(3), 20.0, 1e-3, tilts=False)
    assert hum_evidence(record[:20], LAT) == []
    for times in (10.0, 20.0):  # a row of 10 Hz shows 5 Hz alone
        assert hum_evidence(ImuRecord(times * TIME, record.gyro, record.accel, "rates"), LAT) == []


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["still", "swaying", "rotary"])
def test_none_passes_in_silence(procedure):
    assert [t for t in run_faults([procedure], ["hum"], runs=14, seed=303) if t.outcome == "silent"] == []
