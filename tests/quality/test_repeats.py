"""Rows that repeat the one before: written again or held, or so by coarse steps and rounding."""

from __future__ import annotations

import numpy as np
import pytest

from tests.quality.made import base, codes
from truenorth.quality import inspect
from truenorth.records import ImuRecord


def test_rows_of_a_simulation_at_rest_repeat_by_rounding():
    """Two fifths of the rows as the row before, the others but for their last digits: no sensor is held."""
    rng = np.random.default_rng(4)
    force = np.tile([0.0, 0.0, 9.8], (6000, 1)) * (1.0 + 1e-15 * rng.integers(0, 2, (6000, 1)))
    rate = np.tile([0.0, 6e-5, 4e-5], (6000, 1)) * (1.0 + 1e-15 * rng.integers(0, 2, (6000, 1)))
    found = inspect(ImuRecord(0.01 * np.arange(1, 6001), rate, force))
    assert found.sampling.repeated_rows > 1000
    assert "repeated_rows" not in codes(found)
    noise = 1e-5 * np.repeat(rng.standard_normal((3000, 6)), 2, axis=0)
    held = inspect(ImuRecord(0.01 * np.arange(1, 6001), rate[:1] + noise[:, :3], force[:1] + noise[:, 3:]))
    assert "repeated_rows" in codes(held, "note")


def test_repeated_rows():
    record = base(duration=30.0)
    rows = np.arange(len(record)) // 2 * 2
    found = inspect(ImuRecord(record.time, record.gyro[rows], record.accel[rows]))
    assert found.sampling.repeated_rows == len(record) // 2
    assert "repeated_rows" in codes(found, "note")


def test_rows_that_are_held_are_found_though_their_channels_repeat_by_themselves():
    """A coarse quantum: each channel repeats in half of its rows anyhow; rows that are held do at once, in runs of one length."""
    rng = np.random.default_rng(4)
    count = 6000
    time = 0.01 * np.arange(1, count + 1)
    gyro, accel = (np.round(0.7 * rng.standard_normal((count, 3)))[5 * (np.arange(count) // 5)] for _ in range(2))
    held = ImuRecord(time, 1e-4 * gyro, 1e-2 * accel + [0.0, 0.0, 9.8], "increments")
    assert "repeated_rows" in codes(inspect(held), "warning")
    gyro, accel = (np.round(0.25 * rng.standard_normal((count, 3))) for _ in range(2))
    quiet = ImuRecord(time, 1e-4 * gyro, 1e-2 * accel + [0.0, 0.0, 9.8], "increments")
    assert "repeated_rows" not in codes(inspect(quiet))


@pytest.mark.parametrize("again", [0.0, 0.07])
def test_rows_written_again_stand_out_of_what_coarse_steps_repeat(again):
    """Channels that repeat in a fifth to four fifths of the rows make one in a hundred repeat at once; others are written twice."""
    rng = np.random.default_rng(8)
    count = 30_000
    counts = np.round(rng.standard_normal((count, 6)) * [1.2, 1.3, 0.7, 0.3, 1.0, 0.25])
    rows = np.sort(np.concatenate([np.arange(count), np.flatnonzero(rng.random(count) < again)]))[:count]
    counts = counts[rows] * [1e-5] * 6 + [0.0, 0.0, 0.0, 0.0, 0.0, 9.8e-2]
    found = inspect(ImuRecord(0.01 * np.arange(1, count + 1), counts[:, :3], counts[:, 3:], "increments"))
    assert found.sampling.repeated_rows > 100
    assert ("repeated_rows" in codes(found, "warning")) == bool(again)
