"""Racelogic's ``.vbo``, text of a VBOX: sections in brackets, of which the last is a table of blanks.

Latitude and longitude are in minutes of arc, and the longitude is positive to the west. The time is UTC, written HHMMSS.SS. The
number of satellites has 64 added while a brake trigger is closed, and 128 with a differential correction. The units of the
speeds stand in the section ``[header]``, those of channels of other modules in ``[channel units]``.

Source: Racelogic, "VBO file format".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.clock_face import of_clock_face
from truenorth.formats.columns import Columns
from truenorth.formats.content import first_bytes, text_of
from truenorth.formats.dialect import Dialect
from truenorth.formats.text import TextTable, without_a_cut_end
from truenorth.formats.units import unit_in

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

NAMES = {
    "lat": "lat [deg]",
    "long": "lon [deg]",
    "velocity": "speed",
    "heading": "course [deg]",
    "height": "alt [m]",
    "vertvel": "VU",
}
OF_HEADER = {"velocity": r"velocity\W+(\S+)", "vertvel": r"vertical velocity\W+(\S+)"}
SPEED = "km/h"  # where the header does not say
STANDARD = ("sats", "time", *NAMES)
ALL_SATS = 63
NOTE = "a VBOX's: latitude and longitude in minutes of arc, longitude positive to the west, turned to degrees east"


def is_one(path: Path) -> bool:
    """Whether a file begins as a VBOX's does."""
    head = first_bytes(path).lower()
    return (
        re.search(rb"(?m)^\[column names\]\s*$", head) is not None
        and re.search(rb"(?m)^\[data\]\s*$", head) is not None
    )


def columns(path: Path) -> Columns:
    """The columns of such a file, with the names and the directions of ours where they are standard.

    Raises
    ------
    DataError
        No time or no place in it.
    """
    table, lines = _table(path)
    theirs = [_plain(name) for name in table.names]
    missing = [name for name in ("sats", "time", "lat", "long") if name not in theirs]
    if missing:
        raise DataError(
            f"{path.name}: column {missing[0]!r} is missing under [column names]; found {' '.join(table.names)}: export the "
            "file anew"
        )
    ours = dict(zip(_names(theirs, table, lines), table.names))

    @np.errstate(invalid="ignore")  # a cell may hold 1e400: what is infinite is no number of satellites
    def read(names: Sequence[str], gaps: bool) -> Array:
        plain = ["sats" if name == "quality" else ours[name] for name in names]
        values = table.read(
            [table.names[theirs.index("sats")] if name == "sats" else name for name in plain], gaps
        ).copy()
        for k, name in enumerate(names):
            if name == "time":
                values[:, k] = of_clock_face(values[:, k])
            elif name in ("lat [deg]", "lon [deg]"):
                values[:, k] /= 60.0 if name == "lat [deg]" else -60.0
            elif name in ("sats", "quality"):
                values[:, k] = np.mod(values[:, k], ALL_SATS + 1.0)
                if name == "quality":  # none, or one of which the file does not say how good it is
                    values[:, k] = values[:, k] > 0.0
        return values

    def column(name: str) -> pa.ChunkedArray:
        import pyarrow as pa

        of_ours = name in (*NAMES.values(), "time", "sats", "quality")
        return pa.chunked_array([read([name], True)[:, 0]]) if of_ours else table.column(ours[name])

    notes = (*table.notes, NOTE)
    why = "the sections of a VBOX's file"
    return Columns(path, [*ours, "quality"], read, column, table.place, True, notes, why, table.above)


def _table(path: Path) -> tuple[TextTable, list[str]]:
    """The rows below ``[data]``, and the lines above."""
    text, note = text_of(path)
    lines = [line.decode("latin-1") for line in text[: 1 << 16].splitlines()]  # of bytes: no other signs end a line
    start = next(k for k, line in enumerate(lines) if line.strip().casefold() == "[data]")
    above = lines[:start]
    names = " ".join(_section(above, "column names")).split()
    notes = () if note is None else (note,)
    return without_a_cut_end(TextTable(path, text, names, True, Dialect(None, "."), start + 1, "", (), notes)), above


def _plain(name: str) -> str:
    return re.sub(r"[^a-z]", "", name.casefold()) if name.casefold().replace("-", "") in STANDARD else name


def _names(theirs: Sequence[str], table: TextTable, lines: Sequence[str]) -> list[str]:
    """Our names of the columns, with units."""
    others = [name for name in theirs if name not in STANDARD]
    said = [line.strip() for line in _section(lines, "channel units") if line.strip()]
    units = dict(zip(others, said)) if len(said) == len(others) else {}
    titles = _section(lines, "header")
    names = []
    for name, label in zip(theirs, table.names):
        if name in OF_HEADER:
            found = next((m[1] for t in titles if (m := re.match(OF_HEADER[name], t.strip(), re.IGNORECASE))), SPEED)
            unit = unit_in(found.strip("()[]"))
            if unit is None:
                raise DataError(
                    f"{table.path.name}: [header]: {name} in {found}; expected a unit of speed, such as kmh, m/s, mph or knots: "
                    "export the file in one of them"
                )
            names.append(f"{NAMES[name]} [{unit}]")
        else:
            names.append(
                NAMES.get(name)
                or (name if name in STANDARD else f"{label} [{units[name]}]" if name in units else label)
            )
    return names


def _section(lines: Sequence[str], name: str) -> list[str]:
    """The lines of a section."""
    start = next((k for k, line in enumerate(lines) if line.strip().casefold() == f"[{name}]"), None)
    if start is None:
        return []
    end = next((k for k in range(start + 1, len(lines)) if lines[k].strip().startswith("[")), len(lines))
    return list(lines[start + 1 : end])
