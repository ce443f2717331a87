"""NumPy .npz and MATLAB .mat: named arrays, one for each column or one (N, 3) array for each sensor."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import DataError, UsageError
from truenorth.formats.table import Layout, finish, record_from_columns
from truenorth.records import ImuRecord

Array = NDArray[np.float64]
BLOCKS = {"rates": ("gyro", "accel"), "increments": ("dtheta", "dvel")}


def read_npz(path: Path, layout: Layout) -> ImuRecord:
    """Read a NumPy archive; nothing that would have to be unpickled is."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            variables = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, BadZipFile) as error:
        raise DataError(f"{path.name}: the NumPy archive cannot be read ({error})") from None
    return _record(variables, layout, path.name)


def read_mat(path: Path, layout: Layout) -> ImuRecord:
    """Read a MATLAB file of version 7 or older."""
    from scipy.io import loadmat

    try:
        variables = loadmat(path, squeeze_me=True)
    except NotImplementedError:
        raise DataError(
            f"{path.name}: a MATLAB 7.3 (HDF5) file; save it with save('{path.name}', ..., '-v7') and read that"
        ) from None
    except (ValueError, OSError) as error:
        raise DataError(f"{path.name}: the MATLAB file cannot be read ({error})") from None
    return _record({k: v for k, v in variables.items() if not k.startswith("__")}, layout, path.name)


def write_npz(record: ImuRecord, path: Path) -> None:
    """Write a record as ``time``, and ``gyro, accel`` or ``dtheta, dvel``."""
    gyro, accel = BLOCKS[record.kind]
    with path.open("wb") as file:
        np.savez(file, **{"time": record.time, gyro: record.gyro, accel: record.accel})  # type: ignore[arg-type]


def _record(variables: Mapping[str, Any], layout: Layout, source: str) -> ImuRecord:
    for kind, blocks in BLOCKS.items():
        if all(layout.columns.get(block, block) in variables for block in blocks):
            gyro, accel = (_array(variables, layout.columns.get(block, block), source, 2) for block in blocks)
            name = layout.columns.get("time", "time")
            time = _array(variables, name, source, 1) if name in variables else None
            if time is None and layout.rate is None:
                raise UsageError(f"{source}: no variable {name!r}; name it with --columns time=..., or give --rate")
            return finish(time, gyro, accel, layout.kind or kind, layout, source)  # type: ignore[arg-type]
    return record_from_columns(list(variables), lambda name: _array(variables, name, source, 1), layout, source)


def _array(variables: Mapping[str, Any], name: str, source: str, dimensions: int) -> Array:
    value = np.asarray(variables[name])
    if value.dtype.kind not in "fiu" or value.ndim != dimensions or (dimensions == 2 and value.shape[1] != 3):
        shape = "(N, 3)" if dimensions == 2 else "(N,)"
        raise DataError(
            f"{source}: variable {name!r} has shape {value.shape} and type {value.dtype}; expected numbers of shape {shape}"
        )
    return value.astype(np.float64)
