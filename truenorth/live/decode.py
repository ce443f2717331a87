"""Bytes to rows: CSV lines with the documented columns, fixed binary rows, or the messages of a device."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import body_axes
from truenorth.core.errors import DataError
from truenorth.formats.layout import Layout, unit_factor
from truenorth.formats.names import clock_of, heading_of
from truenorth.live.binary_rows import BinaryRows
from truenorth.live.log import Kind
from truenorth.live.messages import LONGEST_LINE, Messages, protocol_of
from truenorth.records import COLUMNS

Array = NDArray[np.float64]

BARE = ("time", *COLUMNS["rates"])


@dataclass(frozen=True)
class _Columns:
    """Where the seven numbers stand in a line, and what they are multiplied by."""

    kind: Kind
    at: tuple[int, ...]
    factor: Array
    timed: bool
    width: int


class Decoder:
    """Bytes of one source, in chunks of any size, to rows ``time, gyro (3), accel (3)`` in SI units and RFU axes.

    Parameters
    ----------
    layout : Layout
        Names of columns, units and axes, as for a file.
    source : str
        Messages begin with it.
    now : callable
        Arrival time, s, of rows that carry none.
    by_arrival : bool
        Time is that of arrival, whatever the rows say.

    Attributes
    ----------
    broken : int
        Lines or binary rows that could not be read.
    kind : {"rates", "increments"}
    """

    def __init__(
        self, layout: Layout, source: str, now: Callable[[], float] = clock.monotonic, *, by_arrival: bool = False
    ) -> None:
        self._layout, self._source, self._now, self._by_arrival = layout, source, now, by_arrival
        self.others: list[Callable[[bytes], None]] = []  # sensors whose messages stand in the same stream
        self._messages: Messages | None = None
        self._half = b""
        self._binary = BinaryRows()
        self._columns: _Columns | None = None
        self._given_turn = np.eye(3) if layout.axes is None else body_axes(layout.axes)
        self._turn = self._given_turn
        self._broken = 0
        self.arrival_time = False

    @property
    def broken(self) -> int:
        """See above; what stands between binary rows may be another sensor's."""
        return self._broken + (self._binary.damaged if self.others else self._binary.stretches)

    @property
    def kind(self) -> Kind:
        """What a row is; rates until a header says otherwise."""
        return self._layout.kind or ("rates" if self._columns is None else self._columns.kind)

    def feed(self, data: bytes) -> Array:
        """(K, 7) the rows that are whole now.

        Raises
        ------
        DataError
            A header that lacks a column, or text that is no header.
        """
        for other in self.others:
            other(data)
        rows: Sequence[Sequence[float]]
        rows, data = self._binary.feed(data)
        if self._binary.seen and self._messages is not None:  # those that came first are another sensor's
            self._messages, self._columns, self._turn = None, None, self._given_turn
        decided = self._binary.seen or self._columns is not None or self._messages is not None
        protocol = None if decided else protocol_of(self._half + data)
        if protocol is not None:
            data, self._half = self._half + data + self._binary.given_back(), b""
            self._messages = Messages(protocol, self._source)
            self._turn = body_axes(self._layout.axes or self._messages.module.AXES)
        if self._messages is not None:
            result = self._table(self._messages.feed(data, "imu").get("imu", {}))
        else:
            if not self._binary.seen:
                self._half += data
                rows = self._text()
            result = np.array(rows, dtype=np.float64).reshape(-1, 7)
        if self._by_arrival and len(result):
            self.arrival_time = True
            result[:, 0] += self._now() - result[-1, 0]
        with np.errstate(invalid="ignore", over="ignore"):  # what is not finite is counted where rows are taken in
            result[:, 1:4] = result[:, 1:4] @ self._turn.T
            result[:, 4:] = result[:, 4:] @ self._turn.T
        return result

    def _table(self, table: dict[str, Array]) -> Array:
        """A device's table: headings with their units."""
        if not table:
            return np.empty((0, 7))
        if self._columns is None:
            self._columns = self._from_header(list(table))
        values = np.column_stack(list(table.values()))
        return np.ascontiguousarray(values[:, self._columns.at] * self._columns.factor)

    def _text(self) -> list[list[float]]:
        *lines, self._half = self._half.split(b"\n")
        if len(self._half) > LONGEST_LINE:
            raise DataError(
                f"{self._source}: {len(self._half)} bytes without the end of a line; expected CSV lines or binary rows"
            )
        found = (self._line(line.decode("utf-8", "replace").strip()) for line in lines)
        return [row for row in found if row is not None]

    def _line(self, line: str) -> list[float] | None:
        if not line or line[0] in "#$/":  # comments, and NMEA sentences in between
            return None
        if not (line.isascii() and line.isprintable()):
            self._broken += 1
            return None
        cells = [cell.strip() for cell in line.split("," if "," in line else ";" if ";" in line else None)]
        try:
            numbers = [float(cell) if cell else np.nan for cell in cells]
        except ValueError:
            if self._columns is None:
                self._columns = self._from_header(cells)
            else:
                self._broken += 1
            return None
        if self._columns is None:
            self._columns = self._without_header(len(numbers))
        columns = self._columns
        if len(numbers) != columns.width:
            self._broken += 1
            return None
        values = [numbers[i] * factor for i, factor in zip(columns.at, columns.factor)]
        return values if columns.timed else [self._now(), *values]

    def _from_header(self, names: list[str]) -> _Columns:
        """Where the seven numbers stand: by the caller's names, by ours, or by what a heading means."""
        at: dict[str, int] = {}
        sign = np.ones(len(names))
        theirs = {text: ours for ours, text in self._layout.columns.items()}
        units = dict(self._layout.units)
        for i, name in enumerate(names):
            ours = theirs.get(name) or theirs.get(f"-{name}") or name
            sign[i] = -1.0 if f"-{name}" in theirs else 1.0
            if ours not in ("time", *COLUMNS["rates"], *COLUMNS["increments"]):
                heading, (is_clock, clock_unit) = heading_of(name), clock_of(name)
                if heading is not None:
                    ours = f"{heading.sensor}_{heading.axis}"
                    sensor = "gyro" if heading.sensor in ("gyro", "dtheta") else "accel"
                    self._say_unit(units, sensor, heading.unit, name)
                elif is_clock:
                    ours = "time"
                    self._say_unit(units, "time", clock_unit or "s", name)
            at.setdefault(ours, i)
        kind: Kind = "increments" if "dtheta_x" in at else "rates"
        missing = [ours for ours in COLUMNS[kind] if ours not in at]
        if missing:
            raise DataError(
                f"{self._source}: the header {', '.join(names)} has no column {missing[0]}; expected {', '.join(BARE)}, or the "
                "names of the columns"
            )
        wanted = ["time"] * ("time" in at) + list(COLUMNS[kind])
        places = [at[ours] for ours in wanted]
        return self._scaled(self._layout.kind or kind, places, "time" in at, len(names), units, sign[places])

    def _say_unit(self, units: dict[str, str], key: str, unit: str | None, name: str) -> None:
        """Take over a heading's unit where the caller has named none.

        Raises
        ------
        DataError
            Neither says one, and the name is not ours, which would mean SI.
        """
        if key not in units and unit is None:
            raise DataError(f"{self._source}: column {name!r} names no unit; say it, such as deg/s,g")
        units.setdefault(key, unit or "")

    def _without_header(self, count: int) -> _Columns:
        if count not in (6, 7):
            raise DataError(
                f"{self._source}: the first line holds {count} numbers and no names; expected a header, or {', '.join(BARE)} "
                "(or the six without time)"
            )
        kind, units = self._layout.kind or "rates", dict(self._layout.units)
        return self._scaled(kind, list(range(count)), count == 7, count, units, np.ones(count))

    def _scaled(
        self, kind: Kind, at: list[int], timed: bool, width: int, units: dict[str, str], sign: Array
    ) -> _Columns:
        self.arrival_time = not timed
        layout = replace(self._layout, units=units)
        factors = [unit_factor("time", kind, layout)] * timed
        factors += [unit_factor(sensor, kind, layout) for sensor in ("gyro",) * 3 + ("accel",) * 3]
        return _Columns(kind, tuple(at), np.array(factors) * sign, timed, width)
