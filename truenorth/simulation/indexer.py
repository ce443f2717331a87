"""Indexer (rotation mechanism): the IMU turns in the body about one axis or more, so that its biases average out.

An axis stands in its parent frame, the outermost in the body; all axes meet in the centre of the IMU, where the motion's
lever arm ends. With ``R = exp(angle [axis x])`` from the child frame of an axis to its parent, from the outermost inwards

    w  <- R' w + angle' axis
    dw <- R' dw + angle'' axis - angle' axis x (R' w)
    f  <- R' f,   C <- C R

``C_bs`` is the product of the R; in elementary frame rotations ``C_sb = Rx(angle 2) Rz(angle 1)`` for the axes z and x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.errors import UsageError
from truenorth.core.indexing import DIRECTIONS, axis_rotation, chained
from truenorth.records.motion import MotionStates, Moving
from truenorth.simulation.axis_angles import Turning

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Axis:
    """One axis of an indexer.

    Attributes
    ----------
    direction : {"x", "y", "z"}
        In its parent frame, as designed.
    angle : Spin, Swing, Steps
        Over time, counter-clockwise about the direction.
    tilt : (3,) floats, rad
        Rotation vector from the designed to the real direction: non-orthogonality of the axes.
    """

    direction: str
    angle: Turning
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.direction not in DIRECTIONS:
            raise UsageError(f"axis {self.direction!r} of an indexer; expected one of x, y and z")

    @cached_property
    def real_direction(self) -> Array:
        """(3,) unit vector in the parent frame."""
        return dcm_from_rotation_vector(self.tilt) @ np.array(DIRECTIONS[self.direction])


@dataclass(frozen=True)
class Indexer:
    """A rotation mechanism.

    Attributes
    ----------
    axes : tuple of Axis
        The outermost first.
    """

    axes: tuple[Axis, ...]

    def __post_init__(self) -> None:
        if not self.axes:
            raise UsageError("an indexer without axes; expected one at least")

    def angles(self, t: ArrayLike) -> Array:
        """(..., A) true angles of the axes at times `t` (s), rad."""
        t = np.asarray(t, dtype=np.float64)
        return np.stack([axis.angle(t)[0] for axis in self.axes], axis=-1)

    def C_bs(self, t: ArrayLike) -> Array:
        """(..., 3, 3) true attitude of the IMU in the body."""
        return chained([axis.real_direction for axis in self.axes], self.angles(t))


@dataclass(frozen=True)
class Indexed:
    """An indexer on a motion: the motion of its innermost frame, s."""

    motion: Moving  # of the body
    indexer: Indexer

    @cached_property
    def breaks(self) -> Array:
        """Those of the motion and of all axes."""
        return np.unique(np.concatenate([self.motion.breaks, *(axis.angle.breaks for axis in self.indexer.axes)]))

    @property
    def shortest_period(self) -> float:
        """Of the motion, or of one turn of all axes together."""
        rate = sum(axis.angle.peak_rate for axis in self.indexer.axes)
        return min(self.motion.shortest_period, 2 * math.pi / rate if rate > 0 else math.inf)

    def states(self, t: ArrayLike) -> MotionStates:
        """True motion of the IMU: ``C_nb, w_ib_b, f_b, dw_ib_b`` of the result are ``C_ns, w_is_s, f_s, dw_is_s``.

        Those of the body are ``motion.states(t)``.
        """
        body = self.motion.states(t)
        C, w, dw, f = body.C_nb, body.w_ib_b, body.dw_ib_b, body.f_b
        for axis in self.indexer.axes:
            angle, rate, acceleration = (x[..., None] for x in axis.angle(body.time))
            e = axis.real_direction
            R = axis_rotation(e, angle[..., 0])
            w, dw, f = (_turned_back(R, x) for x in (w, dw, f))
            dw = dw + acceleration * e - rate * np.cross(e, w)
            w = w + rate * e
            C = C @ R
        return MotionStates(body.time, C, body.v_n, body.lat, body.lon, body.alt, w, f, dw)


def _turned_back(R: Array, x: Array) -> Array:
    return np.einsum("...ji,...j->...i", R, x)
