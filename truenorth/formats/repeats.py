"""Rows that a logger wrote twice: the same values at the same time as the row before say nothing, and are left out."""

from __future__ import annotations

from dataclasses import replace

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

    Where many rows do, the stamps have few digits, and such rows may be samples of their own: they stay, and are asked about.

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
    same = np.all(gyro[1:] == gyro[:-1], axis=1)
    same &= np.all(accel[1:] == accel[:-1], axis=1)
    if not same.any():
        return columns, None
    for name in choice.time:
        time = columns.clock(name)[0]
        if len(time) != rows:
            return columns, None
        same &= time[1:] == time[:-1]
    if not same.any() or np.mean(same) >= BUNCH_SHARE:
        return columns, None
    keep = np.flatnonzero(np.concatenate([[True], ~same]))
    first = columns.place(int(np.argmax(same)) + 1)
    note = f"rows that repeat the row before, with its time, left out: {int(same.sum())}, the first is {first}"
    left = replace(
        columns,
        read=lambda names, gaps: columns.read(names, gaps)[keep],
        column=lambda name: columns.column(name).take(keep),
        place=lambda row: columns.place(int(keep[row])),
        whole={},
        notes=(*columns.notes, note),
    )
    return left, keep
