"""Errors of an INS whose azimuth may be far off while its tilts are small, measured by an odometer: 16 states, one second a step.

The computed frame n' is turned against n by an azimuth ``phi_U`` of any size and two small tilts, ``C_hat = M' C`` with

    M = C_n'^n = Rz(phi_U) (I + [(phi_E, phi_N, 0) x])

The paper's model (M. Wu, X. Tang, X. Huang, odometer-aided alignment on the move by a strong tracking Gauss-Hermite filter),
its equations derived anew; signs are ours:

    phi' = (I - M') w_in + Rz' dw_in - C_hat eps,          dw_in = dw_ie + dw_en
    dv'  = (I - M) f_hat + Rz C_hat nabla - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v
    dp'  = dv

and over an interval of length T the INS's displacement against that of the odometer u, both in computed axes:

    z = int v_hat dt - u = int dv dt + (M - I) u - dK Rz u

The velocity v is not known where azimuth is not: that of the odometer, ``M u/T``, takes its place. ``int dv dt`` ties two
epochs; it is given by the state at the end, ``T (dv - (I - M) W - ...)`` with the force weighted by the time elapsed,
``W = int (s - t0)/T f_hat ds``: exact but for the noise of the accelerometers within one interval, a micrometre.

Given ``phi_U`` all is linear: the reduced quadrature filters need nodes in that one state.

| slice | state | unit |
| --- | --- | --- |
| PHI | tilts E, N and azimuth U of the computed frame | rad |
| DV, DP | velocity and position error | m/s, m |
| BG, BA | gyro and accelerometer bias, measured minus true | rad/s, m/s^2 |
| DK | relative scale error of the odometer | 1 |

Corrections to the paper's text: order of position; the missing ``cos phi_U`` and azimuth terms of its (28); signs of its (16)
and (32); ``-C_b^n'`` and ``C_n'^n C_b^n'`` in its (27); ``-C v`` in its (39).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.compiled import compiled
from truenorth.filters import matrix_function, vector_function
from truenorth.state.layout import DV, PHI
from truenorth.state.layout import STATES as INS_STATES

Array = NDArray[np.float64]

DK = INS_STATES  # behind the fifteen of the INS
STATES = 16
AZIMUTH = 2  # the one nonlinear state

# Parameters of an interval.
T = 0
C_MEAN = slice(1, 10)  # mean of C_hat, row by row
FORCE = slice(10, 13)  # int f_hat dt, m/s
LATE_FORCE = slice(13, 16)  # W, m/s
TRAVELLED = slice(16, 19)  # u, m
VELOCITY = slice(19, 22)  # mean computed velocity, m/s
EARTH = slice(22, 25)  # w_ie, rad/s
CURVATURE = slice(25, 28)  # K_xx, K_xy, K_yy, 1/m
PARAMETERS = 28


@compiled
def _dynamics(s: float, c: float, x: Any, p: Any) -> Any:
    """``f(x)``, a tuple, with the sine and cosine of the azimuth given: linear in all other states."""
    h = p[0]
    Kxx, Kxy, Kyy = p[25], p[26], p[27]
    # Computed rate of n, and by how much errors of place and velocity change it.
    vx, vy = p[19], p[20]
    wx, wy, wz = p[22] - (Kxy * vx + Kyy * vy), p[23] + Kxx * vx + Kxy * vy, p[24]
    tx, ty = -(Kxy * x[6] + Kyy * x[7]), Kxx * x[6] + Kxy * x[7]  # turn of the frame by dp
    ex, ey, ez = -p[24] * ty, p[24] * tx, p[22] * ty - p[23] * tx  # dw_ie = w_ie x (tx, ty, 0)
    nx, ny = -(Kxy * x[3] + Kyy * x[4]), Kxx * x[3] + Kxy * x[4]  # dw_en
    dx, dy, dz = ex + nx, ey + ny, ez
    gx = p[1] * x[9] + p[2] * x[10] + p[3] * x[11]
    gy = p[4] * x[9] + p[5] * x[10] + p[6] * x[11]
    gz = p[7] * x[9] + p[8] * x[10] + p[9] * x[11]
    E, N = x[0], x[1]
    # (I - M') w_in + Rz' dw_in - C eps
    rE = (1.0 - c) * wx - s * wy + N * wz + c * dx + s * dy - gx
    rN = s * wx + (1.0 - c) * wy - E * wz - s * dx + c * dy - gy
    rU = -(c * N + s * E) * wx - (s * N - c * E) * wy + dz - gz
    tilt_E, tilt_N, azimuth = E + h * rE, N + h * rN, x[2] + h * rU
    E, N = E + 0.5 * h * rE, N + 0.5 * h * rN  # half way
    fx, fy, fz = p[10], p[11], p[12]
    bx = h * (p[1] * x[12] + p[2] * x[13] + p[3] * x[14])
    by = h * (p[4] * x[12] + p[5] * x[13] + p[6] * x[14])
    bz = h * (p[7] * x[12] + p[8] * x[13] + p[9] * x[14])
    # (I - M) f + Rz C nabla
    ax = (1.0 - c) * fx + s * fy - (c * N + s * E) * fz + c * bx - s * by
    ay = -s * fx + (1.0 - c) * fy - (s * N - c * E) * fz + s * bx + c * by
    az = N * fx - E * fy + bz
    # - (2 w_ie + w_en) x dv - (2 dw_ie + dw_en) x v, v = M u / T
    ux, uy, uz = (c * p[16] - s * p[17]) / h, (s * p[16] + c * p[17]) / h, p[18] / h
    qx, qy, qz = p[22] + wx, p[23] + wy, p[24] + wz
    mx, my, mz = 2.0 * ex + nx, 2.0 * ey + ny, 2.0 * ez
    ax -= h * (qy * x[5] - qz * x[4] + my * uz - mz * uy)
    ay -= h * (qz * x[3] - qx * x[5] + mz * ux - mx * uz)
    az -= h * (qx * x[4] - qy * x[3] + mx * uy - my * ux)
    return (
        tilt_E,
        tilt_N,
        azimuth,
        x[3] + ax,
        x[4] + ay,
        x[5] + az,
        x[6] + h * (x[3] + 0.5 * ax),
        x[7] + h * (x[4] + 0.5 * ay),
        x[8] + h * (x[5] + 0.5 * az),
        x[9],
        x[10],
        x[11],
        x[12],
        x[13],
        x[14],
        x[15],
    )


@compiled
def _odometer(s: float, c: float, x: Any, p: Any) -> Any:
    """``h(x)``, a tuple, with the sine and cosine of the azimuth given: linear in all other states."""
    h = p[0]
    E, N = x[0], x[1]
    half = 0.5 * h
    bx = half * (p[1] * x[12] + p[2] * x[13] + p[3] * x[14])
    by = half * (p[4] * x[12] + p[5] * x[13] + p[6] * x[14])
    bz = half * (p[7] * x[12] + p[8] * x[13] + p[9] * x[14])
    fx, fy, fz = p[13], p[14], p[15]
    ax = (1.0 - c) * fx + s * fy - (c * N + s * E) * fz + c * bx - s * by
    ay = -s * fx + (1.0 - c) * fy - (s * N - c * E) * fz + s * bx + c * by
    az = N * fx - E * fy + bz
    ux, uy, uz = p[16], p[17], p[18]
    return (
        h * (x[3] - ax) + (c - 1.0) * ux - s * uy + (c * N + s * E) * uz - x[15] * (c * ux - s * uy),
        h * (x[4] - ay) + s * ux + (c - 1.0) * uy + (s * N - c * E) * uz - x[15] * (s * ux + c * uy),
        h * (x[5] - az) - N * ux + E * uy - x[15] * uz,
    )


@compiled
def _state(x: Any) -> Any:
    """The sixteen states as a tuple, which allocates nothing."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], x[12], x[13], x[14], x[15])


