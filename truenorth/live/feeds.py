"""Feeds of the usual sensors: GNSS, odometer, velocity log, barometer."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Barometer, Gnss, Odometer, VelocityLog
from truenorth.core.position import Position, eastward
from truenorth.live.feed import Feed, or_none, table
from truenorth.records import GnssRecord, HeightRecord, OdometerRecord, VelocityRecord
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]

FIXED = 5  # fixes whose median says where a vehicle began
FAR, FAR_SIGMAS = 10.0, 5.0  # m, and sigmas of a fix: so far from there it has moved


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
        first = float(fixes[0, 1])
        fixes[:, 1] = eastward(fixes[:, 1], first)  # fixes of one place lie on both sides of the date line
        lat, lon, alt = np.median(np.nan_to_num(fixes), axis=0)
        return Position(float(lat), math.remainder(first + float(lon), 2.0 * math.pi), float(alt), 10.0, 20.0)

    @staticmethod
    def _metres(rows: Array) -> Array:
        """(K, 2) north and east of the first fix."""
        known = rows[np.isfinite(rows[:, 1:3]).all(axis=1)]
        first = float(known[0, 2]) if len(known) else 0.0
        scale = 6.371e6  # metres to a radian, about: moved or not
        return np.column_stack([rows[:, 1] * scale, eastward(rows[:, 2], first) * scale * np.cos(rows[:, 1])])

    def fresh(self, rows: Array) -> Array:
        """See :class:`Feed`: fixes with place and velocity of the row before, to the last digit, as noise never has them.

        A receiver that holds its fix where the vehicle stands says that it does.
        """
        fix = rows[:, 1:7]
        same = ((fix[1:] == fix[:-1]) | (np.isnan(fix[1:]) & np.isnan(fix[:-1]))).all(axis=1) & np.isfinite(fix[1:, 0])
        if not same.any():
            return rows
        stands = (fix[1:, 3:5] == 0.0).all(axis=1)
        return rows[np.concatenate([[True], ~same | stands])]

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
