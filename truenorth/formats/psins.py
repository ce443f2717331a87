"""PSINS text ``.imu``: increments gx gy gz ax ay az [t] in rad and m/s, axes right-forward-up; % or # begins a comment."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truenorth.errors import DataError
from truenorth.formats.table import Layout, finish
from truenorth.records import ImuRecord


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a PSINS log; six columns need a rate."""
    try:
        table = np.loadtxt(path, ndmin=2, comments=("%", "#"), encoding="utf-8")
    except (ValueError, UnicodeDecodeError) as error:
        raise DataError(f"{path.name}: {error}; expected rows of gx gy gz ax ay az [t]") from None
    if table.size == 0 or table.shape[1] not in (6, 7):
        found = table.shape[1] if table.size else "no"
        raise DataError(f"{path.name}: {found} columns; expected 6 or 7: gx gy gz ax ay az [t]")
    time = table[:, 6] if table.shape[1] == 7 else None
    return finish(time, table[:, :3], table[:, 3:6], "increments", layout, path.name)
