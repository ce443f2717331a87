"""The shape of a long table (:mod:`truenorth.formats.long_table`): where the sensors' names stand, and what the columns are."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from truenorth.core.errors import DataError
from truenorth.formats.columns import listed
from truenorth.formats.content import HEAD, first_bytes
from truenorth.formats.dialect import DELIMITERS, Dialect, is_remark
from truenorth.formats.names import plain
from truenorth.formats.sensor_kinds import kind_of, kind_of_number
from truenorth.formats.units import split

# a column of numbers of sensors
TYPES = re.compile(r"(?:android_)?(?:sensor_?)?(?:type|sensor)(?:_?(?:id|number|no))?")
NUMBERED = re.compile(r"(?:values?|val|v|data|axis|ch(?:annel)?)_?(\d)")  # columns of values without letters of axes
GETSENSORDATA = ("ACCE", "GYRO", "MAGN", "GNSS", "GRAV", "LACC")  # names of its rows, whose clocks are in seconds
OF_APP, OF_SENSOR = "system_time [s]", "sensor_time [s]"  # GetSensorData's two clocks
DEEPEST, FEWEST = 8, 4  # columns that may hold the name, cells of a row
MOSTLY = 0.9  # of the rows of the head have a known name


@dataclass(frozen=True)
class Shape:
    """Where the names of the sensors stand: the dialect, the column, and the names of all columns (empty without a header)."""

    dialect: Dialect
    column: int
    header: tuple[str, ...]
    numbers: bool  # whether the sensors are numbers of Android's

    def key(self, line: str) -> str:
        """The name of a sensor in a line; empty where the line is too short."""
        delimiter = self.dialect.delimiter
        cells = line.split(delimiter, self.column + 1)
        return cells[self.column].strip().strip("\"'").strip() if len(cells) > self.column else ""

    def kind(self, name: str) -> str | None:
        """What a sensor is; None where that is not known."""
        return kind_of_number(name) if self.numbers else kind_of(name)


def shape_for(path: Path, part: str) -> Shape | None:
    """The shape of a long table that holds a part of what is read: ``imu``, ``gnss`` or ``mag``; None where a file is none.

    Raises
    ------
    DataError
        Rows of an IMU's sensors under numbers that are nobody's.
    """
    found = shape_of(path) if part in ("imu", "gnss", "mag") else None
    if found is None and part == "imu":
        _refuse_other_numbers(path)
    return found


def shape_of(path: Path) -> Shape | None:
    """The shape of a long table; None where a file is none."""
    head = first_bytes(path)
    lines = head.decode("utf-8-sig", "replace").splitlines()
    lines = [line for line in (lines[:-1] if len(head) == HEAD else lines) if line.strip()]
    rows = [line for line in lines if not is_remark(line)]
    for delimiter in DELIMITERS:
        dialect = Dialect(delimiter, ".")
        cells = [dialect.cells(line) for line in rows]
        if sum(len(row) >= FEWEST for row in cells) < MOSTLY * len(rows):
            continue
        for column in range(DEEPEST):
            found = _shape(dialect, column, cells, lines)
            if found is not None:
                return found
    return None


def _shape(dialect: Dialect, column: int, cells: Sequence[Sequence[str]], lines: Sequence[str]) -> Shape | None:
    """The shape by a dialect and a column, where they fit."""
    keys = [row[column].strip("'") if column < len(row) else "" for row in cells]
    named = [k for k, key in enumerate(keys) if key[:1].isalpha()]
    # Of a table of numbers one or two lines have a name: what names mean is not asked then.
    ways = ((False, kind_of), (True, kind_of_number))
    for numbers, kind in ways if named and len(named) >= MOSTLY * (len(keys) - named[-1]) else ways[1:]:
        kinds_of_names = {key: kind(key) for key in set(keys)}
        kinds = [kinds_of_names[key] for key in keys]
        first = next((k for k, one in enumerate(kinds) if one in ("gyro", "accel", "linear")), None)
        if first is None:
            continue
        start = next(k for k, one in enumerate(kinds) if one is not None)
        known = sum(one is not None for one in kinds[start:])
        if known < MOSTLY * (len(kinds) - start) or not _are_rows(dialect, cells[first], column):
            continue
        above = cells[start - 1] if start else _remark_header(dialect, lines, len(cells[first]))
        header = tuple(above) if len(above) >= len(cells[first]) and not any(map(dialect.is_number, above)) else ()
        if numbers and not (column < len(header) and TYPES.fullmatch(plain(header[column]))):
            continue
        if numbers and not {"gyro", "accel"} <= set(kinds):
            continue
        commas = dialect.delimiter != "," and any(re.fullmatch(r"[+-]?\d+,\d+", cell) for cell in cells[first])
        return Shape(replace(dialect, decimal="," if commas else "."), column, header, numbers)
    return None


def _are_rows(dialect: Dialect, cells: Sequence[str], column: int) -> bool:
    """Whether a line of a sensor is one: three numbers at least next to the name."""
    either = replace(dialect, decimal=".,")
    return sum(either.is_number(cell) for k, cell in enumerate(cells) if k != column) >= FEWEST - 1


def _remark_header(dialect: Dialect, lines: Sequence[str], count: int) -> list[str]:
    """Names in the last remark above the rows: ``# time,sensor,x,y,z``."""
    above = next((k for k, line in enumerate(lines) if not is_remark(line)), 0)
    names = dialect.cells(lines[above - 1].lstrip("#%/ \t")) if above else []
    return names if len(names) == count else []


