"""The end of a sensor's range, and what looks like one: clipped noise, counts that come in fours, a counter that rests."""

from __future__ import annotations

import numpy as np
import pytest

from tests.quality.made import base, codes
from truenorth.quality import inspect
from truenorth.records import ImuRecord


def test_saturation():
    record = base(amplitude=(10.0, 10.0, 5.0))
    limit = np.radians(8.0)
    found = inspect(ImuRecord(record.time, np.clip(record.gyro, -limit, limit), record.accel))
    assert "saturated" in codes(found, "error")
    assert found.sampling.saturated_rows[0] == np.count_nonzero(np.abs(record.gyro[:, 0]) >= limit)
    assert np.all(found.sampling.saturated_rows[3:] == 0)


def test_noise_that_is_clipped_on_one_side_alone():
    """No range has sides so unlike; but of values with many digits no two are alike by chance."""
    record = base(duration=60.0)
    gyro = record.gyro.copy()
    gyro[:, 1] = np.minimum(gyro[:, 1], np.quantile(gyro[:, 1], 0.98))
    assert "saturated" in codes(inspect(ImuRecord(record.time, gyro, record.accel)), "error")


def test_a_vibration_is_clipped_row_by_row():
    """Of a vibration near half the rate of the log no two peaks follow each other."""
    record = base(duration=30.0)
    t = record.time
    accel = record.accel + np.array([2.0, 0.0, 0.0]) * np.sin(2.0 * np.pi * 37.3 * t)[:, None]
    assert "saturated" not in codes(inspect(ImuRecord(t, record.gyro, accel)))
    accel[:, 0] = np.clip(accel[:, 0], -1.9, 1.9)
    assert "saturated" in codes(inspect(ImuRecord(t, record.gyro, accel)))


def test_counts_that_come_in_fours_are_no_end_of_a_range():
    """A pulse train whose four edges are counted: every fourth value is full. What is clipped between two counts is."""
    rng = np.random.default_rng(6)
    record = base(duration=60.0)
    levels = {-8.0: 0.1, -7.0: 0.001, -4.0: 0.2, -3.0: 0.001, 0.0: 0.688, 4.0: 0.01}
    counts = rng.choice(list(levels), len(record), p=list(levels.values()))
    for most, found in ((np.inf, False), (6.4, True)):
        accel = record.accel.copy()
        accel[:, 0] = 0.12 * np.clip(counts, -most, most)
        assert ("saturated" in codes(inspect(ImuRecord(record.time, record.gyro, accel)))) == found


@pytest.mark.parametrize("most", [1.0, 1.5, 2.02, 2.97])
def test_counts_cut_off_on_one_side_alone(most):
    """The other side goes farther: no range has sides so unlike, but no value of a counter is between two counts."""
    rng = np.random.default_rng(8)
    record = base(duration=60.0)
    counts = np.clip(np.round(2.0 * rng.standard_normal(len(record))), -9.0, 3.0)
    for end in (np.inf, most):
        accel = record.accel.copy()
        accel[:, 0] = 0.12 * np.minimum(counts, end)
        between = end < np.inf and end != np.round(end)
        assert ("saturated" in codes(inspect(ImuRecord(record.time, record.gyro, accel)))) == between


def test_counts_summed_by_arithmetic_are_alike():
    """Sums of counts times their size differ by rounding: such neighbours are one level, and make no pile of it."""
    rng = np.random.default_rng(7)
    record = base(duration=60.0)
    counts, other = rng.choice([0.0, 2.0, 4.0], len(record), p=[0.4, 0.2, 0.4]), rng.random(len(record)) < 0.01
    accel = record.accel.copy()
    accel[:, 0] = 0.1 * counts - 1e-16 * other
    assert len(np.unique(accel[:, 0])) > 3
    assert "saturated" not in codes(inspect(ImuRecord(record.time, record.gyro, accel)))


@pytest.mark.parametrize("stuck", [False, True])
def test_a_counter_whose_mean_is_a_count_stays_at_it(stuck):
    """What a row leaves is counted in the next: at a mean of 1.004 pulses one more comes every 250 rows."""
    record = base(duration=120.0)
    mean = np.where(np.abs(np.arange(len(record)) - 6000) < 400, 1.004, 1.3)
    pulses = np.diff(np.floor(np.cumsum(np.append(0.5, mean))))
    if stuck:
        pulses[1000:1300] = 1.0
    accel = record.accel.copy()
    accel[:, 0] = 0.01 * pulses
    assert ("frozen" in codes(inspect(ImuRecord(record.time, record.gyro, accel)))) == stuck
