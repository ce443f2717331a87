"""The clock of a log that stands in a file of its own, as simulators write it: ``gps-0.csv`` and ``gps_time.csv``, ``time.csv``.

It is looked for where a text has no column of time. A file of times holds one column, which increases, and has as many rows. One
that is named after the sensor wins over the one of all sensors. A column that increases and of which nobody knows what it is may be
the log's own clock: then none is taken.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns
from truenorth.formats.names import clock_of, plain
from truenorth.formats.sensor_folder import CLOCK, SUFFIXES
from truenorth.formats.text import open_table

TIMES = re.compile(rf"(?:(?P<sensor>[a-z0-9_]+?)_)?{CLOCK.pattern}")


def with_clock_file(columns: Columns, unknown: Sequence[str]) -> tuple[Columns, str | None]:
    """The same table with the clock of its folder, and the name of that file; as it is, and None, where none fits.

    Parameters
    ----------
    columns : Columns
        Of a text with a header.
    unknown : sequence of str
        Its columns that mean nothing to who reads it.
    """
    if any(clock_of(name)[0] for name in columns.names):
        return columns, None
    files = _files_of_times(columns.path)
    if not files or any(_increases(columns, name) for name in unknown):
        return columns, None
    rows = len(columns.column(columns.names[0]))
    for file in files:
        with suppress(DataError):  # no times: another file of that name
            table = open_table(file)
            name, *others = table.names
            clock = Columns(file, table.names, table.read, table.column, table.place)
            alone = table.named and not others and name not in columns.names
            if alone and len(clock.column(name)) == rows and _increases(clock, name):
                return _in_front(columns, clock, name), file.name
    return columns, None


def _increases(columns: Columns, name: str) -> bool:
    """Whether a column is of times or numbers each of which is larger than the one before."""
    try:
        values = columns.clock(name)[0]
    except DataError:
        return False
    return len(values) > 1 and bool(np.all(np.diff(values) > 0.0))


def _files_of_times(path: Path) -> list[Path]:
    """Files of times in a log's folder: those of its sensor first."""
    own = plain(path.stem)
    found = []
    for file in sorted(path.parent.iterdir()):
        match = TIMES.fullmatch(plain(file.stem)) if file.suffix.lower() in SUFFIXES and file != path else None
        if match is None or not file.is_file():
            continue
        sensor = match["sensor"]
        if sensor is None or own == sensor or own.startswith(f"{sensor}_"):
            found.append((sensor is None, file))
    return [file for _, file in sorted(found)]


def _in_front(columns: Columns, clock: Columns, name: str) -> Columns:
    """A table with one more column, the clock, in front, which is read by itself."""
    return replace(
        columns,
        names=[name, *columns.names],
        read=lambda names, gaps: clock.read(names, gaps) if list(names) == [name] else columns.read(names, gaps),
        column=lambda each: (clock if each == name else columns).column(each),
    )
