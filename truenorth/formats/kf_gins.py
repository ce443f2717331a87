"""KF-GINS IMU files: t, three angle and three velocity increments (rad, m/s), axes forward-right-down; text or doubles."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truenorth.errors import DataError
from truenorth.formats.table import Layout, finish, with_defaults
from truenorth.records import ImuRecord

COLUMNS = 7


def read_text(path: Path, layout: Layout) -> ImuRecord:
    """Read the text form."""
    try:
        table = np.loadtxt(path, ndmin=2, comments=("%", "#"), encoding="utf-8")
    except (ValueError, UnicodeDecodeError) as error:
        raise DataError(
            f"{path.name}: {error}; expected rows of t, three angle and three velocity increments"
        ) from None
    if table.size == 0 or table.shape[1] < COLUMNS:
        found = table.shape[1] if table.size else "no"
        raise DataError(f"{path.name}: {found} columns; expected 7: t, three angle and three velocity increments")
    return _record(table, layout, path.name)


def read_binary(path: Path, layout: Layout) -> ImuRecord:
    """Read the binary form: seven little-endian doubles a row."""
    size = path.stat().st_size
    if size == 0 or size % (8 * COLUMNS):
        whole = size // (8 * COLUMNS)
        raise DataError(
            f"{path.name}: {size} bytes are {whole} rows of 56 and {size % 56} bytes over; the file is cut short or not of "
            "this format"
        )
    return _record(np.fromfile(path, dtype="<f8").reshape(-1, COLUMNS), layout, path.name)


def _record(table: np.ndarray, layout: Layout, source: str) -> ImuRecord:
    layout = with_defaults(layout, axes="FRD")
    return finish(table[:, 0], table[:, 1:4], table[:, 4:7], "increments", layout, source)
