"""Rows in which a slower sensor's samples are held: which are left out, and the clock of those that stay."""

import numpy as np
import pytest

from tests.quality.made import codes
from truenorth.quality import inspect
from truenorth.quality.held import as_sampled, at_own_rate, epoch_sampled
from truenorth.records import ImuRecord

TICK = 0.006  # s, of the writer


def noise(rows, kind="rates", time=None, seed=0):
    """A record whose rows are these samples of noise."""
    x = np.random.default_rng(seed).standard_normal((int(rows.max()) + 1, 6)) * [*[1e-3] * 3, *[1e-2] * 3]
    time = TICK * np.arange(1, len(rows) + 1) if time is None else time
    return ImuRecord(time, x[rows, :3], x[rows, 3:] + [0.0, 0.0, 9.8], kind)


TIMES = (1.1, 1.509, 2.0, 2.5, 3.0, 4.0)


@pytest.mark.parametrize(
    ("jitter", "times"),
    # a writer whose ticks lie up to 1.3 of a step apart misses samples of a sensor 1.1 times as slow: that is no even clock
    [(0.0, times) for times in TIMES] + [(0.3, times) for times in TIMES[1:]],
)
def test_the_sensor_has_its_own_even_clock(times, jitter):
    """A sensor that is slower by so many times than its writer, whose own ticks may scatter."""
    rng = np.random.default_rng(2)
    ticks = TICK * (np.arange(1, 12_001) + jitter * rng.uniform(0.0, 1.0, 12_000))
    interval = times * TICK
    rows = np.floor((ticks + 0.001) / interval).astype(int)
    found = at_own_rate(noise(rows, time=ticks))
    samples = np.unique(rows)
    assert len(found) == len(samples)
    assert found.interval == pytest.approx(interval, rel=0.01)
    assert found.jitter < 0.01 * interval
    late = found.time - (samples * interval - 0.001)
    assert np.all(late[1:-1] > -0.1 * TICK)
    assert np.all(late[1:-1] < TICK)
    assert np.ptp(late[1:-1]) < 0.4 * TICK
    assert at_own_rate(found) is found


@pytest.mark.parametrize("share", [0.06, 0.1, 0.3, 0.5])
def test_rows_doubled_by_chance_stay(share):
    """Each has a time of its own: without them the clock would be as wrong as with them."""
    rng = np.random.default_rng(4)
    rows = np.sort(np.concatenate([np.arange(6000), np.flatnonzero(rng.random(6000) < share)]))
    record = noise(rows)
    assert at_own_rate(record) is record
    assert "repeated_rows" in codes(inspect(record), "warning")


def test_samples_that_are_held_for_long_stay():
    for rows in (
        np.arange(6000) // 10,
        np.concatenate([np.arange(3000) // 2, 1500 + np.zeros(50, int), 1501 + np.arange(2950) // 2]),
    ):
        record = noise(rows)
        assert at_own_rate(record) is record


def test_increments_stay():
    record = noise(np.arange(6000) // 2, "increments")
    assert at_own_rate(record) is record


def test_a_coarse_sensor_at_rest_stays():
    """All six channels repeat by chance."""
    counts = np.round(0.25 * np.random.default_rng(5).standard_normal((6000, 6)))
    record = ImuRecord(TICK * np.arange(1, 6001), 1e-4 * counts[:, :3], 1e-2 * counts[:, 3:] + [0.0, 0.0, 9.8])
    assert np.mean(np.all(np.diff(counts, axis=0) == 0.0, axis=1)) > 0.05
    assert at_own_rate(record) is record


def test_stamps_of_no_even_clock_stay_at_the_samples():
    """A radio whose samples come unevenly, each held for three or four rows of a writer."""
    rng = np.random.default_rng(6)
    runs = rng.choice([3, 4], 3000, p=[0.8, 0.2])
    record = noise(np.repeat(np.arange(3000), runs))
    found = at_own_rate(record)
    assert np.array_equal(found.time, record.time[np.concatenate([[0], np.cumsum(runs)[:-1]])])


def test_a_note_says_the_rates():
    found = inspect(noise(np.arange(9000) * 110 // 166))
    assert codes(found, "note") >= {"repeated_rows"}
    assert found.sampling.repeated_rows == pytest.approx(9000 * 56 / 166, abs=2)
    said = next(finding.message for finding in found.findings if finding.code == "repeated_rows")
    assert "the sensor seems to sample at 110.4 Hz, the log is written at 166.7 Hz" in said


def test_an_epoch_in_rows_that_are_held_at_the_end_is_the_last_samples():
    record = noise(np.arange(6000) // 3)
    sampled = as_sampled(record)
    assert epoch_sampled(float(record.time[-1]), record, sampled) == sampled.time[-1]
    assert epoch_sampled(None, record, sampled) is None
    assert epoch_sampled(20.0, record, sampled) == 20.0
    assert epoch_sampled(99.0, record, sampled) == 99.0
