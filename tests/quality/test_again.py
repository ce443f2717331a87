"""A piece of a log that was written twice, with other stamps: no sensor with noise gives the same rows again."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth
from truenorth.core.position import Position
from truenorth.quality.again import _of_windows, rows_again
from truenorth.quality.sampling import check_sampling
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate


def log(count, quantum=0.0, sway=0.05, seed=0):
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(1.0, count + 1.0)
    gyro = 1e-4 * rng.standard_normal((count, 3)) + sway * np.sin(2.0 * np.pi * t / 7.3)[:, None]
    accel = 0.01 * rng.standard_normal((count, 3)) + [0.0, 0.0, 9.8]
    if quantum:
        gyro, accel = np.round(gyro / quantum) * quantum, np.round(accel / (100.0 * quantum)) * 100.0 * quantum
    return ImuRecord(t, gyro, accel)


def pieces(record, *slices):
    """Those one after the other, on stamps that go on."""
    gyro, accel = (np.vstack([values[rows] for rows in slices]) for values in (record.gyro, record.accel))
    return ImuRecord(record.interval * np.arange(1.0, len(gyro) + 1.0), gyro, accel)


@pytest.mark.parametrize("quantum", [0.0, 1e-4, 1e-3, 5e-3])
def test_a_piece_that_was_written_twice_is_found_to_the_row(quantum):
    record = log(6000, quantum)
    assert rows_again(record) is None
    assert rows_again(pieces(record, slice(0, 6000), slice(0, 6000)))[:3] == (0, 6000, 6000)
    found = rows_again(pieces(record, slice(0, 4000), slice(1000, 3000), slice(4000, 6000)))
    first, again, length = found
    # Coarse rows before and after it may agree by chance.
    assert (abs(first - 1000), abs(again - 4000)) <= (5, 5)
    assert 2000 <= length <= 2010


@pytest.mark.parametrize("quantum", [0.0, 1e-4, 2e-4, 5e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("sway", [0.0, 1e-3, 0.05])
def test_coarse_dead_and_held_logs_come_again_by_chance_only(quantum, sway):
    for seed in range(3):
        record = log(20_000, quantum, sway, seed)
        assert rows_again(record) is None
        held = replace(
            record, gyro=np.repeat(record.gyro[::10], 10, axis=0), accel=np.repeat(record.accel[::10], 10, axis=0)
        )
        assert rows_again(held) is None


def test_a_long_log_is_looked_at_by_some_stretches(monkeypatch):
    """Of one in a dozen of stretches enough come again; chunks that end within a stretch lose none."""
    monkeypatch.setattr("truenorth.quality.again.ASKED", 1000)
    monkeypatch.setattr("truenorth.quality.again.CHUNK", 700)
    record = log(6000)
    assert rows_again(pieces(record, slice(0, 6000), slice(0, 6000))) == (0, 6000, 6000)
    assert rows_again(record) is None


@pytest.mark.parametrize("length", [1, 2, 3, 7, 50, 64, 101])
def test_windows_of_one_content_have_one_hash(length):
    rows = np.random.default_rng(1).integers(0, 2**63, 300, dtype=np.uint64)
    rows[150 : 150 + 110] = rows[20:130]
    windows = _of_windows(rows, length)
    assert len(windows) == 300 - length + 1
    at = np.arange(20, 131 - length)
    np.testing.assert_array_equal(windows[at], windows[at + 130])
    assert len(np.unique(windows)) == len(windows) - len(at)


def test_it_is_said_and_the_answer_is_not_used():
    place = Position.from_degrees(45.0, 10.0)
    record = simulate(rest(place, 0.3), rate=50.0, duration=120.0, imu=imu_spec("navigation"), seed=1).record
    twice = pieces(record, slice(0, 6000), slice(0, 6000))
    (finding,) = (f for f in check_sampling(twice)[1] if f.code == "rows_again")
    assert "rows 6001 to 12000 (from 120.020 s on) are rows 1 to 6000" in finding.message
    answer = truenorth.align(twice, place, "navigation")
    assert answer.status == "inconsistent"
    assert any("written twice" in reason for reason in answer.reasons)
    assert truenorth.align(record, place, "navigation").status == "aligned"
