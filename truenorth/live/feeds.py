"""Rows of aiding sensors as they come: GNSS, odometer, velocity log, barometer.

A feed keeps them in order. It gives them as the aid that :func:`truenorth.align` and :func:`truenorth.navigate` take, and, a part
at a time, as measurements for the closed loop.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Aid, Barometer, Gnss, Odometer, VelocityLog
from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.records import GnssRecord, HeightRecord, OdometerRecord, VelocityRecord
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]

MOST_ROWS = 200_000
STEP = 2520  # rows by which the window of new measurements moves: an odometer is averaged in blocks, mostly of 1 to 10 rows
LARGEST = 1e8  # SI units: beyond what any of these sensors measures
FEW, OTHER_CLOCK = 5, 86400.0  # rows from which on, and s from their median beyond which, a row is of another clock
FIXED = 5  # fixes whose median says where a vehicle began
FAR, FAR_SIGMAS = 10.0, 5.0  # m, and sigmas of a fix: so far from there it has moved
MOVES = 1.0  # m/s: faster than an antenna on a swaying mast
LASTING = 3  # rows in a line


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

    @abstractmethod
    def speed_of(self, rows: Array) -> Array:
        """(K,) speed that a row says, m/s; NaN where it says none."""

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
        waiting, self._waiting = self._waiting, []  # another thread may add
        if waiting:
            rows = np.vstack([self._rows, *waiting])
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

    def until(self, until: float, mounting: Mounting | None = None) -> Aid | None:
        """The rows up to a time as an aid; None where there are fewer than two."""
        last = int(np.searchsorted(self.rows[:, 0], until, side="right"))
        return self._mounted(self.rows[:last].copy(), mounting) if last > 1 else None

    def moves_from(self) -> float | None:
        """Time from which the vehicle moves, s; None as long as it stays."""
        if len(self.rows) < LASTING:
            return None
        with np.errstate(invalid="ignore"):
            fast = self.speed_of(self.rows) > MOVES
        lasting = np.convolve(fast, np.ones(LASTING), "valid") == LASTING
        return float(self.rows[int(np.argmax(lasting)), 0]) if lasting.any() else None

    def sources(self, altitude: str, mounting: Mounting | None) -> list[Aiding]:
        """The measurements that may come, none of them there yet; `mounting` stands for one that is not given."""
        _ = self.rows  # those that wait say what may come
        found = self._mounted(self.dummy(), mounting).sources(altitude)
        return [replace(source, **_rows_of(source, np.zeros(0, np.intp))) for source in found]

    def _mounted(self, rows: Array, mounting: Mounting | None) -> Any:
        aid: Any = self.aid_of(rows)
        return aid if mounting is None or self.mounting is not None else aid.mounted(mounting)

    def measurements(
        self, altitude: str, mounting: Mounting | None, sent: dict[str, float], since: float
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

        Raises
        ------
        DataError
            Rows that cannot be.
        """
        rows = self.rows
        oldest = int(np.searchsorted(rows[:, 0], min(sent.values(), default=since)))
        first = max(0, oldest // STEP - 1) * STEP
        if len(rows) - first < 2 or rows[-1, 0] <= max(sent.values(), default=since):
            return []
        found = []
        for source in self._mounted(rows[first:].copy(), mounting).sources(altitude):
            new = np.flatnonzero(source.time > sent.get(source.name, since))
            if new.size:
                sent[source.name] = float(source.time[new].max())
                found.append(replace(source, **_rows_of(source, new)))
        return found


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


class GnssFeed(Feed):
    """A GNSS receiver."""

    key = "gnss"
    columns = (
        "lat", "lon", "alt", "VE", "VN", "VU", "sigma_E", "sigma_N", "sigma_U", "sigma_VE", "sigma_VN", "sigma_VU", "hdop", "vdop",
        "quality", "heading", "sigma_heading",
    )  # fmt: skip

    def push(
        self,
        time: ArrayLike,
        lat: ArrayLike | None = None,
        lon: ArrayLike | None = None,
        alt: ArrayLike | None = None,
        *,
        v_n: ArrayLike | None = None,
        position_sigma: ArrayLike | None = None,
        velocity_sigma: ArrayLike | None = None,
        dop: ArrayLike | None = None,
        quality: ArrayLike | None = None,
        heading: ArrayLike | None = None,
        heading_sigma: ArrayLike | None = None,
    ) -> None:
        """Take fixes in, see :class:`truenorth.GnssRecord`: radians, metres, east, north, up."""
        place = [(value, 1) for value in (lat, lon, alt)]
        rest = [
            (v_n, 3),
            (position_sigma, 3),
            (velocity_sigma, 3),
            (dop, 2),
            (quality, 1),
            (heading, 1),
            (heading_sigma, 1),
        ]
        self.add(table(time, *place, *rest))

    def rows_of(self, record: GnssRecord) -> Array:
        """See :class:`Feed`."""
        place = [(value, 1) for value in (record.lat, record.lon, record.alt)]
        rest = [
            (record.v_n, 3),
            (record.position_sigma, 3),
            (record.velocity_sigma, 3),
            (record.dop, 2),
            (record.quality, 1),
            (record.heading, 1),
            (record.heading_sigma, 1),
        ]
        return table(record.time, *place, *rest)

    def aid_of(self, rows: Array) -> Gnss:
        """See :class:`Feed`."""
        t = rows.T
        sigma, velocity_sigma, dop = (
            or_none(np.ascontiguousarray(rows[:, at : at + n])) for at, n in ((7, 3), (10, 3), (13, 2))
        )
        v_n = or_none(np.ascontiguousarray(rows[:, 4:7]))
        quality, heading, heading_sigma = (or_none(t[at]) for at in (15, 16, 17))
        record = GnssRecord(
            t[0], t[1], t[2], t[3], v_n, sigma, velocity_sigma, dop, quality, heading, heading_sigma, "live GNSS"
        )
        return Gnss(record, self.mounting)

    def speed_of(self, rows: Array) -> Array:
        """Of the velocity; without one, by how far the place is from the first fixes."""
        speed = np.hypot(rows[:, 4], rows[:, 5])
        place = self._metres(rows)
        fixes = place[np.isfinite(place[:, 0])]
        if len(fixes) <= FIXED:
            return speed
        sigma = np.fmax(np.hypot(rows[:, 7], rows[:, 8]), 1.0)
        away = np.hypot(*(place - np.median(fixes[:FIXED], axis=0)).T) > FAR + FAR_SIGMAS * sigma
        return np.where(np.isfinite(speed), speed, np.where(away, np.inf, 0.0))

    @property
    def place(self) -> Position | None:
        """Of a vehicle that stays: the median of its fixes."""
        fixes = self.rows[np.isfinite(self.rows[:, 1:3]).all(axis=1), 1:4]
        if not len(fixes):
            return None
        lat, lon, alt = np.median(np.nan_to_num(fixes), axis=0)
        return Position(float(lat), float(lon), float(alt), 10.0, 20.0)

    @staticmethod
    def _metres(rows: Array) -> Array:
        scale = 6.371e6  # metres to a radian, about: moved or not
        return np.column_stack([rows[:, 1] * scale, rows[:, 2] * scale * np.cos(rows[:, 1])])

    def dummy(self) -> Array:
        """Positions and velocities of a vehicle at rest; headings where some have come."""
        rows = super().dummy()
        rows[:, 4:7] = 0.0
        rows[:, 7:16] = 1.0
        rows[:, 16:] = 1.0 if np.isfinite(self._rows[:, 16]).any() else np.nan
        return rows


class OdometerFeed(Feed):
    """A wheel that counts.

    Parameters
    ----------
    kind, pulse_size, signed
        See :class:`truenorth.OdometerRecord`.
    mounting : Mounting, optional
    """

    key = "odometer"
    columns = ("values",)
    says = ("kind", "pulse_size", "signed")

    def __init__(
        self,
        kind: Literal["distance", "pulses", "speed"] = "speed",
        pulse_size: float | None = None,
        *,
        signed: bool = True,
        mounting: Mounting | None = None,
    ) -> None:
        super().__init__(mounting)
        self.kind, self.pulse_size, self.signed = kind, pulse_size, signed

    def push(self, time: ArrayLike, values: ArrayLike) -> None:
        """Take rows in: of the interval that ends at each time, or speeds."""
        self.add(table(time, (values, 1)))

    def rows_of(self, record: OdometerRecord) -> Array:
        """See :class:`Feed`."""
        self.kind, self.pulse_size, self.signed = record.kind, record.pulse_size, record.signed
        return table(record.time, (record.values, 1))

    def aid_of(self, rows: Array) -> Odometer:
        """See :class:`Feed`."""
        t = rows.T
        return Odometer(
            OdometerRecord(t[0], t[1], self.kind, self.pulse_size, self.signed, source="live odometer"), self.mounting
        )

    def speed_of(self, rows: Array) -> Array:
        """See :class:`Feed`."""
        return np.abs(self.aid_of(rows).record.speed) if len(rows) > 1 else np.zeros(len(rows))

    def halved(self, rows: Array) -> Array:
        """Counts of two intervals are added."""
        if self.kind == "speed":
            return super().halved(rows)
        whole = rows[len(rows) % 2 :]
        return np.column_stack([whole[1::2, 0], whole[::2, 1] + whole[1::2, 1]])


class VelocityFeed(Feed):
    """A Doppler or electromagnetic log, or any reference velocity.

    Parameters
    ----------
    frame : {"body", "navigation"}
    mounting : Mounting, optional
    """

    key = "velocity"
    columns = ("v_1", "v_2", "v_3", "sigma_1", "sigma_2", "sigma_3")
    says = ("frame",)

    def __init__(self, frame: Literal["body", "navigation"] = "body", *, mounting: Mounting | None = None) -> None:
        super().__init__(mounting)
        self.frame = frame

    def push(self, time: ArrayLike, velocity: ArrayLike, sigma: ArrayLike | None = None) -> None:
        """Take rows in: right, forward, up, or east, north, up; NaN where an axis is not measured."""
        self.add(table(time, (velocity, 3), (sigma, 3)))

    def rows_of(self, record: VelocityRecord) -> Array:
        """See :class:`Feed`."""
        self.frame = record.frame
        return table(record.time, (record.velocity, 3), (record.sigma, 3))

    def aid_of(self, rows: Array) -> VelocityLog:
        """See :class:`Feed`."""
        velocity, sigma = (np.ascontiguousarray(rows[:, at : at + 3]) for at in (1, 4))
        return VelocityLog(
            VelocityRecord(rows[:, 0], velocity, self.frame, or_none(sigma), "live velocity"), self.mounting
        )

    def speed_of(self, rows: Array) -> Array:
        """See :class:`Feed`."""
        return np.sqrt(np.nansum(rows[:, 1:3] ** 2, axis=1))


class HeightFeed(Feed):
    """A barometer."""

    key = "baro"
    columns = ("alt", "sigma_U")

    def push(self, time: ArrayLike, alt: ArrayLike, sigma: ArrayLike | None = None) -> None:
        """Take heights in, m."""
        self.add(table(time, (alt, 1), (sigma, 1)))

    def rows_of(self, record: HeightRecord) -> Array:
        """See :class:`Feed`."""
        return table(record.time, (record.alt, 1), (record.sigma, 1))

    def aid_of(self, rows: Array) -> Barometer:
        """See :class:`Feed`."""
        return Barometer(HeightRecord(rows[:, 0], rows[:, 1], or_none(rows[:, 2]), "live barometer"), self.mounting)

    def speed_of(self, rows: Array) -> Array:
        """Says nothing of motion."""
        return np.full(len(rows), np.nan)
