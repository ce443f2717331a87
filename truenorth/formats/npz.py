"""NumPy .npz: ``time``, ``gyro`` and ``accel`` (or ``dtheta`` and ``dvel``), or other arrays by name."""

from __future__ import annotations

import zlib
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from truenorth.errors import DataError
from truenorth.formats.arrays import record_from_arrays
from truenorth.formats.layout import BLOCKS, Layout
from truenorth.records import ImuRecord


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a NumPy archive; nothing that would have to be unpickled is.

    Raises
    ------
    DataError
        A damaged file, or variables that are missing or have other shapes.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            variables = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error) as error:
        raise DataError(f"{path.name}: the NumPy archive is damaged or cut short ({error}); write it anew") from None
    return record_from_arrays(variables, layout, path.name)


def write(record: ImuRecord, path: Path) -> None:
    """Write a record as ``time``, and ``gyro, accel`` or ``dtheta, dvel``."""
    gyro, accel = BLOCKS[record.kind]
    with path.open("wb") as file:
        np.savez(file, **{"time": record.time, gyro: record.gyro, accel: record.accel})  # type: ignore[arg-type]
