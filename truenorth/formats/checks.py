"""What no log may hold where a number is needed, by its place in the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.errors import DataError
from truenorth.records.base import first_disorder

Array = NDArray[np.float64]


LARGEST = 1e100  # in whatever unit; squares of what is larger overflow


def check_finite(values: Array, labels: Sequence[str], source: str, place: Callable[[int], str]) -> None:
    """Refuse NaN, inf and what no sensor writes in any unit among the columns (N, len(labels)) of a file, by place and column."""
    for rows in row_blocks(len(values)):
        finite = np.abs(values[rows]) < LARGEST
        if not finite.all():
            row, column = (int(i) for i in np.argwhere(~finite)[0] + (rows.start, 0))
            raise DataError(
                f"{source}: {place(row)}, column {labels[column]}: {values[row, column]}; expected a finite number: remove "
                "the row or repair the log"
            )


def check_order(time: Array, label: str, source: str, place: Callable[[int], str]) -> None:
    """Refuse time that does not increase, by its place in the file."""
    if (found := first_disorder(time)) is not None:
        k, what = found
        raise DataError(
            f"{source}: {place(k)}, column {label}: time {what} ({time[k - 1]:.15g}, then {time[k]:.15g}); expected "
            "strictly increasing time: sort the log or drop the repeated rows"
        )
