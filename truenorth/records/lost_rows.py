"""Long steps of a clock in which rows are missing, against those of rows that are stamped late: the clock comes back from these.

A row that a computer stamps late makes a long step and a short one, and nothing is lost. Behind a lost row all further ones are as
late as it is long. So a long step lacks rows where the earliest of the rows behind it, by their own pace, is late by half an
interval, too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

GAP_FACTOR = 1.5  # a step of more than 1.5 nominal intervals may have lost a sample
BACK, SOON = 9, 0.5  # rows and s next to a long step, which say how long an interval is, and whether rows are missing
EVEN = 4  # steps, whose sum stamps of milliseconds leave nearly even
ONE_LOST = 1.9  # intervals, of a step with one row lost; less is a row that is late


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
    if not long.size:
        return long
    pace = np.array([pace_of(time[max(0, row - BACK) : row], interval) for row in long])
    return np.asarray(long[lack_rows(time, long, steps[long - 1], pace)])


def pace_of(time: Array, interval: float, merged: int = 1) -> float:
    """The interval of rows at these times (K,), s; stamps of milliseconds make two lengths of steps of one interval.

    Parameters
    ----------
    time : (K,) array, s
        Of the last `BACK` rows before a long step.
    interval : float, s
        What is said where they are too few.
    merged : int
        Rows that each of them stands for.
    """
    steps = np.diff(time) / merged
    if len(steps) < 3:
        return interval
    steps = steps[steps <= 2.0 * np.median(steps)]
    # A few steps on end are even, of such stamps, too; the fewest s that they take lacks no row, and neither a row that is lost nor
    # one that is late, with the short step behind it, is a step of its size.
    few = min(EVEN, len(steps))
    sums = np.cumsum(np.append(0.0, steps))
    about = float((sums[few:] - sums[:-few]).min()) / few
    whole = steps[np.abs(steps - about) <= 0.5 * about]
    return float(np.mean(whole)) if len(whole) else interval


def lack_rows(time: Array, rows: Rows, steps: Array, pace: Array) -> NDArray[np.bool_]:
    """Whether rows are missing in long steps, from the times of the rows behind them.

    Parameters
    ----------
    time : (N,) array, s
        Ascending.
    rows : (m,) array
        At which long steps end.
    steps, pace : (m,) arrays, s
        These steps, and the interval of the rows before each of them.
    """
    behind = np.arange(BACK)
    at = rows[:, None] + behind
    near = time[np.minimum(at, len(time) - 1)]
    counts = (at < len(time)) & (near <= time[rows][:, None] + SOON)
    over = np.where(counts, near - (time[rows] - steps)[:, None] - pace[:, None] * (behind + 1), np.inf)
    newest = (counts.sum(axis=1) == 1) & (steps < ONE_LOST * pace)  # nothing says whether the clock comes back
    return np.asarray((over.min(axis=1) > (GAP_FACTOR - 1.0) * pace) & ~newest)
