"""Attitude of an IMU on an indexer (a rotation mechanism) from the angles of its axes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import rotation_vector_from_dcm, skew

Array = NDArray[np.float64]

DIRECTIONS = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def C_bs_from_angles(axes: Sequence[str], angles: ArrayLike) -> Array:
    """Attitude of the IMU in the body as an encoder tells it, (..., 3, 3).

    Parameters
    ----------
    axes : sequence of {"x", "y", "z"}
        As designed, the outermost first.
    angles : (..., A) array, rad

    Returns
    -------
    (..., 3, 3) array
    """
    return chained([np.array(DIRECTIONS[axis]) for axis in axes], np.asarray(angles, dtype=np.float64))


def chained(directions: Sequence[Array], angles: Array) -> Array:
    """Product of the rotations about `directions`, the outermost first, by `angles` (..., A) rad; (..., 3, 3)."""
    C = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for i, direction in enumerate(directions):
        C = C @ axis_rotation(direction, angles[..., i])
    return C


def axis_rotation(axis: Array, angle: Array) -> Array:
    """``exp(angle [axis x])``, (..., 3, 3)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle)[..., None, None] * K + (1.0 - np.cos(angle))[..., None, None] * (K @ K)


def indexer_turns(C_sb: Array) -> Array:
    """Rotation vector (K, 3) of the IMU in the body from each epoch to the next, the IMU's axes, rad.

    Parameters
    ----------
    C_sb : (K+1, 3, 3) array
        Attitude of the body in the IMU.
    """
    return rotation_vector_from_dcm(C_sb[:-1] @ np.swapaxes(C_sb[1:], 1, 2))
