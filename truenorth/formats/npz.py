"""NumPy .npz: ``time``, ``gyro`` and ``accel`` (or ``dtheta`` and ``dvel``), or other arrays by name."""

from __future__ import annotations

import math
import zlib
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.content import LARGEST
from truenorth.formats.layout import BLOCKS
from truenorth.records import ImuRecord, Record


def variables_of(path: Path) -> dict[str, Any]:
    """The arrays of a file by name.

    Raises
    ------
    DataError
        A damaged file.
    """
    try:
        _check_size(path)
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    except MemoryError:
        raise DataError(f"{path.name}: its arrays do not fit into memory; expected a smaller log") from None
    except (ValueError, OSError, EOFError, KeyError, NotImplementedError, BadZipFile, zlib.error) as error:
        raise DataError(f"{path.name}: the NumPy archive is damaged or cut short ({error}); write it anew") from None


def _check_size(path: Path) -> None:
    """Refuse an archive whose headers promise more than memory takes, before anything is unpacked."""
    total = 0
    with ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as file:
                version = np.lib.format.read_magic(file)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(file)
            total += math.prod(shape) * dtype.itemsize
    if total > LARGEST:
        raise DataError(
            f"{path.name}: its arrays hold {total / 2**30:.3g} GiB; expected at most {LARGEST >> 30}: cut the log into parts"
        )


def write(record: Record, path: Path) -> None:
    """Write an IMU's record as ``time``, and ``gyro, accel`` or ``dtheta, dvel``; another one column by column."""
    columns = record.columns()
    if isinstance(record, ImuRecord):
        gyro, accel = BLOCKS[record.kind]
        columns = {gyro: record.gyro, accel: record.accel}
    with path.open("wb") as file:
        np.savez(file, **{"time": record.time, **columns})  # type: ignore[arg-type]
