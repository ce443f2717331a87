"""Records of attitude, velocity and position: a trajectory (truth or solution), and a master INS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError
from truenorth.records.base import Record, check_positive, check_together
from truenorth.records.gnss import PLACE, check_place, in_degrees
from truenorth.records.interpolation import interpolated
from truenorth.records.lost_rows import GAP_FACTOR

Array = NDArray[np.float64]
ORTHONORMAL = 1e-6  # farthest that C C' may be from the unit matrix
NINE = tuple(f"C_nb[{i},{j}]" for i in range(3) for j in range(3))


class Poses(Record):
    """What a trajectory and a master share."""

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = PLACE | {"v_n": ("VE", "VN", "VU"), "C_nb": NINE}

    C_nb: Array | None
    v_n: Array | None
    lat: Array | None
    lon: Array | None
    alt: Array | None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_together(self, "lat", "lon", "alt")
        check_place(self)
        if self.C_nb is not None:
            _check_rotations(self.C_nb, self.source)

    @classmethod
    def from_quaternions(cls, time: ArrayLike, q_nb: ArrayLike, **others: Any) -> Self:
        """A record whose attitude is given as unit quaternions (N, 4), scalar first, ``v_n = q_nb v_b q_nb*``.

        Raises
        ------
        DataError
            As for the record; a quaternion whose norm is not 1 within 1e-6.
        """
        from truenorth.core.attitude import dcm_from_quaternion

        q = np.asarray(q_nb, dtype=np.float64)
        source = others.get("source", "quaternions")
        if q.ndim != 2 or q.shape[1] != 4:
            raise DataError(f"{source}: quaternions have the shape {q.shape}; expected (N, 4), scalar first")
        norm = np.linalg.norm(q, axis=1)
        bad = np.flatnonzero(~(np.abs(norm - 1.0) < ORTHONORMAL))
        if bad.size:
            raise DataError(
                f"{source}: row {bad[0] + 1}: a quaternion of norm {norm[bad[0]]:.9g}; expected 1 within {ORTHONORMAL:g}"
            )
        values = {"time": np.asarray(time), "C_nb": dcm_from_quaternion(q / norm[:, None]), **others}
        return cls(**values)

    def at(self, times: ArrayLike) -> Self:
        """The record at other times: attitude by slerp, the rest as :func:`interpolated` says.

        Parameters
        ----------
        times : (M,) array, s
            Two at least, increasing, within the record.

        Raises
        ------
        DataError
            A time outside the record.
        """
        return self._with(**interpolated(self, times))

    def covers(self, times: ArrayLike, longest: float | None = None) -> NDArray[np.bool_]:
        """Whether each time lies within the record and in no gap of it.

        Parameters
        ----------
        times : (M,) array, s
        longest : float, optional
            Distance of two samples, s, beyond which there is a gap between them; 1.5 nominal intervals when left out.

        Returns
        -------
        (M,) array of bool
        """
        longest = GAP_FACTOR * self.interval if longest is None else longest
        t = np.asarray(times, dtype=np.float64)
        after = np.clip(np.searchsorted(self.time, t, "left"), 1, len(self) - 1)
        whole = self.time[after] - self.time[after - 1] <= longest
        return (
            (t >= self.time[0]) & (t <= self.time[-1]) & (whole | (t == self.time[after]) | (t == self.time[after - 1]))
        )

    def columns(self) -> dict[str, Array]:
        """Latitude, longitude, roll, pitch and heading in degrees; the rest in SI."""
        table = in_degrees({name: values for name, values in super().columns().items() if name not in NINE})
        if self.C_nb is None:
            return table
        from truenorth.core.attitude import euler_from_dcm

        heading, pitch, roll = (np.degrees(x) for x in euler_from_dcm(self.C_nb))
        return table | {"roll": roll, "pitch": pitch, "heading": np.mod(heading, 360.0)}


@dataclass(frozen=True, repr=False)
class Trajectory(Poses):
    """Attitude, velocity and position over time: the truth, or a solution.

    Parameters
    ----------
    time : (N,) array, s
    C_nb : (N, 3, 3) array
    v_n : (N, 3) array, m/s
        East, north, up.
    lat, lon, alt : (N,) arrays, rad and m
    source : str

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; degrees for radians, or matrices that are no rotations.
    """

    time: Array
    C_nb: Array
    v_n: Array
    lat: Array
    lon: Array
    alt: Array
    source: str = field(default="trajectory", compare=False)


@dataclass(frozen=True, repr=False)
class MasterRecord(Poses):
    """The solution of another INS on the same vehicle, in its own axes and on its own clock.

    Rows that dropped out are simply not there.

    Parameters
    ----------
    time : (N,) array, s
    C_nb : (N, 3, 3) array or None
        Attitude of the *master's* body axes.
    v_n : (N, 3) array or None, m/s
    lat, lon, alt : (N,) arrays or None, rad and m
    w_ib_b : (N, 3) array or None, rad/s
        Rates of the master's own gyros, in its axes.
    f_b : (N, 3) array or None, m/s^2
        Specific force of the master's own accelerometers, in its axes.
    attitude_sigma : (N, 3) array or None, rad
        One-sigma errors of heading, pitch and roll by the master's own filter, NaN where not known.
    velocity_sigma : (N, 3) array or None, m/s
        The same of velocity, east, north, up.
    source : str

    Raises
    ------
    DataError
        As for :class:`Trajectory`; neither attitude nor velocity, a part of a position, or a sigma that is not positive.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {
        **Poses.GROUPS,
        "w_ib_b": ("gyro_x", "gyro_y", "gyro_z"),
        "f_b": ("accel_x", "accel_y", "accel_z"),
        "attitude_sigma": ("sigma_heading", "sigma_pitch", "sigma_roll"),
        "velocity_sigma": ("sigma_VE", "sigma_VN", "sigma_VU"),
    }
    OPTIONAL: ClassVar[frozenset[str]] = frozenset(
        {"C_nb", "v_n", "lat", "lon", "alt", "w_ib_b", "f_b", "attitude_sigma", "velocity_sigma"}
    )
    PARTIAL: ClassVar[frozenset[str]] = frozenset({"attitude_sigma", "velocity_sigma"})

    time: Array
    C_nb: Array | None = None
    v_n: Array | None = None
    lat: Array | None = None
    lon: Array | None = None
    alt: Array | None = None
    w_ib_b: Array | None = None
    f_b: Array | None = None
    attitude_sigma: Array | None = None
    velocity_sigma: Array | None = None
    source: str = field(default="master record", compare=False)

    def __post_init__(self) -> None:
        if self.C_nb is None and self.v_n is None:
            raise DataError(f"{self.source}: neither attitude nor velocity; expected at least one to align against")
        super().__post_init__()
        check_positive(self, "attitude_sigma", "velocity_sigma")


def _check_rotations(C: Array, source: str) -> None:
    error = np.abs(C @ np.swapaxes(C, 1, 2) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((error > ORTHONORMAL) | (np.linalg.det(C) < 0.0))
    if bad.size:
        raise DataError(
            f"{source}: row {bad[0] + 1}: C_nb is no rotation (C C' differs from the unit matrix by {error[bad[0]]:.2g}, its "
            f"determinant is {np.linalg.det(C[bad[0]]):.3g}); expected a right-handed orthonormal matrix"
        )
