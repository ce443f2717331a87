"""Attitude: rotation vectors, quaternions, direction cosines and Euler angles, in the library's conventions.

``C_nb`` turns body into navigation axes, ``v_n = C_nb @ v_b``; n is ENU, b is RFU, and
``C_nb = Rz(-heading) Rx(pitch) Ry(roll)``. Quaternions are Hamilton's, scalar first.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

UNIFORM_SIGMA = math.pi / math.sqrt(3.0)  # rad, sigma of an angle of which nothing is known
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
    angle = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None, None]
    angle = np.where(angle == 0.0, 1e-20, angle)  # the sine of so small an angle is the angle
    S = skew(v)
    return np.eye(3) + np.sin(angle) / angle * S + 0.5 * (np.sin(0.5 * angle) / (0.5 * angle)) ** 2 * (S @ S)


def length_of(v: Array) -> float:
    """Length of one vector (n,): to the bit that of :func:`numpy.linalg.norm`, which takes longer to begin."""
    return math.sqrt(v.dot(v))


def rotation_vector_from_dcm(C: ArrayLike) -> Array:
    """Rotation vector (..., 3), rad, of at most pi, of a direction cosine matrix (..., 3, 3)."""
    C = np.asarray(C, dtype=np.float64)
    return _rotation_vector_of_one(C) if C.ndim == 2 else rotation_vector_from_quaternion(quaternion_from_dcm(C))


def _rotation_vector_of_one(C: Array) -> Array:
    """The same (3,) of one matrix (3, 3), to the bit: a dozen calls of NumPy take ten times as long to begin."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = C.tolist()
    trace = xx + yy + zz
    largest = max(trace, xx, yy, zz)
    if largest == trace:
        w, x, y, z = 1.0 + trace, zy - yz, xz - zx, yx - xy
    elif largest == xx:
        w, x, y, z = zy - yz, 1.0 + 2.0 * xx - trace, xy + yx, zx + xz
    elif largest == yy:
        w, x, y, z = xz - zx, xy + yx, 1.0 + 2.0 * yy - trace, yz + zy
    else:
        w, x, y, z = yx - xy, zx + xz, yz + zy, 1.0 + 2.0 * zz - trace
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0.0:
        length = -length
    w, x, y, z = w / length, x / length, y / length, z / length
    sine = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 * float(np.arctan2(sine, w)) / sine if sine > 1e-12 else 2.0  # NumPy's: that of C may round otherwise
    return np.array((scale * x, scale * y, scale * z))


def misalignment(C_hat: ArrayLike, C: ArrayLike) -> Array:
    """``phi`` (..., 3), rad, of a computed attitude: ``C_hat = (I - [phi x]) C``, the whole rotation vector where it is large."""
    return -rotation_vector_from_dcm(np.asarray(C_hat) @ np.swapaxes(np.asarray(C), -1, -2))


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
    d = np.empty((*C.shape[:-2], 4))
    d[..., 1:] = np.diagonal(C, axis1=-2, axis2=-1)
    d[..., 0] = t = d[..., 1] + d[..., 2] + d[..., 3]
    rows = np.empty((*C.shape[:-2], 4, 4))
    rows[..., 0, 0] = 1.0 + t
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        rows[..., 0, 1 + i] = rows[..., 1 + i, 0] = C[..., k, j] - C[..., j, k]
        rows[..., 1 + j, 1 + k] = rows[..., 1 + k, 1 + j] = C[..., j, k] + C[..., k, j]
        rows[..., 1 + i, 1 + i] = 1.0 + 2.0 * d[..., 1 + i] - t
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
    C = np.empty((*h.shape, 3, 3))
    sines, cosines = (np.sin(h), np.sin(p), np.sin(r)), (np.cos(h), np.cos(p), np.cos(r))
    _write_elements(np.moveaxis(C, (-2, -1), (0, 1)), sines, cosines)
    return C


def dcm_elements(sines: Array, cosines: Array) -> Array:
    """The same, (3, 3, ...), of the sines and cosines (3, ...) of heading, pitch and roll: element by element in memory."""
    C = np.empty((3, *sines.shape))
    _write_elements(C, sines, cosines)
    return C


