"""A log as named columns, whatever its format; clocks in seconds, where dates and times of day stand."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.core.units import parse_unit
from truenorth.formats.arrow import to_numpy
from truenorth.formats.dates import dates_of, is_date
from truenorth.formats.layout import BLOCKS
from truenorth.formats.wraps import unwrapped

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]
DAY = 86400.0
OURS = tuple(name for pair in BLOCKS.values() for name in pair)  # arrays of three columns with our names

SECONDS = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)? (?:s|sec|min|hr)", re.IGNORECASE)  # MATLAB's ``0.01 sec``
MOST_NAMES, LONGEST_NAME = 40, 60  # of a message


@dataclass(frozen=True)
class Columns:
    """A log as named columns.

    Attributes
    ----------
    path : Path
    names : sequence of str
    read : callable
        Columns of some names side by side, (N, n), for (names, whether gaps are allowed); empty cells are NaN.
    column : callable
        One column as Arrow keeps it, in the type that it has.
    place : callable
        Where a row stands in the file, in words.
    named : bool
        Whether the names are the log's own; else ``1, 2, ...``.
    notes : tuple of str
        What was left out or mended, and how the log is written.
    why : str
        By what that was found.
    whole : mapping
        Arrays of doubles that are there as they stand, in memory or on the disk, by the names of their columns.
    anew : dict
        What the clocks are that were read and start anew, by name: :meth:`clock` writes it.
    rows : mapping
        How many rows each column has, of a file of arrays, which may be those of several devices; empty for a table.
    device : mapping
        Units, and why, that what wrote the log always has, where the form of the log says what that was.
    """

    path: Path
    names: Sequence[str]
    read: Callable[[Sequence[str], bool], Array]
    column: Callable[[str], pa.ChunkedArray]
    place: Callable[[int], str] = lambda row: f"row {row + 1}"
    named: bool = True
    notes: tuple[str, ...] = ()
    why: str = "the format's own order"
    above: tuple[str, ...] = ()
    whole: Mapping[tuple[str, ...], Array] = field(default_factory=dict)
    anew: dict[str, str] = field(default_factory=dict)
    rows: Mapping[str, int] = field(default_factory=dict)
    device: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def clock(self, name: str) -> tuple[Array, str | None]:
        """A column of time, and what it holds: ``"dates"`` and ``"times of day"`` are in seconds, None is bare numbers.

        A clock that unmistakably starts anew goes on (:mod:`truenorth.formats.wraps`).

        Raises
        ------
        DataError
            A cell that is neither.
        """
        time, said = self._clock(name)
        if said is None:
            time, anew = unwrapped(time)
            if anew is not None:
                self.anew[name] = anew
        return time, said

    def rows_of(self, keep: NDArray[np.intp], note: str) -> Columns:
        """Some of the rows, with a note that says why."""
        return replace(
            self,
            read=lambda names, gaps: self.read(names, gaps)[keep],
            column=lambda name: self.column(name).take(keep),
            place=lambda row: self.place(int(keep[row])),
            whole={},
            notes=(*self.notes, note),
        )

    def _clock(self, name: str) -> tuple[Array, str | None]:
        if (name,) in self.whole:
            return self.whole[name,], None
        import pyarrow as pa

        column = self.column(name)
        kind = column.type
        if column.null_count:
            row = next(i for i, valid in enumerate(column.is_valid().to_pylist()) if not valid)
            raise self._no_time(name, row)
        if pa.types.is_timestamp(kind):
            return _seconds(column, pa.timestamp("ns", kind.tz), 1e9), "dates"
        if pa.types.is_date(kind):
            return _seconds(column.cast(pa.timestamp("ns")), pa.timestamp("ns"), 1e9), "dates"
        if pa.types.is_time(kind):
            return _unwrapped(_seconds(column, pa.time64("ns"), 1e9)), "times of day"
        if pa.types.is_duration(kind):
            return _seconds(column, pa.duration("ns"), 1e9), "durations"
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            return self._text_clock(name, column.to_pylist())
        if pa.types.is_integer(kind) or pa.types.is_floating(kind):
            numbers = column if pa.types.is_float64(kind) else column.cast(pa.float64(), safe=False)
            return to_numpy([numbers])[:, 0], None
        return self.read([name], False)[:, 0], None  # which names the cell that is no number

    def _no_time(self, name: str, row: int) -> DataError:
        """The error for an empty cell of a clock, with the columns that seem to be clocks as well."""
        from truenorth.formats.names import clock_of

        source, place = self.path.name, self.place(row)
        others = [other for other in self.names if other != name and clock_of(other)[0]]
        if not others:
            return DataError(f"{source}: {place}, column {name}: empty; expected a time: remove such rows")
        return DataError(
            f"{source}: {place}, column {name}: empty; expected a time: remove such rows, or name another clock of {listed(others)}"
        )

    def _text_clock(self, name: str, cells: list[str]) -> tuple[Array, str | None]:
        import pandas as pd

        plain = pd.Series([cell.strip() for cell in cells])
        try:
            if is_date(cells[0]):
                return dates_of(plain)
            if ":" in cells[0]:
                time = pd.to_timedelta(plain.where(plain.str.count(":") == 2, "00:" + plain))
                return _unwrapped(
                    np.asarray(time.to_numpy("timedelta64[ns]").astype(np.int64) * 1e-9, dtype=np.float64)
                ), "times of day"
            if all(SECONDS.fullmatch(cell) for cell in plain):
                parts = [cell.split() for cell in plain]
                return np.array([float(number) * parse_unit(unit)[0] for number, unit in parts]), "durations"
        except (ValueError, OverflowError) as error:
            raise DataError(
                f"{self.path.name}: column {name}: not dates or times of one form ({error}); write ISO dates or seconds"
            ) from None
        return self.read([name], False)[:, 0], None  # which names the cell that is no number


def _seconds(column: pa.ChunkedArray, kind: Any, scale: float) -> Array:
    import pyarrow as pa

    whole = column.cast(kind).cast(pa.int64())
    counts = np.concatenate([np.asarray(chunk) for chunk in whole.chunks])
    return np.asarray(counts / scale, dtype=np.float64)


def _unwrapped(time: Array) -> Array:
    """Times of day that go on after midnight."""
    midnights = np.concatenate([[0.0], np.cumsum(np.diff(time) < -DAY / 2)])
    return np.asarray(time + DAY * midnights, dtype=np.float64)


def columns_of_arrays(path: Path, variables: Mapping[str, Any]) -> Columns:
    """Columns of named arrays."""
    parts: dict[str, Any] = {}
    whole: dict[tuple[str, ...], Array] = {}
    for name, value in variables.items():
        array = np.asarray(value)
        if array.dtype.kind not in "fiumM" or array.ndim > 2:
            continue
        if array.ndim == 0 or (array.ndim == 2 and 1 in array.shape):
            array = array.reshape(-1)
        if array.ndim == 2 and array.shape[0] < array.shape[1] and array.shape[0] <= 10:
            array = array.T  # MATLAB users keep time in either direction
        if array.ndim == 1:
            parts[name] = array
            names: tuple[str, ...] = (name,)
        elif array.shape[1] == 3 and name in OURS:
            names = tuple(f"{name}_{axis}" for axis in "xyz")
            parts |= {of: array[:, i] for i, of in enumerate(names)}
        else:
            names = tuple(f"{name}[{i}]" for i in range(array.shape[1]))
            parts |= {of: array[:, i] for i, of in enumerate(names)}
        if array.dtype == np.float64 and array.dtype.isnative and array.flags.c_contiguous:
            whole[names] = array

    def read(names: Sequence[str], gaps: bool = False) -> Array:
        if len({len(parts[name]) for name in names}) > 1:
            sizes = ", ".join(f"{name} {len(parts[name])}" for name in names)
            raise DataError(
                f"{path.name}: columns of different length ({sizes}); expected as many of each: name those of one sensor"
            )
        return np.column_stack([parts[name].astype(np.float64) for name in names])

    def column(name: str) -> pa.ChunkedArray:
        import pyarrow as pa

        part = parts[name]
        return pa.chunked_array([pa.array(part if part.dtype.kind in "mM" else part.astype(np.float64))])

    return Columns(path, list(parts), read, column, whole=whole, rows={name: len(part) for name, part in parts.items()})


def listed(names: Sequence[str]) -> str:
    """Names of a log's columns for a message: of many, and of long ones, the first part; what cannot be printed as ``?``."""
    shown = ["".join(c if c.isprintable() else "?" for c in name[:LONGEST_NAME]) for name in names[:MOST_NAMES]]
    return (", ".join(shown) or "(none)") + (f", ... ({len(names)} in all)" if len(names) > MOST_NAMES else "")


def missing_column(columns: Columns, ours: str, wanted: str) -> DataError:
    """The error for a column of ours that is not there under the name that is `wanted`, with the nearest name."""
    near = {name.lower(): name for name in columns.names}
    match = get_close_matches(wanted.lower(), near, n=1)
    hint = f"; is it {near[match[0]]!r}? Then columns: {{{ours}: {near[match[0]]}}}" if match else ""
    return DataError(f"{columns.path.name}: column {wanted!r} is missing; found {listed(columns.names)}{hint}")
