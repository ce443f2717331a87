"""Attitude, velocity and position between the samples of a trajectory, and rates between those of a log."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.records.imu import ImuRecord

Array = NDArray[np.float64]
ROUNDING = 1e-9  # of the interval: times this little outside the span are its ends


class Between:
    """Where times lie between samples.

    Parameters
    ----------
    time : (N,) array, s
        Of the samples.
    times : (M,) array, s
    source : str

    Raises
    ------
    DataError
        A time outside the span of the samples.
    """

    def __init__(self, time: Array, times: ArrayLike, source: str) -> None:
        wanted = np.atleast_1d(np.asarray(times, dtype=np.float64))
        slack = ROUNDING * float(np.median(np.diff(time)))
        bad = np.flatnonzero(~((wanted >= time[0] - slack) & (wanted <= time[-1] + slack)))
        if bad.size:
            raise DataError(
                f"{source}: nothing at {wanted[bad[0]]:.6f} s; it runs from {time[0]:.6f} s to {time[-1]:.6f} s: ask for "
                "times inside, or check that both logs have the same clock"
            )
        self.times = np.clip(wanted, time[0], time[-1])
        self.row = np.clip(np.searchsorted(time, self.times, "right") - 1, 0, len(time) - 2)
        self.step = time[self.row + 1] - time[self.row]
        self.part = (self.times - time[self.row]) / self.step

    def linear(self, values: Array, period: float | None = None) -> Array:
        """(M, ...) of (N, ...), exact at the samples; what repeats after a `period` goes the short way round."""
        s = self.part.reshape(-1, *[1] * (values.ndim - 1))
        left, right = self._ends(values, period)
        return (1.0 - s) * left + s * right

    def cubic(self, values: Array, slopes: Array, period: float | None = None) -> Array:
        """(M,) of (N,) values and their derivatives by time: Hermite's cubic."""
        s, h = self.part, self.step
        left, right = self._ends(values, period)
        rise = right - left
        bend = (1 - s) * (h * slopes[self.row] - rise) - s * (h * slopes[self.row + 1] - rise)
        return (1 - s) * left + s * right + s * (1 - s) * bend

    def slerp(self, C: Array) -> Array:
        """(M, 3, 3) of (N, 3, 3) direction cosines: one turn at constant rate about one axis between two samples."""
        from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm

        start = C[self.row]
        turn = rotation_vector_from_dcm(np.swapaxes(start, -1, -2) @ C[self.row + 1])
        return start @ dcm_from_rotation_vector(self.part[:, None] * turn)

    def _ends(self, values: Array, period: float | None) -> tuple[Array, Array]:
        left, right = values[self.row], values[self.row + 1]
        return left, right if period is None else right + period * np.round((left - right) / period)


def held_at_ends(time: Array, values: Array, times: Array) -> Array:
    """(M, m) of (N, m) values at other times, along straight lines; beyond the ends the first and the last."""
    return np.stack([np.interp(times, time, column) for column in values.T], axis=1)


def gyros_behind(record: ImuRecord, late: float) -> ImuRecord:
    """The record with its gyros late by so many seconds, parts of a row too."""
    return replace(record, gyro=held_at_ends(record.time, record.gyro, record.time - late))


def interpolated(record: Any, times: ArrayLike) -> dict[str, Any]:
    """The arrays of a record of poses at other times, by name; what it does not hold stays None.

    Attitude by slerp, velocity and rates linearly; position by cubics that keep the velocity where there is one, else linearly.

    Raises
    ------
    DataError
        A time outside the record.
    """
    at = Between(record.time, times, record.source)
    result: dict[str, Any] = {"time": at.times}
    for name in record.groups():
        values = getattr(record, name)
        if values is None:
            result[name] = None
        elif name == "C_nb":
            result[name] = at.slerp(values)
        elif name not in ("lat", "lon", "alt"):
            result[name] = at.linear(values)
    if record.lat is None:
        return result | {"lat": None, "lon": None, "alt": None}
    if record.v_n is None:
        lon = at.linear(record.lon, 2 * np.pi)
        return result | {"lat": at.linear(record.lat), "lon": lon, "alt": at.linear(record.alt)}
    R_M, R_N = radii(record.lat)
    east, north, up = record.v_n.T
    return result | {
        "lat": at.cubic(record.lat, north / (R_M + record.alt)),
        "lon": at.cubic(record.lon, east / ((R_N + record.alt) * np.cos(record.lat)), 2 * np.pi),
        "alt": at.cubic(record.alt, up),
    }
