"""Increments whose stamps are whole milliseconds: on the even clock of the sensor, where there is one."""

import numpy as np
import pytest

from truenorth import align
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.quality.held import as_sampled
from truenorth.quality.rounded_stamps import ROUNDED, at_even_steps
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario

TICK = 1e-3


def record_at(time, step, kind="increments", stamps=None):
    """Gravity, and a turn of 1 deg/s, by the true steps."""
    part = np.diff(time, prepend=time[0] - step)[:, None] if kind == "increments" else 1.0
    gyro = part * np.radians([0.0, 0.0, 1.0]) * np.ones((len(time), 1))
    accel = part * np.array([0.0, 0.0, STANDARD_GRAVITY]) * np.ones((len(time), 1))
    stamps = np.round(time / TICK) * TICK if stamps is None else stamps
    return ImuRecord(stamps, gyro, accel, kind)


@pytest.mark.parametrize("began", [0.0, 1.7e9])
@pytest.mark.parametrize("rate", [160.0, 300.0, 400.0, 601.3, 800.0, 998.0])
def test_increments_are_taken_at_the_sensors_steps(rate, began):
    time = began + np.arange(4000) / rate
    rounded = record_at(time, 1.0 / rate)
    even = at_even_steps(rounded)
    assert even.taken_for[-1].what == ROUNDED
    assert np.abs(even.time - time).max() < TICK
    force = even.accel[1:, 2] / even.steps[1:]
    raw = rounded.accel[1:, 2] / rounded.steps[1:]
    # Of a few hertz beside whole milliseconds, stamps jump by one tick once in many rows, and the mean over 201 rows follows.
    assert np.std(force) < 0.2 * np.std(raw)


def test_a_lost_row_is_a_step_of_two():
    time = np.delete(np.arange(3000) / 400.0, [700, 1900])
    even = at_even_steps(record_at(time, 1 / 400.0))
    assert np.abs(even.time - time).max() < TICK
    assert np.flatnonzero(even.steps > 1.5 / 400.0).tolist() == [700, 1899]


def lossy(rate, every, seed=3):
    """Even stamps of whole ticks, rows lost by chance."""
    time = np.arange(8000) / rate
    return np.delete(time, np.flatnonzero(np.random.default_rng(seed).random(8000) < 1.0 / every))


@pytest.mark.parametrize("rate", [10.0, 100.0, 250.0, 1000.0])
@pytest.mark.parametrize("every", [20, 300, 600, 2000])
def test_rows_that_are_lost_are_no_rounding(rate, every):
    """Steps of 10 ms among which some are 20: taken for rounded, the lost increments were spread over 200 rows, 42 sigmas."""
    record = record_at(lossy(rate, every), 1.0 / rate)
    assert at_even_steps(record) is record


@pytest.mark.parametrize(
    "record",
    [
        record_at(np.arange(3000) / 400.0, 1 / 400.0, "rates"),
        record_at(np.arange(3000) / 100.0, 1 / 100.0),
        record_at(np.arange(3000) / 400.0, 1 / 400.0, stamps=np.arange(3000) / 400.0),
        # Steps of 2 and 3 ms that follow no even clock: the sensor itself is uneven.
        record_at(
            np.cumsum(np.random.default_rng(1).choice([2, 3], 3000)) * TICK,
            0.0025,
        ),
    ],
    ids=["rates", "even", "fine", "uneven"],
)
def test_other_records_stay_as_they_are(record):
    assert at_even_steps(record) is record


def test_a_log_in_milliseconds_is_aligned_as_one_with_all_digits():
    """It was refused for a gravity of 8.2 m/s^2."""
    content = {
        "name": "rest",
        "duration": "60 s",
        "rate": "400 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "navigation",
        "motion": {"kind": "rest", "heading": "30 deg"},
    }
    log = read_scenario(content).simulate(seed=1).record
    rounded = ImuRecord(np.round(log.time, 3), log.gyro, log.accel, "increments")
    found, known = (align(x, (45.0, 10.0, 0.0), "navigation") for x in (rounded, log))
    assert found.status == known.status
    np.testing.assert_allclose(found.euler, known.euler, atol=0.02 * found.euler_sigma.min())
    assert any("whole 1 ms" in reason for reason in found.reasons)
    assert as_sampled(log) is log
