"""Rows in which a sensor has no value, as where other sensors of a phone wrote alone: they are left out and counted.

All three cells of the sensor are empty there. A single empty cell is a fault, and so are many such rows: a table whose sensors take
turns has no row with both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns

Array = NDArray[np.float64]

MOST = 0.2  # of the rows


def without_blank_rows(
    columns: Columns, names: Sequence[str], sensors: Callable[[Columns], tuple[Array, Array]]
) -> tuple[Columns, tuple[Array, Array]]:
    """The log, and its sensors, without rows in which the gyros or the accelerometers have no value.

    Parameters
    ----------
    columns : Columns
    names : sequence of str
        Three of the gyros, three of the accelerometers.
    sensors : callable
        Reads them.

    Raises
    ------
    DataError
        What `sensors` raises, where no such rows, too many, or others are to blame.
    """
    try:
        return columns, sensors(columns)
    except DataError:
        filled = _filled(columns, names)
        if filled is None:
            raise
    return filled, sensors(filled)


def _filled(columns: Columns, names: Sequence[str]) -> Columns | None:
    try:
        empty = np.isnan(columns.read(names, True))
    except DataError:
        return None
    of_sensor = empty.reshape(len(empty), 2, 3)
    blank = of_sensor.any(axis=(1, 2))
    if not blank.any() or np.mean(blank) > MOST or np.any(of_sensor.any(axis=2) & ~of_sensor.all(axis=2)):
        return None
    keep = np.flatnonzero(~blank)
    first = columns.place(int(np.argmax(blank)))
    left = columns.rows_of(
        keep, f"rows without a value of each sensor left out: {int(blank.sum())}, the first is {first}"
    )
    return replace(left, read=lambda names, gaps: columns.read(names, True)[keep])


def is_empty(columns: Columns, names: Sequence[str]) -> bool:
    """Whether columns have no value in any row."""
    try:
        return bool(np.isnan(columns.read(names, True)).all())
    except DataError:
        return False
