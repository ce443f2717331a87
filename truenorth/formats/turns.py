"""Increments of attitude as quaternions, ``OriInc_q0`` .. ``OriInc_q3`` and ``dq_W`` .. ``dq_Z``, as the angles that they are.

Xsens's and Movella's programs write them next to increments of velocity. The vector part alone is half the angle.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns
from truenorth.formats.names import families, plain

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

PART = re.compile(r"(?:ori_?inc|dq|d(?:elta)?_?quat(?:ernion)?|delta_?q)_?q?_?([0-3wxyz])")
FORMS = ("wxyz", "0123")
ANGLES = tuple(f"OriInc_{axis} [rad]" for axis in "xyz")
NORM = 1e-3  # by which that of such a quaternion differs from one, as logs round it


def with_angles(columns: Columns) -> Columns:
    """The columns, and the angles of increments of attitude where the log has these and no rates.

    Raises
    ------
    DataError
        When the angles are read: four columns that are no quaternion near to no turn.
    """
    if not columns.named:
        return columns
    parts: dict[str, str] = {}
    for name in columns.names:
        match = PART.fullmatch(plain(name))
        if match is not None:
            parts.setdefault(match[1], name)
    form = next((form for form in FORMS if set(form) <= set(parts)), None)
    found = families(columns.names)
    if form is None or found["gyro"] or found["dtheta"]:
        return columns
    four = [parts[part] for part in form]

    def angles() -> Array:
        values = columns.read(four, False)
        norm = np.linalg.norm(values, axis=1)
        if not np.all(np.abs(norm - 1.0) < NORM):
            row = int(np.argmax(~(np.abs(norm - 1.0) < NORM)))
            raise DataError(
                f"{columns.path.name}: {columns.place(row)}, columns {' '.join(four)}: a norm of {norm[row]:.6g}; expected a "
                "quaternion, of norm 1: name other columns, or repair the row"
            )
        values = values * np.where(values[:, :1] < 0.0, -1.0, 1.0) / norm[:, None]
        half = np.linalg.norm(values[:, 1:], axis=1)
        scale = np.where(half > 1e-9, 2.0 * np.arctan2(half, values[:, 0]) / np.maximum(half, 1e-9), 2.0)
        return np.asarray(values[:, 1:] * scale[:, None])

    def read(names: Sequence[str], gaps: bool) -> Array:
        if not set(names) & set(ANGLES):
            return columns.read(names, gaps)
        turned, others = angles(), [name for name in names if name not in ANGLES]
        table = columns.read(others, gaps) if others else np.zeros((len(turned), 0))
        return np.column_stack(
            [turned[:, ANGLES.index(name)] if name in ANGLES else table[:, others.index(name)] for name in names]
        )

    def column(name: str) -> pa.ChunkedArray:
        import pyarrow as pa

        return pa.chunked_array([read([name], False)[:, 0]]) if name in ANGLES else columns.column(name)

    note = f"angles of the increments {' '.join(four)}"
    return replace(columns, names=[*columns.names, *ANGLES], read=read, column=column, notes=(*columns.notes, note))
