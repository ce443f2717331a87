"""What a feed is: rows of an aiding sensor as they come.

A feed keeps them in order. It gives them as the aid that :func:`truenorth.align` and :func:`truenorth.navigate` take, and, a part
at a time, as measurements for the closed loop.
"""

from __future__ import annotations

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Aid
from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]
Rows = Callable[[list[Aiding]], list[Aiding]]

READING = threading.Lock()  # two threads may ask for rows at once

MOST_ROWS = 200_000
STEP = 2520  # rows by which the window of new measurements moves: an odometer is averaged in blocks, mostly of 1 to 10 rows
LARGEST = 1e8  # SI units: beyond what any of these sensors measures
FEW, OTHER_CLOCK = 5, 86400.0  # rows from which on, and s from their median beyond which, a row is of another clock
MOVES = 1.0  # m/s: faster than an antenna on a swaying mast
LASTING = 3  # rows in a line
OFTEN = 4.0  # rows a second: errors that last are seen in as many
APART = ("clock.ahead", "clock.behind", "clock.gps_or_utc")  # evidence that rows were moved by whole seconds


class Feed(ABC):
    """Rows ``time, columns`` of one sensor in ascending time, SI units and radians; see its `push`.

    Parameters
    ----------
    mounting : Mounting, optional
        How the sensor sits; the usual one of the procedure when left out.
    """

    key: ClassVar[str]
    columns: ClassVar[tuple[str, ...]]
    says: ClassVar[tuple[str, ...]] = ()  # attributes that say what the columns mean
    navigates: ClassVar[bool] = True  # whether it aids navigation, too
    offset: float = 0.0  # s, added to the time of each row: by so much its clock is behind the IMU's

    def __init__(self, mounting: Mounting | None = None) -> None:
        self.mounting = mounting
        self.reading: dict[str, Any] = {}  # options of the reader of such logs
        self.left_out = 0  # rows without a finite time, without any number, that cannot be, repeated, of another clock
        self.failure = ""  # of the last rows that could not be read
        self.clear()

    def clear(self) -> None:
        """Forget all rows."""
        self.thinned = 1  # rows of the source in a row of ours
        self._rows = np.empty((0, 1 + len(self.columns)))
        self._waiting: list[Array] = []

    @abstractmethod
    def rows_of(self, record: Any) -> Array:
        """A whole record as rows; what its rows mean is then what those of the feed mean."""

    @abstractmethod
    def aid_of(self, rows: Array) -> Aid:
        """These rows as an aid."""

    def speed_of(self, rows: Array) -> Array:
        """(K,) speed that a row says, m/s; NaN where it says none, as of a sensor that says nothing of motion."""
        return np.full(len(rows), np.nan)

    @property
    def meaning(self) -> dict[str, Any]:
        """What the columns mean."""
        return {name: getattr(self, name) for name in self.says}

    def dummy(self) -> Array:
        """Two rows in which every number is there: what this sensor may measure."""
        return np.column_stack([[0.0, 1.0], np.full((2, len(self.columns)), 1e-3)])

    @property
    def rows(self) -> Array:
        """(N, 1 + columns) all rows so far."""
        with READING:
            return self._read()

    def _read(self) -> Array:
        """All rows so far, those that wait among them."""
        waiting, self._waiting = self._waiting, []  # another thread may add
        if waiting:
            new = np.vstack(waiting)
            new[:, 0] += self.offset  # here, not where they come: another thread may bring one while the clock is found
            rows = np.vstack([self._rows, new])
            _, first = np.unique(rows[:, 0], return_index=True)
            self._rows = rows[first]
            if len(self._rows) >= FEW:
                away = np.abs(self._rows[:, 0] - np.median(self._rows[:, 0]))
                self._rows = self._rows[away < OTHER_CLOCK]
            self.left_out += len(rows) - len(self._rows)
            if len(self._rows) > MOST_ROWS:
                self._rows, self.thinned = self.halved(self._rows), 2 * self.thinned
        return self._rows

    def continued(self, rows: Array) -> Array:
        """Rows that were read for themselves, as those that go on from the rows so far."""
        return rows

    def halved(self, rows: Array) -> Array:
        """Half as many rows that say the same, as far as they can."""
        return rows[1::2]

    def add(self, rows: Array) -> None:
        """Take rows ``time, columns`` in, any order; those that cannot be are counted and left out."""
        finite = np.where(np.isfinite(rows), rows, np.nan)
        with np.errstate(invalid="ignore"):
            sound = np.isfinite(rows[:, 0]) & np.isfinite(rows[:, 1:]).any(axis=1)
            sound &= ~(np.abs(finite[:, 1:]) > LARGEST).any(axis=1)
        found = finite[sound]
        if not self._can_be(found):
            found = found[[self._can_be(found[row : row + 1]) for row in range(len(found))]]
        self.left_out += len(rows) - len(found)
        self._waiting.append(found)

    def shift(self, offset: float) -> None:
        """Add this to the time of all rows, s, and of those that come."""
        rows = self.rows.copy()
        rows[:, 0] += offset
        self._rows, self.offset = rows, self.offset + offset

    def _can_be(self, rows: Array) -> bool:
        """Whether a record takes these numbers, next to some that are sound; there may be columns of which they say nothing."""
        sound = self.dummy()
        for absent in (np.zeros(rows.shape[1], dtype=bool), np.isnan(rows).all(axis=0)):
            sound[:, absent] = np.nan
            both = np.vstack([sound, rows])
            both[:, 0] = np.arange(len(both))
            try:
                self.aid_of(both)
            except DataError:
                continue
            return True
        return False

    def fresh(self, rows: Array) -> Array:
        """These rows (N, 1 + columns) without those that are the row before, written again; each by the rows before it alone."""
        return rows

    def looked_at(self, until: float, mounting: Mounting | None = None) -> Aid | None:
        """The rows up to a time as an aid in which errors that last are sought, `OFTEN` a second at most; None: fewer than two."""
        rows = self.fresh(self.rows[: int(np.searchsorted(self.rows[:, 0], until, side="right"))])
        while len(rows) > 1 and len(rows) > OFTEN * max(rows[-1, 0] - rows[0, 0], 1.0):
            rows = self.halved(rows)
        return self._mounted(rows.copy(), mounting) if len(rows) > 1 else None

    def until(self, until: float, mounting: Mounting | None = None) -> Aid | None:
        """The rows up to a time as an aid; None where there are fewer than two."""
        last = int(np.searchsorted(self.rows[:, 0], until, side="right"))
        return self._mounted(self.rows[:last].copy(), mounting) if last > 1 else None

    def newest(self, count: int, mounting: Mounting | None = None, found: Mounting | None = None) -> Aid | None:
        """So many of the newest rows as an aid; None where there are fewer than two."""
        return self._mounted(self.rows[-count:].copy(), mounting, found) if len(self.rows) > 1 else None

    def moves_from(self) -> float | None:
        """Time from which the vehicle moves, s; None as long as it stays."""
        if len(self.rows) < LASTING:
            return None
        with np.errstate(invalid="ignore"):
            fast = self.speed_of(self.rows) > MOVES
        lasting = np.convolve(fast, np.ones(LASTING), "valid") == LASTING
        return float(self.rows[int(np.argmax(lasting)), 0]) if lasting.any() else None

    @property
    def moves_now(self) -> bool:
        """Whether the newest row says that the vehicle moves; that it lasts, only more rows say."""
        return len(self.rows) > 0 and bool(self.speed_of(self.rows)[-1] > MOVES)

    def sources(self, altitude: str, mounting: Mounting | None, found: Mounting | None = None) -> list[Aiding]:
        """The measurements that may come, none of them there yet.

        `mounting` stands for one that is not given, `found` for whatever is given.
        """
        _ = self.rows  # those that wait say what may come
        sources = self._mounted(self.dummy(), mounting, found).sources(altitude)
        return [replace(source, **_rows_of(source, np.zeros(0, np.intp))) for source in sources]

    def _mounted(self, rows: Array, mounting: Mounting | None, found: Mounting | None = None) -> Any:
        aid: Any = self.aid_of(rows)
        known = found or (mounting if self.mounting is None else None)
        return aid if known is None else aid.mounted(known)

    def measurements(
        self,
        altitude: str,
        mounting: Mounting | None,
        sent: dict[str, float],
        since: float,
        until: float = math.inf,
        found: Mounting | None = None,
        shown: Rows = list,
    ) -> list[Aiding]:
        """Measurements that were not given away before.

        Parameters
        ----------
        altitude : str
            How height is kept.
        mounting : Mounting or None
            Where none is given.
        sent : dict
            Time of the last measurement of each source that was given away; changed.
        since : float, s
            Measurements up to this time are never given away.
        until : float, s
            Nor are, as yet, those after this one.
        found : Mounting, optional
            Whatever is given.
        shown : callable
            What the measurements, with those before them, are with errors that were not said of them.

        Raises
        ------
        DataError
            Rows that cannot be.
        """
        rows = self.rows
        late = 0.0 if found is None or not len(rows) else float(found.late_at(rows[-1, 0]))
        oldest = int(np.searchsorted(rows[:, 0], min(sent.values(), default=since) + late))
        first = max(0, oldest // STEP - 1) * STEP
        if len(rows) - first < 2 or rows[-1, 0] - late <= min(sent.values(), default=since):
            return []
        measured = []
        window = self.fresh(rows[first:])
        if len(window) < 2:
            return []
        for source in shown(self._mounted(window.copy(), mounting, found).sources(altitude)):
            new = np.flatnonzero((source.time > sent.get(source.name, since)) & (source.time <= until))
            if new.size:
                sent[source.name] = float(source.time[new].max())
                measured.append(replace(source, **_rows_of(source, new)))
        return measured


def shift_as(found: Any, feeds: Mapping[str, Feed]) -> None:
    """Move the rows of those feeds whose clock an answer, with its `evidence`, has found to be apart, as its own were moved."""
    for item in found.evidence:
        if item.key in APART and item.figures.get("sensor") in feeds:
            feeds[str(item.figures["sensor"])].shift(float(item.figures["offset"]))


def _rows_of(source: Aiding, rows: NDArray[np.intp]) -> dict[str, Any]:
    return {"time": source.time[rows], "measured": source.measured[rows], "sigma": source.sigma[rows]}


def table(time: ArrayLike, *values: tuple[ArrayLike | None, int]) -> Array:
    """Rows ``time, values``: each with its number of columns; None is absent."""
    times = np.atleast_1d(np.asarray(time, dtype=np.float64))
    parts = [
        np.full((len(times), width), np.nan)
        if value is None
        else np.asarray(value, np.float64).reshape(len(times), width)
        for value, width in values
    ]
    return np.column_stack([times, *parts])


def or_none(values: Array) -> Array | None:
    """None where no number is there."""
    return values if np.isfinite(values).any() else None
