"""KF-GINS IMU files: t, three angle and three velocity increments (rad, m/s), forward-right-down; text or doubles.

Columns beyond the seventh (an odometer's) are left alone.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.layout import Layout
from truenorth.formats.table import finish
from truenorth.formats.text import REMARKS, open_table
from truenorth.records import ImuRecord

EXPECTED = "rows of t, three angle and three velocity increments in rad and m/s"
COLUMNS = ["t", "dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"]
ROW = 8 * len(COLUMNS)


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
    """Read the binary form: seven little-endian doubles a row.

    Raises
    ------
    DataError
        A size that is no multiple of a row's, or numbers that cannot be those of an IMU.
    """
    size = path.stat().st_size
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