def _write_elements(C: Array, sines: Any, cosines: Any) -> None:
    (sh, sp, sr), (ch, cp, cr) = sines, cosines
    C[0, 0], C[0, 1], C[0, 2] = ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr
    C[1, 0], C[1, 1], C[1, 2] = -sh * cr + ch * sp * sr, ch * cp, -sh * sr - ch * sp * cr
    C[2, 0], C[2, 1], C[2, 2] = -cp * sr, sp, cp * cr


def euler_from_dcm(C_nb: ArrayLike) -> tuple[Array, Array, Array]:
    """Heading (0..2 pi, clockwise from north), pitch and roll, rad, of (..., 3, 3).

    Within 1e-9 rad of pitch +-90 deg heading and roll turn about the same axis and cannot be separated: roll is then
    given as zero, and heading holds what can be seen, ``heading - roll`` (nose up) or ``heading + roll`` (nose down).
    """
    C = np.asarray(C_nb, dtype=np.float64)
    cos_pitch = np.hypot(C[..., 0, 1], C[..., 1, 1])
    pitch = np.arctan2(C[..., 2, 1], cos_pitch)
    vertical = cos_pitch < 1e-9
    heading = np.where(vertical, np.arctan2(-C[..., 1, 0], C[..., 0, 0]), np.arctan2(C[..., 0, 1], C[..., 1, 1]))
    roll = np.where(vertical, 0.0, np.arctan2(-C[..., 2, 0], C[..., 2, 2]))
    heading = np.mod(heading, 2 * np.pi)
    return np.where(heading == 2 * np.pi, 0.0, heading), pitch, roll  # mod rounds -1e-17 up to 2 pi


def euler_jacobian(C_nb: Array) -> Array:
    """Errors of heading, pitch and roll for a misalignment ``phi`` (E, N, U).

    From ``C_hat = (I - [phi x]) C``: a body axis ``a`` seen in n moves by ``-phi x a``; heading and pitch belong to
    the y axis (``atan2(y_E, y_N)``, ``asin(y_U)``), roll to x and z (``atan2(-x_U, z_U)``).

    Parameters
    ----------
    C_nb : (..., 3, 3) array

    Returns
    -------
    (..., 3, 3) array
        Rows heading, pitch, roll; columns phi_E, phi_N, phi_U. It grows without bound towards pitch +-90 deg.
    """
    xU, yU, zU = C_nb[..., 2, 0], C_nb[..., 2, 1], C_nb[..., 2, 2]
    yE, yN = C_nb[..., 0, 1], C_nb[..., 1, 1]
    # -phi x a as a matrix on phi is [a x]; rows of [a x]: E (0, -a_U, a_N), N (a_U, 0, -a_E), U (-a_N, a_E, 0).
    J = np.zeros(C_nb.shape)
    of_heading, of_pitch, of_roll = J[..., 0, :], J[..., 1, :], J[..., 2, :]
    own, both = yE**2 + yN**2, xU**2 + zU**2
    cos2, level = np.maximum(own, 1e-12), np.maximum(both, 1e-12)
    of_heading[..., 0], of_heading[..., 1], of_heading[..., 2] = -yE * yU / cos2, -yN * yU / cos2, own / cos2
    of_pitch[..., 0], of_pitch[..., 1] = -yN / np.sqrt(cos2), yE / np.sqrt(cos2)
    of_roll[..., 0] = (zU * C_nb[..., 1, 0] - xU * C_nb[..., 1, 2]) / level
    of_roll[..., 1] = (xU * C_nb[..., 0, 2] - zU * C_nb[..., 0, 0]) / level
    return J


def euler_sigma(C_nb: Array, phi_covariance: Array) -> Array:
    """One-sigma of heading, pitch and roll (rad), none above that of an angle of which nothing is known."""
    J = euler_jacobian(C_nb)
    variance = np.sum(J @ phi_covariance * J, axis=-1)
    return np.minimum(np.sqrt(variance), UNIFORM_SIGMA)


