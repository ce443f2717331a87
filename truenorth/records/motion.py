"""Motion of an IMU at a set of times: attitude, velocity, position, rate and specific force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.records.poses import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionStates:
    """Motion at a set of times, any leading shape.

    Not a :class:`truenorth.state.track.Track`: what an IMU feels there, rate and force, comes with it, and nothing is estimated.

    Attributes
    ----------
    time : (...) array, s
    C_nb : (..., 3, 3) array
    v_n : (..., 3) array, m/s
    lat, lon, alt : (...) arrays, rad and m
    w_ib_b : (..., 3) array, rad/s
    f_b : (..., 3) array, m/s^2
    dw_ib_b : (..., 3) array, rad/s^2
        Angular acceleration.
    """

    time: Array
    C_nb: Array
    v_n: Array
    lat: Array
    lon: Array
    alt: Array
    w_ib_b: Array
    f_b: Array
    dw_ib_b: Array

    def trajectory(self) -> Trajectory:
        """Attitude, velocity and position as a record; times (N,)."""
        return Trajectory(self.time, self.C_nb, self.v_n, self.lat, self.lon, self.alt, "truth")


class Moving(Protocol):
    """Whatever an IMU can sit on: a motion, or an indexer on one."""

    @property
    def breaks(self) -> Array:
        """Times where a higher derivative jumps, s."""

    @property
    def shortest_period(self) -> float:
        """Of the fastest oscillation, s."""

    def states(self, t: ArrayLike) -> MotionStates:
        """The true motion of the IMU at any times (s)."""
