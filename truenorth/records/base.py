"""What all records share: their checks, windows of time, clock offsets, tables."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.core.remembered import remembered
from truenorth.core.shown import as_xarray
from truenorth.records.lost_rows import lost_before

if TYPE_CHECKING:
    import pandas as pd
    import xarray

Array = NDArray[np.float64]
LATEST = 1e20  # s: more than any clock counts, were it nanoseconds of our era


class Late(NamedTuple):
    """Rows that stood in a log after rows of later times, and were put in order when it was read.

    Attributes
    ----------
    rows : int
    longest : float, s
        By which the latest of them stood behind.
    """

    rows: int = 0
    longest: float = 0.0


IN_ORDER = Late()


class Guess(NamedTuple):
    """One thing that a log did not say, and what a reader took it for.

    Attributes
    ----------
    what : str
        Such as ``unit of the gyros``.
    value : str
        What it was taken for.
    why : str
        The evidence, in words.
    probability : float
        Of this reading among all that were thought of; 1 where the log or the caller says so.
    option : mapping
        The reader's option that says the same.
    """

    what: str
    value: str
    why: str
    probability: float = 1.0
    option: Mapping[str, Any] = {}  # never written to


@dataclass(frozen=True)
class _Ordered:
    """What a reader did to the order of the rows: a field of all records, and by name alone."""

    late: Late = field(default=IN_ORDER, compare=False, kw_only=True)


class Record(_Ordered):
    """Measurements over time: a frozen dataclass with ``time`` (N,), ``source``, and arrays of N rows.

    Kinds of record say what the columns of each array are called (`GROUPS`, or :meth:`groups` where it depends on the record),
    which arrays may be left out (`OPTIONAL`) and which may hold NaN for what is absent in a row (`PARTIAL`). Every record takes
    ``late``, the rows that a reader put in order.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]]
    OPTIONAL: ClassVar[frozenset[str]] = frozenset()
    PARTIAL: ClassVar[frozenset[str]] = frozenset()

    time: Array
    source: str

    def groups(self) -> Mapping[str, Sequence[str]]:
        """Arrays of the record, each with the names of its columns: one means (N,), three (N, 3), nine (N, 3, 3)."""
        return self.GROUPS

    def __post_init__(self) -> None:
        groups = {name: columns for name, columns in self.groups().items() if self._holds(name)}
        for name in ("time", *groups):
            object.__setattr__(self, name, _own(getattr(self, name), name, self.source))
        _check_shapes(self, groups)
        _check_time(self.time, self.source)
        for name, columns in groups.items():
            self._check_numbers(name, columns)

    def _check_numbers(self, name: str, columns: Sequence[str]) -> None:
        """Refuse an array whose numbers cannot be."""
        _check_finite(getattr(self, name), columns, self.source, name in self.PARTIAL)

    def _holds(self, name: str) -> bool:
        """Whether an array is there."""
        return name not in self.OPTIONAL or getattr(self, name) is not None

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        held = ", ".join(name for name in self.groups() if self._holds(name))
        span = f"{len(self)} rows, {self.time[0]:.10g} to {self.time[-1]:.10g} s, {self.rate:.4g} Hz"
        return f"{type(self).__name__}({self.source}: {span}; {held})"

    @cached_property
    def interval(self) -> float:
        """Nominal sampling interval, s: the median step."""
        return _median_step(self.time)

    @property
    def rate(self) -> float:
        """Nominal sampling rate, Hz."""
        return 1.0 / self.interval

    @property
    def duration(self) -> float:
        """Length of the record, s, the interval of the first row included."""
        return float(self.time[-1] - self.time[0]) + self.interval

    @cached_property
    def steps(self) -> Array:
        """(N,) length of the interval that ends at each row, s; the first row's is the nominal one."""
        return _steps(self.time)

    @cached_property
    def gaps(self) -> NDArray[np.intp]:
        """Rows that follow a gap: rows are missing in their step (:mod:`~truenorth.records.lost_rows`)."""
        return _gaps(self.time)

    def between(self, start: float | None = None, stop: float | None = None) -> Self:
        """Rows with ``start <= time <= stop``, as a record of its own; the record itself where that is all.

        Raises
        ------
        DataError
            The window holds fewer than two rows.
        """
        first = 0 if start is None else int(np.searchsorted(self.time, start, "left"))
        last = len(self) if stop is None else int(np.searchsorted(self.time, stop, "right"))
        if last - first < 2:
            begin, end = self.time[0], self.time[-1]
            wanted = begin if start is None else start, end if stop is None else stop
            raise DataError(
                f"{self.source}: fewer than two samples from {wanted[0]:.12g} s to {wanted[1]:.12g} s; the record runs from "
                f"{begin:.12g} s to {end:.12g} s, choose a window inside it"
            )
        return self[first:last]

    def __getitem__(self, rows: slice) -> Self:
        if rows.indices(len(self)) == (0, len(self), 1):
            return self  # it is checked already
        names = ("time", *(name for name in self.groups() if self._holds(name)))
        return self._with(**{name: getattr(self, name)[rows] for name in names})

    def shifted(self, offset: float) -> Self:
        """The same measurements with `offset` (s) added to their times: for logs of two clocks."""
        return self._with(time=self.time + offset)

    def _with(self, **changes: Any) -> Self:
        return replace(self, **changes)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was put right when the log was read, in words."""
        if not self.late.rows:
            return ()
        rows, longest = self.late
        were = "1 row stood" if rows == 1 else f"{rows} rows stood"
        return (f"{self.source}: {were} after rows of later times, by up to {longest:.3g} s: put in order",)

    def columns(self) -> dict[str, Array]:
        """The documented columns of tables and files by name, in their units (SI but for angles, which are in deg)."""
        table: dict[str, Array] = {}
        for name, columns in self.groups().items():
            if self._holds(name):
                values = getattr(self, name).reshape(len(self), -1)
                table |= {column: values[:, i] for i, column in enumerate(columns)}
        return table

    def to_frame(self) -> pd.DataFrame:
        """A pandas table with index ``time`` and the documented columns."""
        import pandas as pd

        return pd.DataFrame(self.columns(), pd.Index(self.time, name="time"))

    def to_xarray(self) -> xarray.Dataset:
        """The table of `to_frame` as an xarray data set.

        Raises
        ------
        UsageError
            xarray is not installed.
        """
        return as_xarray(self.to_frame())


@remembered
def _median_step(time: Array) -> float:
    """The same for records that share their time, such as the runs of a campaign."""
    steps = time[1:] - time[:-1]
    before, behind = (len(steps) - 1) // 2, len(steps) // 2
    steps.partition((before, behind))  # the median of NumPy, to the bit, which loads its masked arrays
    return float(0.5 * (steps[before] + steps[behind]))


@remembered
def _steps(time: Array) -> Array:
    """The same, nobody writes to it."""
    steps = np.empty(len(time))
    steps[0] = _median_step(time)
    np.subtract(time[1:], time[:-1], out=steps[1:])
    return steps


@remembered
def _gaps(time: Array) -> NDArray[np.intp]:
    """The same, nobody writes to it."""
    return lost_before(time, _median_step(time))


@remembered
def _increases(time: Array) -> bool:
    """Whether times are finite and increase; the same."""
    return bool(np.isfinite(time).all() and (time[1:] > time[:-1]).all())


def _own(given: Any, name: str, source: str) -> Array:
    """An array as the record keeps it: of doubles, contiguous, never written to; a masked value is NaN, a date in seconds.

    Raises
    ------
    DataError
        No numbers.
    """
    values: Any = given
    masked = sys.modules.get("numpy.ma")  # where nobody has loaded it there are no masked arrays
    if masked is not None and isinstance(given, masked.MaskedArray) and given.dtype.kind in "fiu":
        values = masked.filled(given.astype(np.float64), np.nan)
    kind = getattr(getattr(values, "dtype", None), "kind", "")
    if kind in "mM" and kind:
        if name != "time" or np.isnat(values).any():
            raise DataError(f"{source}: {name} holds {values.dtype}; expected numbers, or dates in time alone")
        values = values.astype(f"{values.dtype.str[:2]}8[ns]").astype(np.int64) * 1e-9
    try:
        if kind == "c":
            raise TypeError
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        what = f"an array of {values.dtype}" if kind else type(given).__name__
        raise DataError(f"{source}: {name} is {what}; expected an array of numbers") from None
    if array.flags.writeable:
        if isinstance(given, np.ndarray) and np.may_share_memory(array, given):
            array = array.copy()  # what the caller writes later is not the record's
        array.flags.writeable = False
    return array


def check_range(record: Record, name: str, low: float, high: float, advice: str) -> None:
    """Refuse what lies outside ``low <= value <= high``; NaN passes.

    Raises
    ------
    DataError
        With source, row and column.
    """
    if getattr(record, name) is None:
        return
    columns = record.groups()[name]
    values = getattr(record, name).reshape(len(record), -1)
    bad = np.argwhere((values < low) | (values > high))
    if bad.size:
        row, i = bad[0]
        raise DataError(
            f"{record.source}: row {row + 1}, column {columns[i]}: {values[row, i]:g}; expected {low:g} to {high:g}: {advice}"
        )


def check_positive(record: Record, *names: str) -> None:
    """Refuse standard deviations that are zero or negative; NaN, which says that none is known, passes.

    Raises
    ------
    DataError
        With source, row and column.
    """
    for name in names:
        if getattr(record, name) is None:
            continue
        values = getattr(record, name).reshape(len(record), -1)
        bad = np.argwhere(values <= 0.0)
        if bad.size:
            row, i = bad[0]
            raise DataError(
                f"{record.source}: row {row + 1}, column {record.groups()[name][i]}: {values[row, i]:g}; expected a standard "
                "deviation above zero, or NaN where none is known"
            )


def check_together(record: Record, *names: str) -> None:
    """Refuse a record that has some of these arrays and not the others.

    Raises
    ------
    DataError
        It names both.
    """
    missing = [name for name in names if getattr(record, name) is None]
    if missing and len(missing) < len(names):
        there = ", ".join(name for name in names if name not in missing)
        raise DataError(f"{record.source}: {there} without {', '.join(missing)}; expected all of them or none")


def _check_shapes(record: Record, groups: Mapping[str, Sequence[str]]) -> None:
    inner = {"time": (), **{name: _inner(columns) for name, columns in groups.items()}}
    shapes = {name: getattr(record, name).shape for name in inner}
    rows = shapes["time"][0] if len(shapes["time"]) == 1 else -1
    if rows < 0 or any(shapes[name] != (rows, *shape) for name, shape in inner.items()):
        wanted = [f"(N{''.join(f', {n}' for n in shape)}{'' if shape else ','})" for shape in inner.values()]
        raise DataError(
            f"{record.source}: {_listed(inner)} have the shapes {_listed(map(str, shapes.values()))}; expected {_listed(wanted)}"
        )
    if rows < 2:
        raise DataError(f"{record.source}: {rows} sample(s); at least 2 are needed")


def _inner(columns: Sequence[str]) -> tuple[int, ...]:
    """Shape of one row of an array with these columns."""
    return {1: (), 9: (3, 3)}.get(len(columns), (len(columns),))


def _listed(items: Any) -> str:
    *first, last = items
    return f"{', '.join(first)} and {last}" if first else str(last)


def first_disorder(time: Array) -> tuple[int, str] | None:
    """The first row whose time does not increase, and what it does; None where there is none."""
    bad = np.flatnonzero(np.diff(time) <= 0)
    if not bad.size:
        return None
    k = int(bad[0]) + 1
    return k, "repeats" if time[k] == time[k - 1] else "goes back"


def _check_time(time: Array, source: str) -> None:
    if _increases(time):
        k = int(abs(time[0]) <= abs(time[-1])) * (len(time) - 1)
        if abs(time[k]) > LATEST:
            raise DataError(
                f"{source}: row {k + 1}, column time: {time[k]:g}; expected seconds, {LATEST:g} at most: convert the clock's "
                "unit, or repair the row"
            )
        return
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise DataError(f"{source}: row {bad[0] + 1}, column time: {time[bad[0]]}; expected a finite number")
    if (found := first_disorder(time)) is not None:
        k, what = found
        raise DataError(
            f"{source}: row {k + 1}, column time: time {what} ({time[k - 1]:.6f} s, then {time[k]:.6f} s); expected "
            "strictly increasing seconds: sort the log or drop the repeated rows"
        )


def _check_finite(values: Array, columns: Sequence[str], source: str, partial: bool) -> None:
    if np.isfinite(values.sum()):  # one pass; a NaN or inf anywhere survives the sum
        return
    values = values.reshape(len(values), -1)
    bad = np.argwhere(np.isinf(values) if partial else ~np.isfinite(values))
    if bad.size:
        row, i = bad[0]
        wanted = "a finite number, or NaN where there is none" if partial else "a finite number"
        raise DataError(
            f"{source}: row {row + 1}, column {columns[i]}: {values[row, i]}; expected {wanted}: remove the row or repair "
            "the log"
        )
