"""NumPy .npz: ``time``, ``gyro`` and ``accel`` (or ``dtheta`` and ``dvel``), or other arrays by name."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.arrays import record_from_arrays
from truenorth.formats.layout import BLOCKS, Layout
from truenorth.records import ImuRecord, Record


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a NumPy archive; nothing that would have to be unpickled is.

    Raises
    ------
    DataError
        A damaged file, or variables that are missing or have other shapes.
    """
    return record_from_arrays(variables_of(path), layout, path.name)


def variables_of(path: Path) -> dict[str, Any]:
    """The arrays of a file by name.

    Raises
    ------
    DataError
        A damaged file.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error) as error:
        raise DataError(f"{path.name}: the NumPy archive is damaged or cut short ({error}); write it anew") from None


def write(record: Record, path: Path) -> None:
    """Write an IMU's record as ``time``, and ``gyro, accel`` or ``dtheta, dvel``; another one column by column."""
    columns = record.columns()
    if isinstance(record, ImuRecord):
        gyro, accel = BLOCKS[record.kind]
        columns = {gyro: record.gyro, accel: record.accel}
    with path.open("wb") as file:
        np.savez(file, **{"time": record.time, **columns})  # type: ignore[arg-type]