def _refuse_other_numbers(path: Path) -> None:
    """Refuse a table of x, y and z whose column of types holds numbers that are not Android's."""
    lines = [line for line in first_bytes(path).decode("utf-8-sig", "replace").splitlines()[:200] if line.strip()]
    for dialect in (Dialect(delimiter, ".") for delimiter in DELIMITERS if lines):
        names = [plain(name) for name in dialect.cells(lines[0])]
        column = next((k for k, name in enumerate(names) if TYPES.fullmatch(name)), None)
        if column is None or not {"x", "y", "z"} <= set(names):
            continue
        found = Counter(row[column] for row in map(dialect.cells, lines[1:-1]) if len(row) == len(names))
        if 1 < len(found) < 0.2 * len(lines) and all(name.isdecimal() for name in found):
            raise DataError(
                f"{path.name}: column {dialect.cells(lines[0])[column]}: rows of sensors {listed(sorted(found))}; expected names, "
                "such as accelerometer and gyroscope, or Android's numbers, of which 1 and 4 are these: write names"
            )


def names_of(name: str, shape: Shape, lines: Sequence[str], rows: Sequence[int]) -> list[str]:
    """Names of the columns of one sensor: of the header, of a remark about the sensor, or by what they do."""
    cells = [shape.dialect.cells(lines[k]) for k in rows[:200]]
    count = Counter(map(len, cells)).most_common(1)[0][0]
    cells = [row for row in cells if len(row) == count]
    names = list(shape.header[:count])
    if not names:
        said = re.compile(
            rf"[#%/].*?(?<![^\s'\"#%/])({re.escape(name)}{re.escape(shape.dialect.delimiter or ' ')}[^'\"]*)"
        )
        found = next((m[1] for line in lines[: rows[0]] if (m := said.match(line.strip()))), "")
        names = shape.dialect.cells(found.replace("unix,", "")) if found else []
        names = names if len(names) == count else [word for word in names if word]
    if len(names) != count:
        names = _by_what_they_do(name, shape, cells)
    numbered = [m for word in names if (m := NUMBERED.fullmatch(plain(split(word)[0])))]
    if len(numbered) >= 3 and not {"x", "y", "z"} <= {plain(word) for word in names}:
        start = [plain(split(word)[0]) for word in names].index(numbered[0][0])
        if all(NUMBERED.fullmatch(plain(split(word)[0])) for word in names[start : start + 3]):
            names[start : start + 3] = "xyz"
    apart = []
    for k, word in enumerate(names):
        words = plain(split(word)[0])
        word = {"app_timestamp": OF_APP, "sensor_timestamp": OF_SENSOR}.get(words, word) if not shape.header else word
        apart.append(word if word and word not in apart else f"column {k + 1}")
    apart[shape.column] = "sensor's name"
    return apart


def _by_what_they_do(name: str, shape: Shape, cells: Sequence[Sequence[str]]) -> list[str]:
    """Names of columns without a header: clocks never go back; the three numbers behind them are x, y, z."""
    names, left = [f"column {k + 1}" for k in range(len(cells[0]))], list("xyz")
    decimal = shape.dialect.decimal
    spans: list[float] = []  # of the clocks
    for k in range(len(names)):
        if k == shape.column or not all(shape.dialect.is_number(row[k]) for row in cells):
            continue
        values = np.array([float(row[k].replace(decimal, ".")) for row in cells])
        rises = len(values) > 3 and np.all(np.diff(values) >= 0.0) and len(set(values)) > 0.5 * len(values)
        span = float(values[-1] - values[0])
        alike = not spans or any(abs(span / spans[0] / 10.0**power - 1.0) < 0.05 for power in range(-9, 10, 3))
        if len(left) == 3 and rises and alike and len(spans) < 2 and len(names) - k > 3:
            names[k] = ("time", "sensor_time")[len(spans)]
            spans.append(span)
        elif left:
            names[k] = left.pop(0)
        elif rises and not spans:  # behind the values
            names[k] = "time"
            spans.append(span)
    if len(spans) == 2 and name in GETSENSORDATA:
        names[names.index("time")], names[names.index("sensor_time")] = OF_APP, OF_SENSOR
    return names
