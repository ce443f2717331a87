"""MATLAB .mat up to version 7: arrays by name, fields of structs as ``trj.imu``; ``imu`` of PSINS without being told."""

from __future__ import annotations

import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.arrays import record_from_arrays
from truenorth.formats.layout import Layout
from truenorth.records import ImuRecord

PSINS = {"dtheta": "imu[0:3]", "dvel": "imu[3:6]", "time": "imu[6]"}


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a MATLAB file.

    An array ``imu`` of seven columns is what the PSINS toolbox keeps under this name (three angle and three velocity
    increments, time; right-forward-up), unless the layout names columns.

    Raises
    ------
    DataError
        A damaged file, one of version 7.3, or variables that are missing or have other shapes.
    """
    variables = variables_of(path)
    if not layout.columns and np.shape(variables.get("imu", 0))[1:] == (7,):
        layout = replace(layout, columns=PSINS)
    return record_from_arrays(variables, layout, path.name)


def variables_of(path: Path) -> dict[str, Any]:
    """The variables of a file by name, fields of structs as ``trj.imu``.

    Raises
    ------
    DataError
        A damaged file, or one of version 7.3.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        raise DataError(
            f"{path.name}: a MATLAB 7.3 (HDF5) file; save it with save('{path.name}', ..., '-v7') and read that"
        ) from None
    except (ValueError, TypeError, OSError, EOFError, MatReadError, zlib.error) as error:
        raise DataError(f"{path.name}: the MATLAB file is damaged or cut short ({error}); write it anew") from None
    return _flat({name: value for name, value in content.items() if not name.startswith("__")})


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in _flat(value).items()}
        else:
            flat[name] = value
    return flat