@compiled
def _unit(j: int) -> Any:
    """The unit vector of a state, a tuple; of none where j is negative."""
    return (
        1.0 * (j == 0),
        1.0 * (j == 1),
        1.0 * (j == 2),
        1.0 * (j == 3),
        1.0 * (j == 4),
        1.0 * (j == 5),
        1.0 * (j == 6),
        1.0 * (j == 7),
        1.0 * (j == 8),
        1.0 * (j == 9),
        1.0 * (j == 10),
        1.0 * (j == 11),
        1.0 * (j == 12),
        1.0 * (j == 13),
        1.0 * (j == 14),
        1.0 * (j == 15),
    )


@vector_function
def transition(x: Array, p: Array, out: Array) -> None:
    """Errors after the interval."""
    found = _dynamics(math.sin(x[2]), math.cos(x[2]), _state(x), p)
    for i in range(16):
        out[i] = found[i]


@vector_function
def measurement(x: Array, p: Array, out: Array) -> None:
    """Displacement of the INS less that of the odometer, m, by the errors at the end of the interval."""
    found = _odometer(math.sin(x[2]), math.cos(x[2]), _state(x), p)
    for i in range(3):
        out[i] = found[i]


@compiled(forceinline=True)
def _put(out: Array, column: int, factor: float, ahead: Any, behind: Any) -> None:
    """Column of a Jacobian: a difference of two tuples times a factor."""
    for i in range(len(ahead)):
        out[i, column] = factor * (ahead[i] - behind[i])


