"""Logs whose rate of rows changes: where it does, and the record of one rate that is made of them."""

from functools import cache

import numpy as np
import pytest

from tests.quality.made import G, as_increments, base
from tests.runs import some
from truenorth import align
from truenorth.core.errors import DataError
from truenorth.formats import read_imu
from truenorth.quality import inspect
from truenorth.quality.held import as_sampled
from truenorth.quality.one_pace import at_one_pace
from truenorth.records import ImuRecord
from truenorth.records.pace import stretches
from truenorth.strapdown.increments import across_gaps, increments

SWAY = (0.5, 1.0, 1.5)


@cache
def every_millisecond(duration, seed):
    return base(SWAY, duration=duration, interval=0.001, seed=seed)


def log(*parts, kind="increments", seed=0):
    """A base that sways, `parts` (rows a second, s) after another: sums of rows of 1 kHz, or their values."""
    fine = every_millisecond(sum(length for _, length in parts), seed)
    ends = [np.zeros(1, dtype=int)]
    for rate, length in parts:
        ends.append(ends[-1][-1] + np.round(np.arange(1, round(rate * length) + 1) * 1000 / rate).astype(int))
    at = np.concatenate(ends)
    if kind == "rates":
        rows = at[1:] - 1
        return ImuRecord(fine.time[rows], fine.gyro[rows], fine.accel[rows])
    sums = (np.add.reduceat(x, at[:-1]) for x in (0.001 * fine.gyro[: at[-1]], 0.001 * fine.accel[: at[-1]]))
    return ImuRecord(fine.time[at[1:] - 1], *sums, "increments")


@pytest.mark.parametrize(
    "rates", [(100, 50), (50, 100), (200, 100), (100, 50, 100), (100, 60), (50, 200, 50), (100, 50, 25)]
)
def test_changes_are_found(rates):
    record = log(*((rate, 20.0) for rate in rates))
    found = stretches(record.time)
    assert [1.0 / s.pace for s in found] == pytest.approx(rates, rel=0.01)
    assert [record.time[s.first - 1] for s in found[1:]] == pytest.approx(20.0 * np.arange(1, len(rates)), abs=0.03)


def test_stamps_of_no_pace_are_one_stretch():
    rng = np.random.default_rng(3)
    lost = np.delete(0.01 * np.arange(5000), rng.choice(5000, 100, replace=False))
    for time in (
        np.repeat(0.04 * np.arange(1000), 4),
        np.cumsum(rng.choice([0.005, 0.02, 0.03], 5000)),
        np.cumsum(rng.exponential(0.01, 50_000)),
        0.01 * np.arange(5000) + rng.uniform(-0.004, 0.004, 5000),
        np.append(lost, lost[-1] + 0.02 * np.arange(1, 60)),
        lost,
        0.01 * np.arange(50),
    ):
        assert len(stretches(time)) == 1


@pytest.mark.parametrize("kind", some(["increments"], ["rates"]))
@pytest.mark.parametrize("rates", [(100, 50), (50, 100), (100, 60), (100, 50, 100), (50, 250, 50)])
def test_one_step_and_nothing_lost(rates, kind):
    record = log(*((rate, 20.004) for rate in rates), kind=kind)
    made = as_sampled(record)
    assert made.kind == "increments"
    assert made.interval == pytest.approx(1.0 / min(rates), rel=1e-3)
    assert np.abs(made.steps - made.interval).max() < 0.05 * made.interval
    assert made.time[-1] == record.time[-1]
    assert at_one_pace(made) is made
    for found, true in zip((made.gyro, made.accel), increments(record), strict=True):
        there = np.column_stack([np.interp(made.time, record.time, x) for x in np.cumsum(true, axis=0).T])
        off = np.cumsum(found, axis=0) - there
        assert np.abs(off - off[0]).max() < 1e-4  # how long the first row is, the record does not say


def test_lost_rows_of_the_faster_part_are_bridged():
    record = log((100, 30.0), (50, 30.0))
    kept = np.delete(np.arange(len(record)), [400, 1201, 1800])
    lossy = ImuRecord(record.time[kept], record.gyro[kept], record.accel[kept], "increments")
    made = at_one_pace(lossy)
    assert np.sum(across_gaps(made).accel[:, 2]) == pytest.approx(np.sum(record.accel[:, 2]), abs=1e-3 * G * 0.01)


def test_a_long_gap_stays_one():
    record = log((100, 30.0), (50, 30.0))
    kept = np.delete(np.arange(len(record)), np.arange(700, 760))
    made = at_one_pace(ImuRecord(record.time[kept], record.gyro[kept], record.accel[kept], "increments"))
    assert len(made.gaps) == 1
    assert made.steps[made.gaps[0]] == pytest.approx(0.62, abs=0.021)


def test_increments_that_do_not_grow_are_lost_rows():
    """Every second row is missing in the second half."""
    record = as_increments(base(SWAY))
    kept = np.concatenate([np.arange(6000), np.arange(6001, 12000, 2)])
    lossy = ImuRecord(record.time[kept], record.gyro[kept], record.accel[kept], "increments")
    assert at_one_pace(lossy) is lossy


@pytest.mark.parametrize("kind", some(["increments"], ["rates"]))
def test_answers_are_those_of_a_log_of_the_lower_rate(kind):
    parts = (100, 70.0), (50, 80.0)
    changed, even = log(*parts, kind=kind), log((50, 150.0), kind=kind)
    place = (40.0, 0.0, 0.0)
    found, right = (align(record, place, imu="tactical", heading_limit=20.0) for record in (changed, even))
    assert found.status == right.status == "aligned"
    assert found.euler_sigma == pytest.approx(right.euler_sigma, rel=0.15)
    off = (found.attitude * right.attitude.inv()).as_rotvec()
    assert np.abs(off[:2]).max() < 0.2 * right.euler_sigma[1]
    assert abs(off[2]) < 0.5 * right.euler_sigma[0]
    said = [finding.message for finding in inspect(changed).findings if finding.code == "rate_changes"]
    assert len(said) == 1
    assert "50 Hz from row 700" in said[0]


def test_stamps_of_a_table_are_followed(tmp_path):
    """They are not taken for stamps in bunches, and no rate is taken for that of all rows."""
    record = log((100, 40.0), (50, 40.0), kind="rates")
    path = tmp_path / "log.csv"
    record.to_frame().to_csv(path)
    assert np.array_equal(read_imu(path).time, record.time)
    with pytest.raises(DataError, match=r"row 400[0-9].*rate of the rows changes"):
        read_imu(path, rate=75.0)
