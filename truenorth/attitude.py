"""Attitude: rotation vectors, quaternions, direction cosines and Euler angles, in the library's conventions.

``C_nb`` turns body into navigation axes, ``v_n = C_nb @ v_b``; n is ENU, b is RFU, and
``C_nb = Rz(-heading) Rx(pitch) Ry(roll)``. Quaternions are Hamilton's, scalar first.
"""

from __future__ import annotations

import math
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.compiled import compiled
from truenorth.errors import UsageError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SMALL_ANGLE_SQUARED = 1e-4  # below .01 rad the series to the fourth power is exact to rounding
DIRECTIONS = {
    "R": (1, 0, 0),
    "L": (-1, 0, 0),
    "F": (0, 1, 0),
    "B": (0, -1, 0),
    "U": (0, 0, 1),
    "D": (0, 0, -1),
}


def skew(v: ArrayLike) -> Array:
    """``[v x]``, (..., 3, 3) of (..., 3): ``skew(a) @ b = a x b``."""
    v = np.asarray(v, dtype=np.float64)
    S = np.zeros((*v.shape, 3))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    S[..., 1, 0], S[..., 2, 0], S[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return S


def dcm_from_rotation_vector(rotation: ArrayLike) -> Array:
    """``exp([rotation x])``, (..., 3, 3) of (..., 3) rad (Rodrigues)."""
    v = np.asarray(rotation, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    S = skew(v)
    # np.sinc(x) = sin(pi x)/(pi x) has its limit at 0 built in.
    return np.eye(3) + np.sinc(angle / np.pi) * S + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (S @ S)


def rotation_vector_from_dcm(C: ArrayLike) -> Array:
    """Rotation vector (..., 3), rad, of at most pi, of a direction cosine matrix (..., 3, 3)."""
    return rotation_vector_from_quaternion(quaternion_from_dcm(C))


def rotation_vector_from_quaternion(q: ArrayLike) -> Array:
    """Rotation vector (..., 3), rad, of at most pi, of a unit quaternion (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    half = np.arctan2(sine, q[..., :1])
    scale = np.where(sine > 1e-12, 2 * half / np.maximum(sine, 1e-12), 2.0)
    return scale * q[..., 1:]


def quaternion_from_dcm(C: ArrayLike) -> Array:
    """Unit quaternion (w, x, y, z) with w >= 0 of (..., 3, 3).

    The largest of the four squared components is found first, so that no difference of nearly equal numbers is
    divided by (S. Shepperd, J. Guid. Control 1 (1978)).
    """
    C = np.asarray(C, dtype=np.float64)
    t = np.trace(C, axis1=-2, axis2=-1)
    d = np.stack([t, C[..., 0, 0], C[..., 1, 1], C[..., 2, 2]], -1)
    x, y, z = (
        C[..., 2, 1] - C[..., 1, 2],
        C[..., 0, 2] - C[..., 2, 0],
        C[..., 1, 0] - C[..., 0, 1],
    )
    xy, xz, yz = C[..., 0, 1] + C[..., 1, 0], C[..., 0, 2] + C[..., 2, 0], C[..., 1, 2] + C[..., 2, 1]
    one = np.ones_like(t)
    rows = np.stack(
        [
            np.stack([one + t, x, y, z], -1),
            np.stack([x, one + 2 * C[..., 0, 0] - t, xy, xz], -1),
            np.stack([y, xy, one + 2 * C[..., 1, 1] - t, yz], -1),
            np.stack([z, xz, yz, one + 2 * C[..., 2, 2] - t], -1),
        ],
        -2,
    )
    largest = np.argmax(d, axis=-1)
    q = np.take_along_axis(rows, largest[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def dcm_from_quaternion(q: ArrayLike) -> Array:
    """Direction cosine matrix (..., 3, 3) of a unit quaternion (..., 4), scalar first."""
    q = np.asarray(q, dtype=np.float64)
    w, v = q[..., 0, None, None], q[..., 1:]
    S = skew(v)
    return np.eye(3) + 2 * w * S + 2 * (S @ S)


def dcm_from_euler(heading: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> Array:
    """``C_nb = Rz(-heading) Rx(pitch) Ry(roll)``, (..., 3, 3), of angles in rad."""
    h, p, r = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (heading, pitch, roll)))
    sh, ch, sp, cp, sr, cr = np.sin(h), np.cos(h), np.sin(p), np.cos(p), np.sin(r), np.cos(r)
    return np.stack(
        [
            np.stack([ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr], -1),
            np.stack([-sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr], -1),
            np.stack([-cp * sr, sp, cp * cr], -1),
        ],
        -2,
    )


def euler_from_dcm(C_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Heading (0..2 pi, clockwise from north), pitch and roll, rad, of (..., 3, 3).

    At pitch +-90 deg heading and roll turn about the same axis; roll is then given as zero and heading holds the
    combination ``heading -+ roll``.
    """
    C = np.asarray(C_nb, dtype=np.float64)
    cos_pitch = np.hypot(C[..., 0, 1], C[..., 1, 1])
    pitch = np.arctan2(C[..., 2, 1], cos_pitch)
    vertical = cos_pitch < 1e-9
    heading = np.where(
        vertical, np.arctan2(-C[..., 1, 0], C[..., 0, 0]), np.arctan2(C[..., 0, 1], C[..., 1, 1])
    )
    roll = np.where(vertical, 0.0, np.arctan2(-C[..., 2, 0], C[..., 2, 2]))
    return np.mod(heading, 2 * np.pi), pitch, roll


def to_rotation(C: ArrayLike) -> Rotation:
    """The same rotation (or stack of them) as a SciPy object."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(np.asarray(C, dtype=np.float64))


def body_axes(axes: str) -> Array:
    """``C_rfu_given``: turns vectors given in other body axes into right, forward, up.

    Parameters
    ----------
    axes : str
        Where x, y and z point, one letter each: R or L, F or B, U or D; such as "FRD" or "FLU".

    Returns
    -------
    (3, 3) array

    Raises
    ------
    UsageError
        Not three letters that name three different axes, or a left-handed set.
    """
    name = axes.strip().upper()
    if len(name) != 3 or any(letter not in DIRECTIONS for letter in name):
        raise UsageError(
            f"axes {axes!r}; expected three letters saying where x, y and z point, of R/L (right, left), F/B (forward, "
            "back), U/D (up, down), such as RFU, FRD or FLU"
        )
    C = np.array([DIRECTIONS[letter] for letter in name], dtype=np.float64).T
    determinant = round(float(np.linalg.det(C)))
    if determinant == 0:
        raise UsageError(
            f"axes {axes!r} name one direction twice; expected three different ones, such as FRD"
        )
    if determinant < 0:
        others = [a for a in map("".join, permutations(name)) if np.linalg.det(body_axes_unchecked(a)) > 0]
        raise UsageError(f"axes {axes!r} are left-handed; did you mean one of {', '.join(others)}?")
    return C


def body_axes_unchecked(axes: str) -> Array:
    """Columns of :func:`body_axes` for letters already known to be good."""
    return np.array([DIRECTIONS[letter] for letter in axes], dtype=np.float64).T


@compiled(inline="always")
def quaternion_from_vector(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Unit quaternion of a rotation vector, scalars in and out (for kernels)."""
    square = x * x + y * y + z * z
    if square < SMALL_ANGLE_SQUARED:
        w = 1.0 - square / 8.0 * (1.0 - square / 48.0)
        s = 0.5 - square / 48.0 * (1.0 - square / 80.0)
    else:
        angle = math.sqrt(square)
        w = math.cos(0.5 * angle)
        s = math.sin(0.5 * angle) / angle
    return w, s * x, s * y, s * z
