"""The clock of a log that stands in a file of its own, as simulators write it: ``gps-0.csv`` and ``gps_time.csv``, ``time.csv``.

It is looked for where a table has no column of time. A file of times holds one column, which increases, and has as many rows. One
that is named after the sensor wins over the one of all sensors.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns
from truenorth.formats.names import clock_of, plain
from truenorth.formats.text import open_table

Array = NDArray[np.float64]

TIMES = re.compile(r"(?:(?P<sensor>[a-z0-9_]+?)_)?time(?:_?stamps?)?")


def with_clock_file(columns: Columns) -> Columns:
    """The same table with the clock of its folder; as it is where it has one, or where none fits.

    Parameters
    ----------
    columns : Columns
        Of a text with a header.

    Raises
    ------
    DataError
        A file of times with a cell that is no time.
    """
    if not columns.named or any(clock_of(name)[0] for name in columns.names):
        return columns
    files = _files_of_times(columns.path)
    if not files:
        return columns
    rows = len(columns.column(columns.names[0]))
    for file in files:
        table = open_table(file)
        if not table.named or len(table.names) != 1:
            continue
        name = table.names[0]
        clock = Columns(file, table.names, table.read, table.column, table.place, True)
        time = clock.clock(name)[0]
        if len(time) == rows and np.all(np.diff(time) > 0.0):
            return _in_front(columns, clock, name)
    return columns


def _files_of_times(path: Path) -> list[Path]:
    """Files of times in a log's folder: those of its sensor first."""
    own = plain(path.stem)
    found = []
    for file in sorted(path.parent.iterdir()):
        match = (
            TIMES.fullmatch(plain(file.stem)) if file.suffix.lower() == path.suffix.lower() and file != path else None
        )
        if match is None or not file.is_file():
            continue
        sensor = match["sensor"]
        if sensor is None or own == sensor or own.startswith(f"{sensor}_"):
            found.append((sensor is None, file))
    return [file for _, file in sorted(found)]


def _in_front(columns: Columns, clock: Columns, name: str) -> Columns:
    """A table with one more column, the clock, in front."""

    def read(names: Sequence[str], gaps: bool) -> Array:
        others = [other for other in names if other != name]
        values = dict(zip(others, columns.read(others, gaps).T, strict=True)) if others else {}
        if name in names:
            values[name] = clock.read([name], gaps)[:, 0]
        return np.column_stack([values[each] for each in names])

    if name in columns.names:
        raise DataError(
            f"{columns.path.name}: column {name} stands in {clock.path.name}, too; expected one of them: rename one"
        )
    return replace(
        columns,
        names=[name, *columns.names],
        read=read,
        column=lambda each: clock.column(each) if each == name else columns.column(each),
        notes=(*columns.notes, f"its clock is {clock.path.name}"),
    )
