"""Errors in which an odometer does not depend on azimuth: the velocity error turned into the computed frame.

A wheel measures velocity in body axes, ``y = C' v``. Against the ordinary velocity error ``dv = v_hat - v`` that is
nonlinear in a large azimuth error, since ``C_hat' v_hat - y`` holds ``v`` seen through the wrong attitude. With

    dv_I = v_hat - C_hat C' v        (right-invariant: the true velocity turned into the computed frame)

it is linear and holds no azimuth at all: ``C_hat' v_hat - y = C_hat' dv_I``. Its dynamics lose the specific force as well,
``dv_I' = phi x g + C nabla + ...``, where the ordinary one has ``f x phi``: nothing in the filter depends on the
unknown heading any more, and a plain extended Kalman filter converges from any of them.

To first order ``dv_I = dv + phi x v``: a change of coordinates that depends on velocity alone. The closed loop can therefore
keep the ordinary errors, their F and their H; what makes it invariant is how a correction is fed back. Attitude and velocity
together are one element of the group SE_2(3), and their error its logarithm, ``phi`` and ``xi``:

    C_hat = exp([-phi x]) C,    v_hat = exp([-phi x]) v + J(-phi) xi

with J the left Jacobian of rotations. A correction ``phi_hat, xi_hat`` leaves, of errors ``d`` beyond it,

    C <- exp([phi_hat x]) C,                       phi <- J d_phi
    v <- exp([phi_hat x]) v - J(phi_hat) xi_hat,   xi  <- J d_xi + Q d_phi

and the covariance follows these before it returns to the ordinary coordinates at the new velocity. In these coordinates
the propagation of an error of any size is exactly linear (sensor errors aside), which is why a filter that starts 60 deg
off ends where one that starts 1 deg off does; with ``dv_I`` itself in place of its logarithm it ends twice as far off.
Of Q the terms ``[xi x]/2 + ([phi x][xi x] + [xi x][phi x])/6`` are taken; the next is smaller by ``phi^2/12``.

Sources: A. Barrau, S. Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE Trans. Autom. Control
62 (2017) (log-linear errors); T. Barfoot, *State Estimation for Robotics* (2017), eq. 7.86 (Q); mapped to our signs.
"""

from __future__ import annotations

import math
from typing import Any

from truenorth.core.attitude import cross, quaternion_from_rotation_vector, rotate
from truenorth.core.compiled import borrowing

_PHI, _DV = 0, 3
SMALL = 1e-4  # rad, below which the Jacobian's series is exact to rounding


@borrowing
def rotation_vector_of(q: Any) -> Any:
    """The rotation vector of a quaternion, tuples; the shorter way round."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    sine = math.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    scale = 2.0 * sign
    if sine > 1e-9:
        scale = 2.0 * sign * math.atan2(sine, sign * q[0]) / sine
    return scale * q[1], scale * q[2], scale * q[3]


@borrowing
def left_jacobian(phi: Any, e: Any) -> Any:
    """``J(phi) e``: what ``exp([-(phi + e) x])`` leaves of itself after ``exp([phi x])``, as a rotation vector; tuples."""
    angle = math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    if angle < SMALL:
        a, b = 0.5, 1.0 / 6.0
    else:
        a = (1.0 - math.cos(angle)) / (angle * angle)
        b = (angle - math.sin(angle)) / (angle * angle * angle)
    first = cross(phi, e)
    second = cross(phi, first)
    return e[0] + a * first[0] + b * second[0], e[1] + a * first[1] + b * second[1], e[2] + a * first[2] + b * second[2]


@borrowing
def corrected_velocity(v: Any, phi: Any, xi: Any) -> Any:
    """``exp([phi x]) v - J(phi) xi``; tuples."""
    back = left_jacobian(phi, xi)
    turned = rotate(quaternion_from_rotation_vector(phi), v)
    return turned[0] - back[0], turned[1] - back[1], turned[2] - back[2]


@borrowing
def _correction(phi: Any, v: Any, level: bool, x: Any) -> Any:
    """``xi`` of a correction, and the velocity after it; tuples."""
    turned = cross(phi, v)
    xi = (x[_DV] + turned[0], x[_DV + 1] + turned[1], 0.0 if level else x[_DV + 2] + turned[2])
    after = corrected_velocity(v, phi, xi)
    return xi, (after[0], after[1], v[2] if level else after[2])


@borrowing
def carried(phi: Any, xi: Any, v: Any, after: Any, level: bool, p: Any, d: Any) -> Any:
    """Errors `p` of attitude and `d` of velocity beyond a correction, as those left after it; tuples."""
    back = cross(v, p)
    d = left_jacobian(phi, (d[0] - back[0], d[1] - back[1], 0.0 if level else d[2] - back[2]))
    a = cross(xi, p)
    b, c = cross(phi, a), cross(xi, cross(phi, p))
    d = (
        d[0] + 0.5 * a[0] + (b[0] + c[0]) / 6.0,
        d[1] + 0.5 * a[1] + (b[1] + c[1]) / 6.0,
        d[2] + 0.5 * a[2] + (b[2] + c[2]) / 6.0,
    )
    p = left_jacobian(phi, p)
    forth = cross(after, p)
    return (p[0], p[1], p[2]), (d[0] + forth[0], d[1] + forth[1], 0.0 if level else d[2] + forth[2])


@borrowing
def reset(s: Any, x: Any, P: Any, level: bool) -> None:
    """Prepare a correction for being fed back as one of invariant errors.

    Parameters
    ----------
    s : (24,) array
        The state before the correction, see :mod:`truenorth.strapdown.wander`.
    x : (n,) array
        The estimated errors; that of velocity becomes what takes the velocity where it belongs.
    P : (N, N) array
        Their covariance, carried to the errors left.
    level : bool
        The vertical velocity is held at zero, and has no error.
    """
    phi, v = (x[_PHI], x[_PHI + 1], x[_PHI + 2]), (s[4], s[5], s[6])
    xi, after = _correction(phi, v, level, x)
    for side in range(2):  # D P, then its rows as columns: D P D'
        for j in range(P.shape[0]):
            if side == 0:
                p, d = carried(phi, xi, v, after, level, (P[0, j], P[1, j], P[2, j]), (P[3, j], P[4, j], P[5, j]))
            else:
                p, d = carried(phi, xi, v, after, level, (P[j, 0], P[j, 1], P[j, 2]), (P[j, 3], P[j, 4], P[j, 5]))
            for i in range(3):
                if side == 0:
                    P[_PHI + i, j], P[_DV + i, j] = p[i], d[i]
                else:
                    P[j, _PHI + i], P[j, _DV + i] = p[i], d[i]
    for i in range(P.shape[0]):
        for j in range(i):
            P[j, i] = P[i, j]
    for i in range(3):
        x[_DV + i] = v[i] - after[i]


@borrowing
def keep_reset(s: Any, x: Any, level: bool, D: Any) -> None:
    """Fill in attitude and velocity of `D` (n, n), by which :func:`reset` will carry errors to those that are left."""
    phi, v = (x[_PHI], x[_PHI + 1], x[_PHI + 2]), (s[4], s[5], s[6])
    xi, after = _correction(phi, v, level, x)
    for j in range(6):
        of_phi = (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
        of_dv = (1.0 if j == 3 else 0.0, 1.0 if j == 4 else 0.0, 1.0 if j == 5 else 0.0)
        p, d = carried(phi, xi, v, after, level, of_phi, of_dv)
        for i in range(3):
            D[_PHI + i, j], D[_DV + i, j] = p[i], d[i]
