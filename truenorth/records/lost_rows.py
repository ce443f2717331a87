"""Long steps of a clock in which rows are missing, against those of rows that are stamped late: the clock comes back from these.

A row that a computer stamps late makes a long step and a short one, and nothing is lost. Behind a lost row all further ones are as
late as it is long. So nothing is lost in a long step where some of the rows behind it are late by less than half an interval.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

GAP_FACTOR = 1.5  # a step of more than 1.5 nominal intervals may have lost a sample
BEHIND, SOON = 9, 0.5  # rows, and s, behind a long step, which say whether rows are missing
IN_TIME = 3  # of these rows, that are in time where nothing is lost: one may be early by its jitter
BACK, EVEN = 400, 10  # rows before a long step, and steps on end, whose sums are even of stamps of milliseconds, too
LEAST = 0.25  # of these sums: the others may hold lost rows
ONE_LOST = 1.9  # intervals, of a step with one row lost; less is a row that is late
AT_ONCE = 100_000  # long steps


def lost_before(time: Array, interval: float) -> Rows:
    """Rows before which others are missing.

    Parameters
    ----------
    time : (N,) array, s
        Ascending.
    interval : float, s
        The nominal one.
    """
    steps = time[1:] - time[:-1]
    long = np.flatnonzero(steps > GAP_FACTOR * interval) + 1
    parts = np.split(long, range(AT_ONCE, len(long), AT_ONCE))
    return np.concatenate([part[lack_rows(time, part, steps[part - 1], np.array(interval))] for part in parts])


def pace_of(time: Array, interval: float, merged: int = 1) -> float:
    """The interval of the rows at these times (K,), s; stamps of milliseconds make two lengths of steps of one interval.

    Parameters
    ----------
    time : (K,) array, s
        Of the last `BACK` rows before a long step, some of which may be lost.
    interval : float, s
        What is said where they are too few.
    merged : int
        Rows that each of them stands for.
    """
    if len(time) <= EVEN:
        return interval
    return float(np.quantile(time[EVEN:] - time[:-EVEN], LEAST)) / (EVEN * merged)


def lack_rows(time: Array, rows: Rows, steps: Array, pace: Array) -> NDArray[np.bool_]:
    """Whether rows are missing in long steps, from the times of the rows behind them.

    Parameters
    ----------
    time : (N,) array, s
        Ascending.
    rows : (m,) array
        At which long steps end.
    steps : (m,) array, s
    pace : (m,) array, or of one number, s
        The interval of the rows around each of them.
    """
    behind = np.arange(BEHIND)
    at = rows[:, None] + behind
    near = time[np.minimum(at, len(time) - 1)]
    counts = (at < len(time)) & (near <= time[rows][:, None] + SOON)
    late = near - (time[rows] - steps)[:, None] - pace[..., None] * (behind + 1)
    late = np.sort(np.where(counts, late, np.inf), axis=1)
    there = counts.sum(axis=1)
    least = np.take_along_axis(late, np.minimum(IN_TIME, there)[:, None] - 1, axis=1)[:, 0]
    newest = (there == 1) & (steps < ONE_LOST * pace)  # nothing says whether the clock comes back
    return np.asarray((least > (GAP_FACTOR - 1.0) * pace) & ~newest)
