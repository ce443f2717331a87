"""Rows that a logger wrote twice: the same values at the same time as the row before say nothing, and are left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.formats.chosen import Choice
from truenorth.formats.clocks import BUNCH_SHARE, FEWEST
from truenorth.formats.columns import Columns

Array = NDArray[np.float64]


def without_repeats(
    columns: Columns, choice: Choice, gyro: Array, accel: Array
) -> tuple[Columns, NDArray[np.intp] | None]:
    """The log without rows that repeat the row before, its time too, and which rows these are; None where there are none.

    Where many rows do, the stamps may have few digits, and such rows be samples of their own: they stay, and are asked about. Where
    no two different rows have one time, and most values change from one time to the next, many rows are copies as well.

    Parameters
    ----------
    columns : Columns
    choice : Choice
    gyro, accel : (N, 3) arrays
        As they were read.
    """
    rows = len(gyro)
    if not choice.time or rows < FEWEST:
        return columns, None
    same = np.ones(rows - 1, dtype=bool)
    for values in (*gyro.T, *accel.T):  # one after the other: of a long log all at once are much memory
        same &= values[1:] == values[:-1]
    if not same.any():
        return columns, None
    at_once = np.ones(rows - 1, dtype=bool)
    for name in choice.time:
        time = columns.clock(name)[0]
        if len(time) != rows:
            return columns, None
        at_once &= time[1:] == time[:-1]
    same &= at_once
    copies = np.array_equal(same, at_once) and np.mean(np.any(np.diff(gyro[1:][~same], axis=0) != 0.0, axis=1)) > 0.5
    if not same.any() or (np.mean(same) >= BUNCH_SHARE and not copies):
        return columns, None
    keep = np.flatnonzero(np.concatenate([[True], ~same]))
    first = columns.place(int(np.argmax(same)) + 1)
    note = f"rows that repeat the row before, with its time, left out: {int(same.sum())}, the first is {first}"
    return columns.rows_of(keep, note), keep