def angle_text(sigma: float) -> str:
    """A one-sigma of an angle (rad) for a person: degrees, with minutes of arc where it is small."""
    if sigma > 0.99 * UNIFORM_SIGMA:
        return "unknown"
    degrees = float(np.degrees(sigma))
    return f"{degrees:.2f}°" if degrees >= 1.0 else f"{degrees:.4f}° ({degrees * 60:.2f}′)"


def to_rotation(C: ArrayLike) -> Rotation:
    """The same rotation (or stack of them) as a SciPy object."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(np.asarray(C, dtype=np.float64))


def body_axes(axes: str) -> Array:
    """``C_rfu_given``: turns vectors given in other body axes into right, forward, up.

    A left-handed set, such as FLD, is of an IMU whose rate about each axis is right-handed about that axis all the same; the
    matrix then has the determinant -1, and stands for rates and forces alike.

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
        Not three letters that name three different axes.
    """
    name = axes.strip().upper()
    if len(name) != 3 or any(letter not in DIRECTIONS for letter in name):
        raise UsageError(
            f"axes {axes!r}; expected three letters saying where x, y and z point, of R/L (right, left), F/B (forward, "
            "back), U/D (up, down), such as RFU, FRD or FLU"
        )
    C = _columns(name)
    if abs(np.linalg.det(C)) < 0.5:
        raise UsageError(
            f"axes {axes!r}: two letters lie along one axis; expected one each of R/L, F/B and U/D, such as FRD"
        )
    return C


def _columns(axes: str) -> Array:
    return np.array([DIRECTIONS[letter] for letter in axes], dtype=np.float64).T


# For kernels: vectors and quaternions as tuples of scalars, which stay in registers and allocate nothing.


@borrowing(forceinline=True)
def cross(a: Any, b: Any) -> Any:
    """``a x b`` of two vectors as tuples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@borrowing
def times(C: Any, v: Any) -> Any:
    """``C v`` of a (3, 3) matrix and a vector as a tuple."""
    return (
        C[0, 0] * v[0] + C[0, 1] * v[1] + C[0, 2] * v[2],
        C[1, 0] * v[0] + C[1, 1] * v[1] + C[1, 2] * v[2],
        C[2, 0] * v[0] + C[2, 1] * v[1] + C[2, 2] * v[2],
    )


@borrowing
def times_back(C: Any, v: Any) -> Any:
    """``C^T v`` of a (3, 3) matrix and a vector as a tuple."""
    return times(C.T, v)


@borrowing(forceinline=True)
def quaternion_product(p: Any, q: Any) -> Any:
    """Hamilton's product of two quaternions as tuples."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@borrowing(forceinline=True)
def quaternion_from_rotation_vector(rotation: Any) -> Any:
    """Unit quaternion of a rotation vector, tuples; exact to rounding at any angle."""
    x, y, z = rotation
    square = x * x + y * y + z * z
    if square < SMALL_ANGLE_SQUARED:
        return quaternion_of_small(rotation)
    angle = math.sqrt(square)
    s = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), s * x, s * y, s * z


@borrowing(forceinline=True)
def quaternion_of_small(rotation: Any) -> Any:
    """The same of a rotation below .01 rad, by series: without a choice, so that a loop over many goes in vectors."""
    x, y, z = rotation
    square = x * x + y * y + z * z
    w = 1.0 - 0.125 * square * (1.0 - (1.0 / 48.0) * square)
    s = 0.5 - (1.0 / 48.0) * square * (1.0 - (1.0 / 80.0) * square)
    return w, s * x, s * y, s * z


@borrowing(forceinline=True)
def rotate(q: Any, v: Any) -> Any:
    """A vector turned by a unit quaternion, tuples: ``v + 2 w t + 2 u x t`` with ``t = u x v``."""
    u = (q[1], q[2], q[3])
    t = cross(u, v)
    s = cross(u, t)
    return (
        v[0] + 2.0 * (q[0] * t[0] + s[0]),
        v[1] + 2.0 * (q[0] * t[1] + s[1]),
        v[2] + 2.0 * (q[0] * t[2] + s[2]),
    )


@borrowing(forceinline=True)
def normalised(q: Any) -> Any:
    """A nearly unit quaternion, a tuple, made unit: one Newton step, exact to rounding for errors below 1e-8."""
    scale = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale
