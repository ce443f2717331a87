"""Gaps of a log: what they held is found where rates change evenly, and can be taken out again."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.live.bridges import bridged
from truenorth.live.log import Log
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import across_gaps, without_gaps

T, ROWS = 0.01, 400


def ramp() -> ImuRecord:
    """Increments of rates and forces that are straight lines."""
    time = T * np.arange(1, ROWS + 1)
    slopes = np.array([0.3, -0.1, 0.2])
    middle = time - 0.5 * T
    return ImuRecord(time, T * (0.2 + np.outer(middle, slopes)), T * (9.8 - np.outer(middle, slopes)), "increments")


@pytest.mark.parametrize("lost", [[100], [50, 51, 52], [10, 12, 200, 201]])
def test_what_a_gap_held_is_there_again(lost):
    """To rounding, of straight lines."""
    whole = ramp()
    kept = np.setdiff1d(np.arange(ROWS), lost)
    cut = ImuRecord(whole.time[kept], whole.gyro[kept], whole.accel[kept], "increments")
    bridged = across_gaps(cut)
    assert bridged.gyro.sum(axis=0) == pytest.approx(whole.gyro.sum(axis=0), rel=1e-12)
    assert bridged.accel.sum(axis=0) == pytest.approx(whole.accel.sum(axis=0), rel=1e-12)
    again = without_gaps(bridged)
    np.testing.assert_allclose(again.gyro, cut.gyro, rtol=1e-13)
    np.testing.assert_allclose(again.time, whole.time[: len(cut)], rtol=1e-12)
    assert not again.gaps.size


def test_rates_and_even_clocks_stay_as_they_are():
    rates = replace(ramp(), kind="rates")
    assert across_gaps(rates) is rates
    np.testing.assert_array_equal(across_gaps(ramp()).gyro, ramp().gyro)


EVEN = 0.02 * np.arange(1.0, 401.0)


def at_rest(time):
    """A record of increments whose rows are stamped so."""
    rows = np.tile([0.0, 0.0, 0.196], (len(time), 1))
    return ImuRecord(time, 0.0 * rows, rows, "increments")


@pytest.mark.parametrize("by", [0.51, 0.75, 0.95])
def test_a_row_that_is_stamped_late_follows_no_gap(by):
    """The clock comes back with the next row; of the last one nothing says so, and one lost row would make it later."""
    time = EVEN.copy()
    time[[100, 200, 201, 300]] += by * 0.02
    assert not at_rest(time).gaps.size
    time[-1] += 0.8 * 0.02
    assert not at_rest(time).gaps.size
    time[-1] = EVEN[-1] + 0.02
    assert at_rest(time).gaps.tolist() == [399]


@pytest.mark.parametrize("lost", [1, 2, 30])
def test_a_lost_row_is_one_where_others_are_late_too(lost):
    keep = np.ones(400, dtype=bool)
    keep[200 : 200 + lost] = False
    time = EVEN + 0.6 * 0.02 * (np.arange(400) % 20 == 7)
    assert at_rest(time[keep]).gaps.tolist() == [200]


def test_a_clock_that_jumps_has_a_gap():
    time = EVEN.copy()
    time[200:] += 0.6 * 0.02
    assert at_rest(time).gaps.tolist() == [200]


@pytest.mark.parametrize("rate", [400.0, 300.0, 160.0])
def test_stamps_of_milliseconds_make_no_gaps(rate):
    """Of 400 rows a second steps of 2 and 3 ms. A lost row is one all the same."""
    time = np.round(np.arange(1.0, 4001.0) / rate + 0.0004, 3)
    assert not at_rest(time).gaps.size
    assert at_rest(np.delete(time, 2000)).gaps.tolist() == [2000]


@pytest.mark.parametrize("lost", [[100, 102], [100, 103, 105], [100, 101, 104]])
def test_rows_that_are_lost_one_after_the_other_are_gaps_each(lost):
    time = np.delete(EVEN, lost)
    expected = np.flatnonzero(np.diff(time) > 0.03) + 1
    assert at_rest(time).gaps.tolist() == expected.tolist()


@pytest.mark.parametrize("seed", range(4))
def test_a_whole_log_and_a_running_one_have_the_same_gaps(seed):
    rng = np.random.default_rng(seed)
    late = 0.02 * rng.uniform(0.3, 0.95, 400) * (rng.random(400) < 0.05)
    time = (EVEN + late)[(rng.random(400) > 0.02) | (np.arange(400) < 10)]
    record, log = at_rest(time), Log("increments")
    rows = np.hstack([time[:, None], record.gyro, record.accel])
    log.add(rows)
    _, _, gaps = bridged(rows[1:], rows[0], np.empty(0), record.interval, log, begins=False)
    assert [before for before, _ in gaps] == time[record.gaps - 1].tolist()


@pytest.mark.parametrize("every", [2, 3])
def test_rows_that_are_lost_again_and_again_are_gaps_each(every):
    """The pace of so few rows is no pace: of each second row of two seconds six of fifty were found, in a running log likewise."""
    lost = np.arange(100, 200) % every != 0
    time = np.delete(EVEN, 100 + np.flatnonzero(lost))
    expected = np.flatnonzero(np.diff(time) > 0.03) + 1
    record, log = at_rest(time), Log("increments")
    assert record.gaps.tolist() == expected.tolist()
    rows = np.hstack([time[:, None], record.gyro, record.accel])
    log.add(rows)
    _, _, gaps = bridged(rows[1:], rows[0], np.empty(0), record.interval, log, begins=False)
    assert [before for before, _ in gaps] == time[expected - 1].tolist()


@pytest.mark.parametrize("seed", range(4))
def test_jitter_hides_no_lost_row(seed):
    """A tenth of an interval, one sigma."""
    rng = np.random.default_rng(seed)
    time = EVEN + np.clip(0.002 * rng.standard_normal(400), -0.006, 0.006)
    kept = (rng.random(400) > 0.03) | (np.arange(400) < 2) | (np.arange(400) > 390)
    expected = np.flatnonzero(np.diff(np.flatnonzero(kept)) > 1) + 1
    assert at_rest(time[kept]).gaps.tolist() == expected.tolist()
