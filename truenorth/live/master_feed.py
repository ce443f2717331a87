"""Rows of a master INS as they come: its solution aligns the IMU against it, and then leaves navigation to itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Master
from truenorth.live.feed import Feed, or_none, table
from truenorth.records import MasterRecord
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]


class MasterFeed(Feed):
    """The solution of a master INS on the same vehicle: attitude, velocity, place, whatever it gives.

    It says no speed: its word is taken at rest and under way alike, so that its motion does not decide how to align.

    Parameters
    ----------
    mounting : Mounting, optional
    errors : {"navigation", "tactical"}, optional
        The master's own slow errors, see :class:`truenorth.Master`.
    """

    key = "master"
    navigates = False
    columns = (
        "C_11", "C_12", "C_13", "C_21", "C_22", "C_23", "C_31", "C_32", "C_33", "VE", "VN", "VU", "lat", "lon", "alt",
        "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z",
        "sigma_heading", "sigma_pitch", "sigma_roll", "sigma_VE", "sigma_VN", "sigma_VU",
    )  # fmt: skip

    def __init__(self, mounting: Mounting | None = None, errors: str | None = None) -> None:
        super().__init__(mounting)
        self.errors = errors

    def push(
        self,
        time: ArrayLike,
        C_nb: ArrayLike | None = None,
        v_n: ArrayLike | None = None,
        *,
        lat: ArrayLike | None = None,
        lon: ArrayLike | None = None,
        alt: ArrayLike | None = None,
        w_ib_b: ArrayLike | None = None,
        f_b: ArrayLike | None = None,
        attitude_sigma: ArrayLike | None = None,
        velocity_sigma: ArrayLike | None = None,
    ) -> None:
        """Take rows in, see :class:`truenorth.MasterRecord`."""
        place = [(value, 1) for value in (lat, lon, alt)]
        sensors = ((w_ib_b, 3), (f_b, 3), (attitude_sigma, 3), (velocity_sigma, 3))
        self.add(table(time, (C_nb, 9), (v_n, 3), *place, *sensors))

    def rows_of(self, record: MasterRecord) -> Array:
        """See :class:`Feed`."""
        place = [(value, 1) for value in (record.lat, record.lon, record.alt)]
        sensors = ((record.w_ib_b, 3), (record.f_b, 3), (record.attitude_sigma, 3), (record.velocity_sigma, 3))
        return table(record.time, (record.C_nb, 9), (record.v_n, 3), *place, *sensors)

    def aid_of(self, rows: Array) -> Any:
        """See :class:`Feed`."""
        parts = (or_none(part) for part in np.split(rows[:, 1:], (9, 12, 15, 18, 21, 24), axis=1))
        C_nb, v_n, place, w, f, attitude_sigma, velocity_sigma = parts
        lat, lon, alt = (None,) * 3 if place is None else np.ascontiguousarray(place.T)
        attitude = None if C_nb is None else C_nb.reshape(-1, 3, 3)
        record = MasterRecord(
            rows[:, 0], attitude, v_n, lat, lon, alt, w, f, attitude_sigma, velocity_sigma, "live master"
        )
        return Master(record, self.mounting, errors=self.errors)

    def dummy(self) -> Array:
        """No turn."""
        rows = super().dummy()
        rows[:, 1:10] = np.eye(3).ravel()
        return rows
