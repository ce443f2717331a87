"""What an undamped INS said, epoch by epoch, and the reference velocity with it: what all damping methods take."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.attitude import dcm_from_rotation_vector, misalignment
from truenorth.core.errors import DataError
from truenorth.errors.intervals import Intervals
from truenorth.errors.marine import DP, DV, PHI, MarineModel, position_in_angles
from truenorth.records.interpolation import Between

Array = NDArray[np.float64]
UNEVEN = 0.01  # share of the interval by which the time steps may differ


@dataclass(frozen=True)
class Course:
    """The output of a free inertial navigation with its height held, at even epochs.

    Attributes
    ----------
    time : (K+1,) array, s
    C_nb : (K+1, 3, 3) array
    v_n : (K+1, 3) array, m/s
    position : (K+1, 3) array
        Latitude, longitude (rad), height (m).

    Raises
    ------
    DataError
        Fewer than two epochs, or time steps that differ.
    """

    time: Array
    C_nb: Array
    v_n: Array
    position: Array

    def __post_init__(self) -> None:
        steps = np.diff(self.time)
        if len(steps) < 1:
            raise DataError(f"damping: {len(self.time)} epochs of navigation, expected two at least")
        odd = np.flatnonzero(np.abs(steps - np.median(steps)) > UNEVEN * np.median(steps))
        if odd.size:
            raise DataError(
                f"damping: a step of {steps[odd[0]]:.3f} s after {self.time[odd[0]]:.3f} s, all others are "
                f"{np.median(steps):.3f} s; expected even epochs"
            )

    @property
    def epochs(self) -> int:
        """K, after the first."""
        return len(self.time) - 1

    @cached_property
    def interval(self) -> float:
        """From epoch to epoch, s."""
        return float((self.time[-1] - self.time[0]) / self.epochs)

    def between(self, start: int, stop: int) -> Course:
        """The intervals `start` to `stop`, with the epoch before them."""
        part = slice(start, stop + 1)
        return Course(self.time[part], self.C_nb[part], self.v_n[part], self.position[part])

    def at(self, times: Array) -> tuple[Array, Array]:
        """``C_nb`` (M, 3, 3) and ``v_n`` (M, 3) between epochs: by constant turns, and by cubics through three epochs' slopes.

        Raises
        ------
        DataError
            A time outside the course.
        """
        between = Between(self.time, times, "damping")
        slopes = np.gradient(self.v_n, self.time, axis=0)
        v = [between.cubic(value, slope) for value, slope in zip(self.v_n.T, slopes.T, strict=True)]
        return between.slerp(self.C_nb), np.stack(v, axis=1)

    def place(self, time: float) -> tuple[float, float, float]:
        """Latitude, longitude (rad) and height (m) between epochs, on from the nearest by the mean velocity since."""
        k = int(np.argmin(np.abs(self.time - time)))
        lat, lon, alt = (float(x) for x in self.position[k])
        _, v = self.at(np.array([time]))
        east, north = 0.5 * (self.v_n[k, :2] + v[0, :2]) * (time - self.time[k])
        R_M, R_N = earth.radii(lat)
        return lat + north / (R_M + alt), lon + east / ((R_N + alt) * np.cos(lat)), alt

    def every(self, count: int) -> Course:
        """Each so many-th epoch, from the first on."""
        return Course(self.time[::count], self.C_nb[::count], self.v_n[::count], self.position[::count])

    def linearise(self, model: MarineModel) -> tuple[Array, Array]:
        """``F`` and ``Phi`` (K, n, n) of each interval, about the means of its ends.

        The specific force is what has changed the velocity: ``f = dv/dt + (2 w_ie + w_en) x v - g``.
        """
        v, C, position = (0.5 * (a[1:] + a[:-1]) for a in (self.v_n, self.C_nb, self.position))
        lat, alt = position[:, 0], position[:, 2]
        w = 2.0 * earth.earth_rate_n(lat) + earth.transport_rate_n(lat, alt, v)
        f = np.diff(self.v_n, axis=0) / self.interval + np.cross(w, v) - earth.gravity_n(lat, alt)
        return model.linearise(Intervals(np.full(self.epochs, self.interval), C, f, v, lat, alt))

    def corrected(self, x: Array) -> Course:
        """The course with errors (K+1, 7) or (7,) taken off, in the model's states (metres for position)."""
        lat, _, alt = self.position.T
        R_M, R_N = earth.radii(lat)
        position, v_n = self.position.copy(), self.v_n.copy()
        v_n[:, :2] -= x[..., DV]
        position[:, 0] -= x[..., DP.start + 1] / (R_M + alt)
        position[:, 1] -= x[..., DP.start] / ((R_N + alt) * np.cos(lat))
        C_nb = dcm_from_rotation_vector(x[..., PHI]) @ self.C_nb
        return Course(self.time, C_nb, v_n, position)

    def in_angles(self, p: Array) -> Array:
        """Errors of latitude and longitude (..., K+1, 2) rad, of a position error east, north (..., K+1, 2) m."""
        return position_in_angles(p, self.position[:, 0], self.position[:, 2])


def errors_of(course: Course, truth: Course) -> Array:
    """(K+1, 7) errors of attitude, velocity and position (m) of a course against the true one, in the model's states."""
    dv = course.v_n[:, :2] - truth.v_n[:, :2]
    lat, lon, alt = truth.position.T
    R_M, R_N = earth.radii(lat)
    away = (course.position[:, 1] - lon + np.pi) % (2.0 * np.pi) - np.pi
    dp = np.stack([away * (R_N + alt) * np.cos(lat), (course.position[:, 0] - lat) * (R_M + alt)], axis=1)
    phi = misalignment(course.C_nb, truth.C_nb)
    return np.concatenate([phi, dv, dp], axis=1)
