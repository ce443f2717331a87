"""KF-GINS IMU files: t, three angle and three velocity increments (rad, m/s), forward-right-down; text or doubles.

Columns beyond the seventh (an odometer's) are left alone. Binary rows of seven whose time stands last are those of the PSINS
toolbox (binfile.m, binfile32.m: doubles, or numbers of four bytes), right-forward-up.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.content import REMARKS
from truenorth.formats.layout import Layout
from truenorth.formats.table import finish
from truenorth.formats.text import open_table
from truenorth.records import Guess, ImuRecord

Array = NDArray[np.float64]

EXPECTED = "rows of t, three angle and three velocity increments in rad and m/s"
COLUMNS = ["t", "dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"]
ROW = 8 * len(COLUMNS)
PSINS = Guess(
    "columns", "angle and velocity increments and time, as PSINS keeps them", "time is the last of seven", 1.0, {}
)
LARGEST = 100.0  # rad or m/s, of an increment
SHORTEST, LONGEST = 1e-5, 1.0  # s, between two rows
MOSTLY = 0.95  # of the rows: a damaged one does not change what a file is


def read_text(path: Path, layout: Layout) -> ImuRecord:
    """Read the text form.

    Raises
    ------
    DataError
        Fewer than seven columns, a header of names, text in a number, NaN, time going back: with the line.
    """
    table = open_table(path)
    count = len(table.names)
    if count < len(COLUMNS):
        raise DataError(f"{path.name}: {count} columns; expected 7: {EXPECTED}")
    if table.named and not table.header.lstrip().startswith(REMARKS):
        raise DataError(
            f"{path.name}: a header of names, {table.header.strip()!r}; KF-GINS files have none: read it as csv"
        )
    table = replace(table, names=[*COLUMNS, *table.names[len(COLUMNS) :]])
    values = table.read(COLUMNS)
    if not np.all(np.diff(values[:, 0]) > 0) and np.all(np.diff(values[:, 6]) > 0):
        raise DataError(f"{path.name}: time stands in the seventh column; expected {EXPECTED}: read it as psins")
    return finish(
        values[:, 0], values[:, 1:4], values[:, 4:], layout.kind or "increments", layout, path.name,
        axes="FRD", labels=COLUMNS, place=table.place,
    )  # fmt: skip


def read_binary(path: Path, layout: Layout) -> ImuRecord:
    """Read the binary form: seven little-endian doubles a row, time first; or those of PSINS, time last.

    Raises
    ------
    DataError
        A size that is no multiple of a row's, or numbers that cannot be those of an IMU.
    """
    size = path.stat().st_size
    if (rows := _psins(path, size)) is not None:
        return finish(
            rows[:, 6], rows[:, :3], rows[:, 3:6], layout.kind or "increments", layout, path.name,
            labels=("t", "gx", "gy", "gz", "ax", "ay", "az"),
            taken_for=(PSINS,),
        )  # fmt: skip
    if size % ROW:
        raise DataError(
            f"{path.name}: {size} bytes are {size // ROW} rows of {ROW} and {size % ROW} bytes over; the file is cut "
            "short or not of this format"
        )
    values = np.fromfile(path, dtype="<f8").reshape(-1, len(COLUMNS))
    # Bytes of anything else read as doubles are mostly tiny, huge or NaN, and in no order.
    if not np.all(np.isfinite(values)) and np.count_nonzero(np.isfinite(values)) < 0.99 * values.size:
        raise DataError(f"{path.name}: not doubles of an IMU; expected {EXPECTED}, seven doubles a row")
    if np.count_nonzero(np.diff(values[:, 0]) <= 0) > 0.1 * len(values):
        raise DataError(f"{path.name}: the first of seven doubles is no time that goes on; expected {EXPECTED}")
    return finish(
        values[:, 0], values[:, 1:4], values[:, 4:], layout.kind or "increments", layout, path.name,
        axes="FRD", labels=COLUMNS,
    )  # fmt: skip


def _psins(path: Path, size: int) -> Array | None:
    """Rows of seven numbers of eight or four bytes whose last one is a steady clock, and the first one none; None without such."""
    for width in ("<f8", "<f4"):
        row = len(COLUMNS) * np.dtype(width).itemsize
        if size % row or size < 3 * row:
            continue
        with np.errstate(invalid="ignore"):  # numbers of another width read as these
            values = np.fromfile(path, dtype=width).reshape(-1, len(COLUMNS)).astype(np.float64)
        good = np.isfinite(values).all(axis=1)
        if np.mean(good) < MOSTLY or np.quantile(np.abs(values[good, :6]), MOSTLY) > LARGEST:
            continue
        low, middle, high = np.quantile(np.diff(values[good, 6]), [0.05, 0.5, 0.95])
        steady = SHORTEST < middle < LONGEST and low > 0.4 * middle and high < 2.5 * middle
        if steady and np.mean(np.diff(values[good, 0]) > 0.0) < MOSTLY:
            return values if width == "<f8" else np.column_stack([values[:, :6], _even(values[:, 6])])
    return None


def _even(time: Array) -> Array:
    """A clock in numbers of four bytes, which holds a day to 4 ms: evenly spaced where its steps agree with that."""
    even = np.linspace(time[0], time[-1], len(time))
    return even if np.all(np.abs(even - time) <= 2.0 * np.spacing(time.astype(np.float32))) else time
