"""A log of any format as columns: which file opens which."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from truenorth.formats.columns import Columns, columns_of_arrays


def columns_of(path: Path, format: str, named: bool = True, part: str = "imu") -> Columns:
    """A log of any format as columns; of two-dimensional arrays each column is ``name[i]``, counted from 0.

    Parameters
    ----------
    path : Path
    format : str
    named : bool
        Whether the caller names columns; else those of toolboxes get our names.
    part : str
        What is read of a table with rows of several sensors: ``imu``, ``gnss`` or ``mag``.

    Raises
    ------
    DataError
        A damaged file, or one without a table.
    """
    if format in ("csv", "kf-gins", "psins"):
        from truenorth.formats import json_rows, vbo
        from truenorth.formats.labelled import NOTE
        from truenorth.formats.long_shape import shape_for
        from truenorth.formats.text import open_table

        if vbo.is_one(path):
            return vbo.columns(path)
        if json_rows.is_one(path):
            return json_rows.columns(path)
        if (shape := shape_for(path, part)) is not None:
            from truenorth.formats import long_table

            return long_table.columns(path, part, shape)
        table = open_table(path)
        labelled = NOTE in table.notes
        notes = table.notes if labelled else (*table.notes, table.dialect.words())
        why = (
            "most lines are pairs of a name and a number"
            if labelled
            else "the dialect in which most lines are rows of numbers"
        )
        # A clock is asked for more than once, and each time is a pass over the text.
        column = lru_cache(maxsize=2)(table.column)
        return Columns(path, table.names, table.read, column, table.place, table.named, notes, why, table.above)
    if format == "sensor-folder":
        from truenorth.formats import sensor_folder

        return sensor_folder.columns(path)
    if format in ("parquet", "feather"):
        from truenorth.formats import parquet

        return parquet.columns(path, format)
    from truenorth.formats import mat, npz, toolboxes

    if format == "npz":
        return columns_of_arrays(path, npz.variables_of(path))
    variables = mat.variables_of(path)
    return columns_of_arrays(path, variables if named else toolboxes.aiding(variables))
