"""MATLAB .mat of versions 4 to 7: arrays by name, fields of structs as ``trj.imu``; those of toolboxes without being asked.

Of a struct array with a record in each element a field is a column: ``imu(k).accelX`` is ``imu.accelX``.

SciPy's reader follows pointers of the file without a check, and ends the interpreter on some damaged ones: it runs in a
process of its own.
"""

from __future__ import annotations

import io
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats import mat_child
from truenorth.formats.columns import columns_of_arrays
from truenorth.formats.content import LARGEST
from truenorth.formats.layout import Layout
from truenorth.formats.table import record_of
from truenorth.formats.toolboxes import imu_layout
from truenorth.records import ImuRecord

LONGEST = 300.0  # s, of reading


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a MATLAB file.

    An array ``imu`` of seven columns is what the PSINS toolbox keeps under this name, a struct of ``t, fb, wb`` and a
    specification is NaveGo's (:mod:`truenorth.formats.toolboxes`), unless the layout names columns.

    Raises
    ------
    DataError
        A damaged file, one of version 7.3, or variables that are missing or have other shapes.
    """
    variables = variables_of(path)
    found, whose = imu_layout(variables, layout)
    record = record_of(columns_of_arrays(path, variables), found)
    return record if whose is None else replace(record, taken_for=(whose,))


def variables_of(path: Path) -> dict[str, Any]:
    """The variables of a file by name, fields of structs as ``trj.imu``.

    Raises
    ------
    DataError
        A damaged file, one of version 7.3, or one without an array of numbers.
    """
    command = [sys.executable, "-I", mat_child.__file__, str(path.absolute()), str(LARGEST)]
    try:
        child = subprocess.run(command, capture_output=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        raise DataError(f"{path.name}: not read in {LONGEST:g} s; the MATLAB file is damaged") from None
    if child.returncode == mat_child.TOO_NEW:
        raise DataError(
            f"{path.name}: a MATLAB 7.3 (HDF5) file; save it with save('{path.name}', ..., '-v7') and read that"
        )
    if child.returncode == mat_child.NOTHING:
        raise DataError(
            f"{path.name}: no arrays of numbers in this MATLAB file; found {_said(child.stderr)}; expected arrays, structs of "
            "arrays or struct arrays of numbers: save the columns of the sensor so (a table by table2struct(T, 'ToScalar', true))"
        )
    if child.returncode:
        reason = _said(child.stderr) or "its reader crashed"
        raise DataError(f"{path.name}: the MATLAB file is damaged or cut short ({reason}); write it anew")
    with np.load(io.BytesIO(child.stdout), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _said(errors: bytes) -> str:
    """The last line that the reader wrote before it ended."""
    return next(iter(errors.decode(errors="replace").strip().splitlines()[::-1]), "")
