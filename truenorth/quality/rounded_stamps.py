"""Increments whose stamps have too few digits: rows every 2.5 ms, written in whole milliseconds, come at steps of 2 and 3 ms.

A rate is the same whatever its stamp says. An increment is an integral over a step, and by a step of 2 ms gravity is a quarter
larger. Where all stamps are whole ticks and stay within a tick of an even clock that drifts slowly, the samples have that clock;
written to the nearest tick they scatter about it by half a tick. Between lost rows each stretch has a clock of its own. Stamps that
scatter by more are of a clock that is not even, and stay as they are. Of an even clock that is rounded the longer ones of two
neighbouring steps come evenly, and lost rows by chance: steps of 10 ms among which some are 20 are no rounding.

The rule is ours.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from truenorth.core.remembered import remembered
from truenorth.quality.sampling import Finding
from truenorth.records import Guess, ImuRecord

Array = NDArray[np.float64]

ROUNDED = "rounded stamps"  # what a record has been taken for
TICKS = (1.0, 0.1, 0.01, 1e-3, 1e-4)  # s, of stamps that a program writes
COARSE = 0.1  # of a step: finer ticks change no increment by more
WHOLE = 1e-3  # of a tick, by which a stamp may miss it; besides what a double of its size leaves
MISSING = 1.5  # steps, and a tick: in a longer one a row is missing
HALF = 100  # rows to either side over which a clock is even
SHORTEST = 10  # rows of a stretch that have a clock of their own
WITHIN = 0.75  # ticks, by which stamps may be off an even clock; rounding makes half a tick
FEWEST = 4  # longer steps, of which chance makes no even ones
EVENLY = 0.9  # of the distances between them, that are nearly the same


@remembered
def at_even_steps(record: ImuRecord) -> ImuRecord:
    """The record of increments on the even clock of which its stamps are rounded; any other record as it is."""
    if record.kind != "increments" or (tick := _tick(record)) is None:
        return record
    steps = np.diff(record.time)
    step = float(np.mean(steps[steps <= 2.0 * record.interval + tick]))
    starts = np.concatenate([[0], np.flatnonzero(steps > MISSING * step + tick) + 1, [len(record)]])
    time = record.time.copy()
    for begin, end in pairwise(starts):
        if end - begin >= SHORTEST:
            time[begin:end] = smooth_clock(record.time[begin:end])
    if np.abs(time - record.time).max() > WITHIN * tick or np.any(np.diff(time) <= 0.0):
        return record
    said = (
        f"stamps are whole {1e3 * tick:.4g} ms, a row comes every {1e3 * step:.4g} ms: increments are taken at even steps; "
        "write stamps with more digits"
    )
    return replace(record, time=time, taken_for=(*record.taken_for, Guess(ROUNDED, f"{1e3 * step:.4g} ms", said)))


def rounded_findings(record: ImuRecord) -> list[Finding]:
    """A note where stamps have too few digits."""
    return [Finding("note", "rounded_stamps", taken.why) for taken in record.taken_for if taken.what == ROUNDED]


def smooth_clock(stamps: Array) -> Array:
    """Stamps by their mean over the rows around them; near the ends by a line."""
    count = len(stamps)
    half = min(HALF, (count - 1) // 2)
    width = 2 * half + 1
    trend = np.linspace(stamps[0], stamps[-1], count)  # sums of small numbers keep their digits
    off = stamps - trend
    sums = np.concatenate([[0.0], np.cumsum(off)])
    smooth = np.empty(count)
    smooth[half : count - half] = (sums[width:] - sums[:-width]) / width
    rows = np.arange(width) - half
    for part, inside in ((slice(0, width), rows < 0), (slice(count - width, count), rows > 0)):
        x = off[part]
        line = x.mean() + rows * float(rows @ x) / float(rows @ rows)
        smooth[part][inside] = line[inside]
    return smooth + trend


def _tick(record: ImuRecord) -> float | None:
    """Of which all stamps are whole, s, where it is coarse against the rows' steps and these are uneven; else None."""
    steps = np.diff(record.time)
    if np.ptp(steps[: SHORTEST * HALF]) < COARSE * record.interval:  # most logs are done with their first rows
        return None
    lost = np.spacing(np.abs(record.time).max())
    for tick in TICKS:
        if tick < COARSE * record.interval:
            return None
        count = np.round(steps / tick)
        if np.abs(steps / tick - count).max() <= WHOLE + 2.0 * lost / tick:
            return tick if _comes_evenly(count) else None
    return None


def _comes_evenly(count: Array) -> bool:
    """Whether of steps of whole ticks the longer of the two shortest comes evenly, as rounding makes it."""
    apart = np.diff(np.flatnonzero(count == count.min() + 1.0))
    if len(apart) < FEWEST:
        return False
    usual = float(np.median(apart))
    return float(np.mean(np.abs(apart - usual) <= max(1.0, COARSE * usual))) >= EVENLY
