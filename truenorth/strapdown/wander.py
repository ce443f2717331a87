"""Mechanisation without a pole: a level frame that is never turned about the vertical, over a position quaternion.

The frame w is level; its azimuth against north *wanders* as it is carried over the earth, which is what keeps it regular
everywhere. Position is the rotation ``q_ew`` from w to earth axes, whose third column is the ellipsoid's normal (the
n-vector). Everything in an update is a polynomial in these, no tangent of latitude enters. It starts as ENU, and its
answers are turned into ENU when they are put out.

Update and order are those of :func:`truenorth.strapdown.level.mechanise` with the sample before ("previous"). A sample can be
taken in parts, so that a measurement between two samples finds the state at its own time.

Sources: P. Savage, *Strapdown Analytics*, 2nd ed. (2007), sec. 4.4 and 7.3; K. Gade, "A non-singular horizontal position
representation", J. Navigation 63 (2010).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core import earth
from truenorth.core.attitude import (
    cross,
    normalised,
    quaternion_from_dcm,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotate,
)
from truenorth.core.compiled import borrowing, compiled
from truenorth.strapdown.coning import rotation_vector, velocity_increment

Array = NDArray[np.float64]

# One array holds all that an update needs and changes.
ATTITUDE = slice(0, 4)  # q_wb
VELOCITY = slice(4, 7)  # m/s, along w
PLACE = slice(7, 11)  # q_ew
ALT = 11  # m
ACCELERATION = slice(12, 15)  # dv_w/dt, mean of the last update, m/s^2
LAST_ANGLE = slice(15, 18)  # last sample, rad
LAST_VELOCITY = slice(18, 21)  # and m/s
FORCE = slice(21, 24)  # int f_w dt of the last part, m/s
LENGTH = 24

K_BEFORE = 1.0 / 12.0  # coning and sculling by the sample before

_W = earth.EARTH_RATE
_radii_at = compiled(earth.radii_at)
_normal_gravity_at = compiled(earth.normal_gravity_at)


@borrowing
def curvature(axis: Any, alt: float) -> Any:
    """``K`` of ``w_ew = up x K v`` in a level frame: ``K_xx, K_xy, K_yy``, 1/m.

    Parameters
    ----------
    axis : (3,) tuple or array
        The earth's axis in the level frame; (0, cos L, sin L) in ENU.
    alt : float, m
    """
    s2 = axis[2] * axis[2]
    R_M, R_N = _radii_at(s2)
    # 1/(R_M + h) along north, 1/(R_N + h) along east; their difference is of order cos^2 L, regular at the pole.
    W2 = 1.0 - earth.ECCENTRICITY_SQUARED * s2
    east = 1.0 / (R_N + alt)
    more = R_N * earth.ECCENTRICITY_SQUARED / W2 * east / (R_M + alt)
    return east + more * axis[0] * axis[0], more * axis[0] * axis[1], east + more * axis[1] * axis[1]


@borrowing
def earth_axis(s: Any) -> Any:
    """The earth's axis in w, a tuple: the third row of ``C_ew``."""
    w, x, y, z = s[7], s[8], s[9], s[10]
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@borrowing
def set_matrix(s: Any, C: Any) -> None:
    """``C_wb`` of the state's quaternion."""
    w, x, y, z = s[0], s[1], s[2], s[3]
    C[0, 0], C[0, 1], C[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    C[1, 0], C[1, 1], C[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    C[2, 0], C[2, 1], C[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@borrowing
def azimuth(s: Any) -> Any:
    """Direction of north in w: its sine and cosine, x and y; at the pole itself y is called north."""
    axis = earth_axis(s)
    level = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
    if level == 0.0:
        return 0.0, 1.0
    return axis[0] / level, axis[1] / level


@borrowing
def acceleration(s: Any, force: Any, fixed_altitude: bool) -> Any:
    """``dv_w/dt`` of a mean specific force along w, m/s^2; of the last sample where there is none yet.

    That of a single sample is the base's vibration, too; over an interval the mean is what the velocity does.
    """
    if force[0] * force[0] + force[1] * force[1] + force[2] * force[2] < 1.0:
        return s[12], s[13], s[14]
    axis = earth_axis(s)
    rate = 2.0 * earth.EARTH_RATE
    coriolis = cross((rate * axis[0], rate * axis[1], rate * axis[2]), (s[4], s[5], s[6]))
    up = s[14]
    if not fixed_altitude:
        up = force[2] - coriolis[2] - _normal_gravity_at(axis[2] * axis[2], s[11])
    return force[0] - coriolis[0], force[1] - coriolis[1], up


@borrowing
def advance(s: Any, T: float, part: float, dtheta: Any, dvel: Any, ends: bool, fixed_altitude: bool) -> None:
    """Carry the state on through a sample, or through a part of it.

    Parameters
    ----------
    s : (24,) array
        Changed in place.
    T : float, s
        Length of the whole sample.
    part : float
        How much of it, 1 for all.
    dtheta, dvel : tuples of 3, rad and m/s
        Increments of the whole sample, errors taken off.
    ends : bool
        The sample ends with this part.
    fixed_altitude : bool
        Height held, vertical velocity zero.
    """
    a = (part * dtheta[0], part * dtheta[1], part * dtheta[2])
    b = (part * dvel[0], part * dvel[1], part * dvel[2])
    K = (K_BEFORE * s[15], K_BEFORE * s[16], K_BEFORE * s[17])
    L = (K_BEFORE * s[18], K_BEFORE * s[19], K_BEFORE * s[20])
    phi = rotation_vector(K, a, a)
    dv_b = velocity_increment(K, a, a, L, b, b)
    q = (s[0], s[1], s[2], s[3])
    T = part * T

    # Half an interval on, where Coriolis, transport and gravity are taken.
    half = 0.5 * T
    vx, vy, vz = s[4], s[5], s[6]
    mx, my, mz = vx + half * s[12], vy + half * s[13], vz + half * s[14]
    alt = s[11] + half * mz
    axis = earth_axis(s)
    Kxx, Kxy, Kyy = curvature(axis, alt)
    wx, wy = -(Kxy * mx + Kyy * my), Kxx * mx + Kxy * my
    back = cross(axis, (wx, wy, 0.0))
    axis = (axis[0] + half * back[0], axis[1] + half * back[1], axis[2] + half * back[2])
    wie = (_W * axis[0], _W * axis[1], _W * axis[2])
    zeta = ((wie[0] + wx) * T, (wie[1] + wy) * T, wie[2] * T)  # rotation vector of w

    # Specific force into w half way through w's own turn: (I - [zeta x]/2) C_wb dv.
    f = rotate(q, dv_b)
    turn = cross(zeta, f)
    s[21], s[22], s[23] = f[0] - 0.5 * turn[0], f[1] - 0.5 * turn[1], f[2] - 0.5 * turn[2]
    coriolis = cross((2.0 * wie[0] + wx, 2.0 * wie[1] + wy, 2.0 * wie[2]), (mx, my, mz))
    dx = s[21] - coriolis[0] * T
    dy = s[22] - coriolis[1] * T
    dz = s[23] - (coriolis[2] + _normal_gravity_at(axis[2] * axis[2], alt)) * T
    if fixed_altitude:
        dz = -vz

    # Position by the trapezoid of velocity.
    mx, my = (vx + 0.5 * dx) * T, (vy + 0.5 * dy) * T
    moved = quaternion_from_rotation_vector((-(Kxy * mx + Kyy * my), Kxx * mx + Kxy * my, 0.0))
    s[7], s[8], s[9], s[10] = normalised(quaternion_product((s[7], s[8], s[9], s[10]), moved))
    if not fixed_altitude:
        s[11] += (vz + 0.5 * dz) * T
    s[4], s[5], s[6] = vx + dx, vy + dy, vz + dz
    s[12], s[13], s[14] = dx / T, dy / T, dz / T

    # q_wb <- exp(-zeta) q_wb exp(phi)
    turned = quaternion_product(q, quaternion_from_rotation_vector(phi))
    unturned = quaternion_from_rotation_vector((-zeta[0], -zeta[1], -zeta[2]))
    s[0], s[1], s[2], s[3] = normalised(quaternion_product(unturned, turned))
    if ends:
        s[15], s[16], s[17] = dtheta
        s[18], s[19], s[20] = dvel


@borrowing
def displace(s: Any, dx: float, dy: float, dz: float) -> None:
    """Move the place by metres along w; attitude and velocity keep their components."""
    Kxx, Kxy, Kyy = curvature(earth_axis(s), s[11])
    moved = quaternion_from_rotation_vector((-(Kxy * dx + Kyy * dy), Kxx * dx + Kxy * dy, 0.0))
    s[7], s[8], s[9], s[10] = normalised(quaternion_product((s[7], s[8], s[9], s[10]), moved))
    s[11] += dz


def state_at(C_nb: ArrayLike, v_n: ArrayLike, lat: float, lon: float, alt: float) -> Array:
    """(24,) state to begin with; w is ENU there."""
    s = np.zeros(LENGTH)
    s[ATTITUDE] = quaternion_from_dcm(C_nb)
    s[VELOCITY] = v_n
    s[PLACE] = quaternion_from_dcm(C_en(lat, lon))
    s[ALT] = alt
    return s


def C_en(lat: float, lon: float) -> Array:
    """(3, 3) ENU axes in earth axes, as columns."""
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return np.array([[-so, -sl * co, cl * co], [co, -sl * so, cl * so], [0.0, cl, sl]])


def north(states: Array) -> tuple[Array, Array, Array, Array]:
    """States in w, turned into ENU.

    Parameters
    ----------
    states : (K, 12 or more) array

    Returns
    -------
    C_nb : (K, 3, 3) array
    v_n : (K, 3) array, m/s
    position : (K, 3) array
        Latitude, longitude (rad), height (m).
    C_nw : (K, 3, 3) array
        At the pole itself, where north has no meaning, w stays as it is.
    """
    count = len(states)
    C_nb, v_n, position, C_nw = (
        np.empty((count, 3, 3)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.zeros((count, 3, 3)),
    )
    _north(np.ascontiguousarray(states, dtype=np.float64), C_nb, v_n, position, C_nw)
    return C_nb, v_n, position, C_nw


@compiled
def _north(states: Any, C_nb: Any, v_n: Any, position: Any, C_nw: Any) -> None:
    C = np.empty((3, 3))
    for k in range(len(states)):
        s = states[k]
        sine, cosine = azimuth(s)
        C_nw[k, 0, 0], C_nw[k, 0, 1] = cosine, -sine
        C_nw[k, 1, 0], C_nw[k, 1, 1] = sine, cosine
        C_nw[k, 2, 2] = 1.0
        set_matrix(s, C)
        for j in range(3):
            C_nb[k, 0, j] = cosine * C[0, j] - sine * C[1, j]
            C_nb[k, 1, j] = sine * C[0, j] + cosine * C[1, j]
            C_nb[k, 2, j] = C[2, j]
        v_n[k, 0] = cosine * s[4] - sine * s[5]
        v_n[k, 1] = sine * s[4] + cosine * s[5]
        v_n[k, 2] = s[6]
        up = rotate((s[7], s[8], s[9], s[10]), (0.0, 0.0, 1.0))
        position[k, 0] = math.atan2(up[2], math.sqrt(up[0] * up[0] + up[1] * up[1]))
        position[k, 1] = math.atan2(up[1], up[0])
        position[k, 2] = s[ALT]
