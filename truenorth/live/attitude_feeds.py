"""Sensors of attitude as they come: a magnetometer, and the attitude of another system. They aid on the move and in navigation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.attitude import Attitude
from truenorth.aiding.magnetometer import HARD, SEAT, SOFT, Magnetometer
from truenorth.live.feed import Feed, table
from truenorth.records import MasterRecord
from truenorth.records.magnetometer import MagnetometerRecord
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]


class MagnetometerFeed(Feed):
    """A magnetometer of three axes.

    Parameters
    ----------
    field : (3,) array, T
        Of the earth at the place, east, north, up; see :func:`truenorth.earth_field`.
    hard_iron, soft_iron : float
        One sigma of the vehicle's iron, relative to the field.
    mounting : Mounting, optional
        Left out: its seat is known to half a degree.
    axes : str, optional
        Where x, y and z point, of rows that are read from bytes or a file, such as ``"FRD"``.
    """

    key = "magnetometer"
    columns = ("mag_x", "mag_y", "mag_z")

    def __init__(
        self,
        field: ArrayLike,
        *,
        hard_iron: float = HARD,
        soft_iron: float = SOFT,
        mounting: Mounting | None = None,
        axes: str | None = None,
    ) -> None:
        super().__init__(mounting)
        self.field = np.asarray(field, dtype=np.float64)
        self.hard_iron, self.soft_iron = hard_iron, soft_iron
        self.reading = {"axes": axes}

    def push(self, time: ArrayLike, field: ArrayLike) -> None:
        """Take rows in, T: right, forward, up in the sensor's axes."""
        self.add(table(time, (field, 3)))

    def rows_of(self, record: MagnetometerRecord) -> Array:
        """See :class:`Feed`."""
        return table(record.time, (record.field, 3))

    def aid_of(self, rows: Array) -> Magnetometer:
        """See :class:`Feed`."""
        whole = rows[np.isfinite(rows).all(axis=1)]
        record = MagnetometerRecord(whole[:, 0], np.ascontiguousarray(whole[:, 1:]), "live magnetometer")
        return Magnetometer(
            record,
            self.field,
            hard_iron=self.hard_iron,
            soft_iron=self.soft_iron,
            mounting=self.mounting or Mounting(angle_sigma=SEAT),
        )

    def dummy(self) -> Array:
        """The earth's field."""
        return np.column_stack([[0.0, 1.0], np.tile(self.field, (2, 1))])


class AttitudeFeed(Feed):
    """The attitude of another system: an AHRS, a star tracker, another INS.

    Parameters
    ----------
    noise, slow, slow_time, mounting
        See :class:`truenorth.Attitude`.
    """

    key = "attitude"
    columns = ("C_11", "C_12", "C_13", "C_21", "C_22", "C_23", "C_31", "C_32", "C_33")

    def __init__(
        self, noise: float, slow: float = 0.0, slow_time: float = 300.0, *, mounting: Mounting | None = None
    ) -> None:
        super().__init__(mounting)
        self.noise, self.slow, self.slow_time = noise, slow, slow_time

    def push(self, time: ArrayLike, C_nb: ArrayLike) -> None:
        """Take attitudes of the sensor's axes in, (3, 3) or (K, 3, 3)."""
        self.add(table(time, (C_nb, 9)))

    def rows_of(self, record: MasterRecord) -> Array:
        """See :class:`Feed`."""
        return table(record.time, (record.C_nb, 9))

    def aid_of(self, rows: Array) -> Attitude:
        """See :class:`Feed`."""
        record = MasterRecord(rows[:, 0], rows[:, 1:].reshape(-1, 3, 3), source="live attitude")
        return Attitude(record, self.noise, self.slow, self.slow_time, self.mounting or Mounting())

    def dummy(self) -> Any:
        """No turn."""
        return np.column_stack([[0.0, 1.0], np.tile(np.eye(3).ravel(), (2, 1))])
