"""Lines of the accelerometers: what their sums make of a tone, and turns that explain one."""

import numpy as np
import pytest

from truenorth.campaign.faults import run_faults
from truenorth.quality.force_line import LEAST, line_evidence, line_velocity
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments

RATE, ROWS, NOISE = 100.0, 4000, 2e-3  # Hz, rows, and m/s^2
TIME = np.arange(1, ROWS + 1) / RATE
G = np.array([0.0, 0.0, 9.8])


def log(seed, push, turn=0.0, kind="rates"):
    """A base with noise, pushed and turned by these rows."""
    rng = np.random.default_rng(seed)
    gyro, accel = 1e-5 * rng.standard_normal((ROWS, 3)) + turn, G + NOISE * rng.standard_normal((ROWS, 3)) + push
    unit = 1.0 if kind == "rates" else RATE
    return ImuRecord(TIME, gyro / unit, accel / unit, kind)


def tone(frequency, axis=0):
    return np.eye(3)[axis] * np.sin(2.0 * np.pi * frequency * TIME)[:, None]


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("frequency", [7.3, 20.0, 38.9])
def test_a_line_has_the_velocity_that_its_sums_have(frequency, kind):
    """Of the same rows as the mechanisation sums them, less what begins and ends the log."""
    push = 2.0 * tone(frequency, 1)
    sums = increments(log(1, push, kind=kind))[1] - increments(log(1, 0.0 * push, kind=kind))[1]
    velocity = np.cumsum(sums, axis=0)[1000:-1000, 1]
    assert line_velocity(log(1, push, kind=kind)) == pytest.approx(np.std(velocity), rel=0.02)


@pytest.mark.parametrize("frequency", [7.3, 20.0])
def test_a_base_that_turns_has_the_force_of_its_turn(frequency):
    """Gravity in its axes, and an arm of 2 m; a tenth of the turn does not explain it."""
    w = 2.0 * np.pi * frequency
    cosine = np.cos(w * TIME)[:, None] * np.eye(3)[0]
    push, rate = (9.8 / w + 2.0 * w) * 1e-3 * tone(frequency, 1), 1e-3 * cosine
    assert line_velocity(log(2, push, rate)) == 0.0
    assert line_velocity(log(2, push, 0.1 * rate)) > LEAST


def test_noise_has_no_line():
    """Twenty logs: of their 48,000 frequencies .05 would be loud by chance."""
    assert max(line_velocity(log(seed, 0.0)) for seed in range(20)) < LEAST


def test_a_log_too_short_or_too_slow_says_nothing():
    record = log(3, tone(20.0))
    assert line_evidence(ImuRecord(record.time[:1000], record.gyro[:1000], record.accel[:1000], "rates")) == []
    assert line_evidence(ImuRecord(10.0 * record.time, record.gyro, record.accel, "rates")) == []


@pytest.mark.slow
def test_a_hum_on_the_move_is_in_sigma():
    """Of seed 303 three were beyond three sigmas: one of velocity, and two of level, whose gyros hum."""
    trials = run_faults(["navigate"], ["hum", "none"], runs=12, seed=303)
    assert [t for t in trials if t.outcome in ("silent", "crash")] == []