@matrix_function
def transition_jacobian(x: Array, p: Array, out: Array) -> None:
    """Exact, from the model itself: linear in all states but the azimuth, and a polynomial of second degree in its sine and cosine.

    The derivative of such a polynomial along ``(cos, -sin)`` is its central difference, whatever the step.
    """
    s, c = math.sin(x[2]), math.cos(x[2])
    zero = _dynamics(s, c, _unit(-1), p)
    for j in range(16):
        _put(out, j, 1.0, _dynamics(s, c, _unit(j), p), zero)
    _put(out, 2, 0.5, _dynamics(s + c, c - s, _state(x), p), _dynamics(s - c, c + s, _state(x), p))
    out[2, 2] += 1.0


@matrix_function
def measurement_jacobian(x: Array, p: Array, out: Array) -> None:
    """As :func:`transition_jacobian`."""
    s, c = math.sin(x[2]), math.cos(x[2])
    zero = _odometer(s, c, _unit(-1), p)
    for j in range(16):
        _put(out, j, 1.0, _odometer(s, c, _unit(j), p), zero)
    _put(out, 2, 0.5, _odometer(s + c, c - s, _state(x), p), _odometer(s - c, c + s, _state(x), p))


def correction(x: Array) -> Array:
    """``M`` of the estimated errors, (B, 3, 3) of (B, 16): what a correction multiplies the attitude by."""
    tilt, azimuth = x[:, PHI].copy(), np.zeros((len(x), 3))
    azimuth[:, 2], tilt[:, 2] = tilt[:, 2], 0.0
    return np.asarray(dcm_from_rotation_vector(azimuth) @ dcm_from_rotation_vector(tilt))


def after_correction(x: Array, P: Array, *, velocity: bool = True) -> Array:
    """(B, 16, 16) covariance once x is fed back: what is left of tilts and velocity is turned with the computed frame.

    Tilts belong to that frame. The velocity error is ``(I - M) v`` where the azimuth is off: how it is correlated with an
    azimuth error *about the new estimate* is turned by that estimate. `velocity` false leaves it, as the ordinary
    error-state filter does: then the reduced Gauss-Hermite filter of order 7 diverges in a third of the runs that start 30 deg
    off, else in none.
    """
    D = np.zeros((len(x), STATES, STATES))
    D[:] = np.eye(STATES)
    s, c = np.sin(x[:, AZIMUTH]), np.cos(x[:, AZIMUTH])
    for i in (PHI.start, DV.start) if velocity else (PHI.start,):
        D[:, i, i], D[:, i, i + 1], D[:, i + 1, i], D[:, i + 1, i + 1] = c, -s, s, c
    return np.asarray(D @ P @ np.swapaxes(D, 1, 2))
