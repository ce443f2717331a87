"""Logs that are written faster than the sensor samples: a row that repeats the one before in all six channels holds its sample.

Of rates such a row says nothing new, and is left out. What is left comes at uneven steps, because the writer's clock is coarser
than the sensor's: a row is written at the first tick after its sample, late by less than a tick. Where the stamps that are left
stay within a tick of an even clock that drifts slowly (their mean over the rows around), the samples have that clock,
as early as the earliest of the stamps, for no row is written before it is sampled. Else the stamps stay as they are.

Rows that a log doubles, each with a time of its own, look alike, but make its clock wrong: they come by chance. Rows that are held
come in runs of nearly one length. Only of these rows are left out, and only where no run is longer than the gaps that are bridged;
a sensor that stands still for longer is stuck. An increment that is written twice counts twice: such logs stay as they are.

The rule is ours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.numeric import is_number
from truenorth.core.remembered import remembered
from truenorth.quality.one_pace import at_one_pace, pace_findings
from truenorth.quality.repeats import repeats_of
from truenorth.quality.rounded_stamps import SHORTEST, at_even_steps, rounded_findings, smooth_clock
from truenorth.quality.sampling import Finding
from truenorth.records import Guess, ImuRecord

Array = NDArray[np.float64]

HELD = "rows that are held"  # what a record has been taken for
FEWEST = 400  # rows, of which chance makes no even clock
LEAST = 0.05  # of the rows: fewer move no answer, as a rule, and are not counted as a fault
LONGEST = 4.5  # rows of a run in the mean, and means in the longest: the gap, in intervals, that an alignment bridges
BREAK = 3.5  # writer's steps: in a longer one the writer stood still, and its clock may have jumped
GONE = 1.5  # of the median step, above which a sample is missing
WITHIN = 1.0  # writer's steps, by which stamps may be off an even clock
ONE_LENGTH = 0.2  # variance of the lengths of runs over that of chance; it is (1 - p) / (1 + p) of rows doubled with probability p


def as_sampled(record: Any) -> ImuRecord:
    """A record or a table as the record of the sensor's own samples, at its own steps and one rate; a sound record as it is."""
    return at_one_pace(at_even_steps(at_own_rate(ImuRecord.of(record))))


def epoch_sampled(at: float | None, record: Any, sampled: ImuRecord) -> float | None:
    """An epoch in the rows that are held at the end of a log: after the last sample it is that sample's.

    Raises
    ------
    UsageError
        No number.
    """
    if at is not None and not is_number(at):
        raise UsageError(f"at is {at!r}; expected an epoch on the record's clock, a number of seconds")
    last = float(sampled.time[-1])
    return last if at is not None and last < at <= float(ImuRecord.of(record).time[-1]) else at


@remembered
def at_own_rate(record: ImuRecord) -> ImuRecord:
    """The record without the rows in which a slower sensor's samples are held, on the sensor's clock where it is even."""
    rows = len(record)
    if record.kind != "rates" or rows < FEWEST:
        return record
    one = record.gyro[1:, 0] == record.gyro[:-1, 0]  # most logs are done with one channel
    if np.count_nonzero(one) < LEAST * rows:
        return record
    same = np.array([x[1:] == x[:-1] for x in (*record.gyro.T, *record.accel.T)])
    first = np.flatnonzero(np.concatenate([[True], ~same.all(axis=0)]))
    held = rows - len(first)
    if held < LEAST * rows or len(first) < FEWEST // 10 or repeats_of(same).beyond < LEAST:
        return record
    runs = np.diff(np.append(first, rows))
    mean = rows / len(first)
    if mean > LONGEST or runs.max() > LONGEST * mean:
        return record
    even = _even_clock(record, first)
    if even is None and float(np.var(runs)) > ONE_LENGTH * mean * (
        mean - 1.0
    ):  # of runs by chance, whose lengths are geometric
        return record
    time = record.time[first] if even is None else even
    steps = np.diff(time)
    rate = 1.0 / float(np.mean(steps[steps < GONE * float(np.median(steps))]))
    said = Finding(
        "note",
        "repeated_rows",
        f"{held} rows ({100.0 * held / rows:.1f} %) repeat the row before in all six channels: the sensor seems to sample at "
        f"{rate:.4g} Hz, the log is written at {record.rate:.4g} Hz; each sample is taken once"
        + ("" if even is None else ", at even steps"),
    )
    taken = Guess(HELD, f"{rate:.4g} Hz", said.message)
    return replace(
        record, time=time, gyro=record.gyro[first], accel=record.accel[first], taken_for=(*record.taken_for, taken)
    )


def sampled_findings(record: ImuRecord) -> list[Finding]:
    """A note where rows that are held were left out, where stamps are rounded, and where the rate of the rows changes."""
    held = [Finding("note", "repeated_rows", taken.why) for taken in record.taken_for if taken.what == HELD]
    return held + rounded_findings(record) + pace_findings(record)


def _even_clock(record: ImuRecord, first: NDArray[np.intp]) -> Array | None:
    """(K,) s, the sensor's clock at the rows in which its samples come first; None where the stamps are of no even one."""
    steps = np.diff(record.time)
    wide = steps > BREAK * record.interval
    tick = float(np.mean(steps[~wide]))
    stamps = record.time[first]
    stretch = np.concatenate([[0], np.cumsum(wide)])[first]
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    clock = stamps.copy()
    late = np.zeros(len(stamps))
    for begin, end in zip(starts, np.append(starts[1:], len(stamps)), strict=True):
        begin += 1  # the sample of the first row may be older than the row
        if end - begin >= SHORTEST:
            clock[begin:end] = smooth_clock(stamps[begin:end])
            late[begin:end] = stamps[begin:end] - clock[begin:end]
    if np.abs(late).max() > WITHIN * tick:
        return None
    clock += late.min()
    for begin in starts:  # where the first sample would have been, by the two that follow
        if begin + 2 < len(clock) and stretch[begin] == stretch[begin + 2]:
            clock[begin] = 2.0 * clock[begin + 1] - clock[begin + 2]
    return clock if np.all(np.diff(clock) > 0.0) else None
