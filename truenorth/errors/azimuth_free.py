"""Errors of which the azimuth is unseen: what only sensors in the body see tells nothing of it but by the earth's rate.

A log, a wheel and accelerometers see velocity, gravity and the earth's rate along the body's axes. All of them turned about the
vertical along with the body look the same: another azimuth, with the velocity over the ground turned by as much and gyros that
are biased by as much as the earth's rate then differs. That direction, of an azimuth error ``psi``,

    phi_U = psi,   dv = -psi u x v,   eps = psi C' (u x w_ie)                  u up, w_ie the earth's rate

turns with the estimate of azimuth. A filter that corrects azimuth along the way, and keeps its covariance as it is, has seen
from several directions what nobody sees from one: it knows azimuth to a third of what its error is, and the ship whose gyros drift
by 100 deg/h is 60 deg off with a sigma of 5. So a correction ``psi_hat`` is fed back along the whole curve on which all
that is seen stays the same, not along its tangent,

    C <- exp([psi u x]) exp([delta x]) C                delta the level part of phi_hat
    v <- exp([psi u x]) (v - xi),                       xi = dv_hat + psi u x v
    b <- b + eta + C' (w_ie - exp([-psi u x]) w_ie),    eta = eps_hat - psi C' (u x w_ie)

and the covariance follows: ``psi, xi, eta`` are what they were, along axes that have turned. A log in the water shows ``v + d``
with its drift `d`, the current's opposite: in the place of v this sum turns, and d, along east and north, stays. Level errors
turn with the body, so that what they and the biases of accelerometers have to do with each other stays the same, too.

The way that was gone by such a velocity turns as well, about the place where it began: with L the way from there, the lever,

    dp = -psi u x L,    L <- exp([psi u x]) (L - zeta),    zeta = dp_hat + psi u x L

so that a place seen once, or later on, shows azimuth by all of the way and not by its tangent. After a fix the vehicle turns about
another place, which the covariance names: ``u x L = -cov(dp, psi)/var(psi)`` leaves nothing of psi in zeta.

Gyros that are known better than the earth's rate shows azimuth are not biased by what a wrong azimuth made of it: of 15 deg that
is 0.3 deg/h to second order, thirty times what a good gyro is off. ``eps = k psi C' (u x w_ie) + eta`` has the k that leaves
nothing of psi in eta, ``cov(eps, psi)/var(psi)`` along that axis: ``s^2/(s^2 + r^2)`` where gyros are off by s and have seen the
earth's rate to r. Biases turn by so much of it.

The logarithm of :mod:`truenorth.errors.invariant` is straight where velocity is known over the ground; here the body knows it.

Sources: A. Barrau, S. Bonnabel, "The invariant extended Kalman filter as a stable observer", IEEE Trans. Autom. Control
62 (2017); G. Huang, A. Mourikis and S. Roumeliotis, "Analysis and improvement of the consistency of extended Kalman filter
based SLAM", ICRA 2008 (what a filter believes to see by a linearisation that moves).
"""

from __future__ import annotations

import math
from typing import Any

from truenorth.core.attitude import quaternion_from_rotation_vector, quaternion_product, rotate
from truenorth.core.compiled import borrowing
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.invariant import rotation_vector_of
from truenorth.strapdown.wander import azimuth, earth_axis

_PHI, _DV, _DP, _BG = 0, 3, 6, 9


@borrowing
def _turned(psi: float, v: Any) -> Any:
    """``exp([psi u x]) v``; tuples."""
    s, c = math.sin(psi), math.cos(psi)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@borrowing
def _back(q: Any, v: Any) -> Any:
    """A vector in axes of the body, tuples."""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


@borrowing
def _attitude_after(q: Any, x: Any) -> Any:
    """The quaternion once a correction is made, tuples."""
    level = quaternion_product(quaternion_from_rotation_vector((x[_PHI], x[_PHI + 1], 0.0)), q)
    return quaternion_product(quaternion_from_rotation_vector((0.0, 0.0, x[_PHI + 2])), level)


@borrowing
def _earth_rate(s: Any) -> Any:
    axis = earth_axis(s)
    return EARTH_RATE * axis[0], EARTH_RATE * axis[1], EARTH_RATE * axis[2]


@borrowing
def _drift_of(state: Any, values: Any, at: int) -> Any:
    """A drift east and north, or its error, along the axes of the loop, tuples; `at` is its first state, or -1."""
    if at < 0:
        return 0.0, 0.0, 0.0
    s, c = azimuth(state)
    return c * values[at] + s * values[at + 1], -s * values[at] + c * values[at + 1], 0.0


@borrowing
def _shown(v: Any, d: Any) -> Any:
    """The velocity that a log shows, tuples."""
    return v[0] + d[0], v[1] + d[1], v[2]


@borrowing
def _shown_after(shown: Any, x: Any, off: Any) -> Any:
    """That velocity once a correction is made; `off` is the one of the drift; tuples."""
    psi, xi = x[_PHI + 2], (x[_DV] - off[0], x[_DV + 1] - off[1], x[_DV + 2])
    return _turned(psi, (shown[0] - xi[0] + psi * shown[1], shown[1] - xi[1] - psi * shown[0], shown[2] - xi[2]))


@borrowing
def lever_of(P: Any) -> Any:
    """The way from the place about which a covariance says that the vehicle turns with its azimuth, east and north of w, m."""
    if not P[_PHI + 2, _PHI + 2] > 0.0:
        return 0.0, 0.0
    return -P[_DP + 1, _PHI + 2] / P[_PHI + 2, _PHI + 2], P[_DP, _PHI + 2] / P[_PHI + 2, _PHI + 2]


@borrowing
def share_of_gyros(s: Any, slow: int, P: Any) -> float:
    """How much of what azimuth makes of the earth's rate a covariance takes for biases of gyros, 0 to 1; `slow`: others, or -1."""
    w = _earth_rate(s)
    level, psi = w[0] * w[0] + w[1] * w[1], P[_PHI + 2, _PHI + 2]
    if not level * psi > 0.0:
        return 1.0
    aside = _back((s[0], s[1], s[2], s[3]), (-w[1], w[0], 0.0))
    both = 0.0
    for i in range(3):
        both += aside[i] * P[_BG + i, _PHI + 2]
        if slow >= 0:
            both += aside[i] * P[slow + i, _PHI + 2]
    return min(1.0, max(0.0, both / (level * psi)))


@borrowing
def turns_with_azimuth(s: Any, aux: Any, drift: int, P: Any) -> bool:
    """Whether a covariance knows the velocity that the body shows no worse than the one over the ground."""
    w = _shown((s[4], s[5], s[6]), _drift_of(s, aux, drift))
    aside = (-w[1], w[0])
    more = P[_PHI + 2, _PHI + 2] * (w[0] * w[0] + w[1] * w[1])
    more += 2.0 * (aside[0] * P[_DV, _PHI + 2] + aside[1] * P[_DV + 1, _PHI + 2])
    if drift >= 0:
        sine, cosine = azimuth(s)
        for i in range(2):
            to = (cosine, sine) if i == 0 else (-sine, cosine)  # of the drift along an axis of w
            more += P[drift + i, drift + i]
            for j in range(2):
                more -= 2.0 * to[j] * (P[_DV + i, drift + j] + aside[i] * P[_PHI + 2, drift + j])
    return bool(more <= 0.0)


@borrowing
def beyond_tangent(s: Any, x: Any, aux: Any, drift: int, lever: Any) -> Any:
    """Level errors of velocity and place that a correction `x` takes off along the curve, and what they are made of; tuples.

    ``dv = s - exp([psi u x]) (s - xi) + d_hat`` with ``s = v + d``, and ``dp = L - exp([psi u x]) (L - zeta)``; then xi, zeta.
    """
    psi, off = x[_PHI + 2], _drift_of(s, x, drift)
    shown = _shown((s[4], s[5], s[6]), _drift_of(s, aux, drift))
    xi = (x[_DV] - off[0] - psi * shown[1], x[_DV + 1] - off[1] + psi * shown[0], 0.0)
    zeta = (x[_DP] - psi * lever[1], x[_DP + 1] + psi * lever[0], 0.0)
    v = _turned(psi, (shown[0] - xi[0], shown[1] - xi[1], 0.0))
    p = _turned(psi, (lever[0] - zeta[0], lever[1] - zeta[1], 0.0))
    return (shown[0] - v[0] + off[0], shown[1] - v[1] + off[1]), (lever[0] - p[0], lever[1] - p[1]), xi, zeta


@borrowing
def carry(s: Any, x: Any, aux: Any, drift: int, lever: Any, e: Any) -> None:
    """Turn errors `e` (n,) beyond a correction into those left after it, in place; the others as of :func:`reset`, before it."""
    q, psi, w = (s[0], s[1], s[2], s[3]), x[_PHI + 2], _earth_rate(s)
    after, shown = _attitude_after(q, x), _shown((s[4], s[5], s[6]), _drift_of(s, aux, drift))
    shown_after = _shown_after(shown, x, _drift_of(s, x, drift))
    p, d = e[_PHI + 2], _drift_of(s, e, drift)
    xi = _turned(psi, (e[_DV] - d[0] - p * shown[1], e[_DV + 1] - d[1] + p * shown[0], e[_DV + 2]))
    zeta = (x[_DP] - psi * lever[1], x[_DP + 1] + psi * lever[0])
    way = _turned(psi, (lever[0] - zeta[0], lever[1] - zeta[1], 0.0))
    place = _turned(psi, (e[_DP] - p * lever[1], e[_DP + 1] + p * lever[0], 0.0))
    was, now = _back(q, (-w[1], w[0], 0.0)), _back(after, (-w[1], w[0], 0.0))
    e[_PHI], e[_PHI + 1], _ = _turned(psi, (e[_PHI], e[_PHI + 1], p))
    e[_DV], e[_DV + 1] = xi[0] + p * shown_after[1] + d[0], xi[1] - p * shown_after[0] + d[1]
    e[_DP], e[_DP + 1] = place[0] + p * way[1], place[1] - p * way[0]
    for i in range(3):
        e[_BG + i] += lever[2] * p * (now[i] - was[i])


@borrowing
def _transpose(M: Any) -> None:
    for i in range(M.shape[0]):
        for j in range(i):
            M[i, j], M[j, i] = M[j, i], M[i, j]


@borrowing
def reset(s: Any, x: Any, aux: Any, drift: int, lever: Any, P: Any) -> None:
    """Prepare a correction for being fed back along the curve on which the body's sensors see the same.

    Parameters
    ----------
    s : (24,) array
        The state before the correction, see :mod:`truenorth.strapdown.wander`.
    x : (n,) array
        The estimated errors; those of attitude, velocity and gyro bias become what takes them where they belong.
    aux : (n,) array
        What is assumed of the sensors, each in its state's place.
    drift : int
        First state of a log's drift along east and north; -1 where it has none.
    lever : tuple of 3, m and 1
        Of :func:`lever_of`, and :func:`share_of_gyros` by the covariance before the correction was found.
    P : (N, N) array
        Their covariance, carried to the errors left.
    """
    for _ in range(2):  # the rows of P, then those of (P D')': D P D'
        for j in range(P.shape[0]):
            carry(s, x, aux, drift, lever, P[j])
        _transpose(P)
    for i in range(P.shape[0]):
        for j in range(i):
            P[j, i] = P[i, j]
    q, v, psi, w = (s[0], s[1], s[2], s[3]), (s[4], s[5], s[6]), x[_PHI + 2], _earth_rate(s)
    d, off, after = _drift_of(s, aux, drift), _drift_of(s, x, drift), _attitude_after(q, x)
    shown_after, seen = _shown_after(_shown(v, d), x, off), _turned(-psi, w)
    chord = _back(q, (w[0] - seen[0] + psi * w[1], w[1] - seen[1] - psi * w[0], 0.0))
    _, place, _, _ = beyond_tangent(s, x, aux, drift, lever)
    x[_DP], x[_DP + 1] = place
    for i in range(3):
        x[_DV + i] = v[i] - (shown_after[i] - d[i] - off[i])
        x[_BG + i] += lever[2] * chord[i]
    x[_PHI], x[_PHI + 1], x[_PHI + 2] = rotation_vector_of(quaternion_product(after, (q[0], -q[1], -q[2], -q[3])))


@borrowing
def keep_reset(s: Any, x: Any, aux: Any, drift: int, lever: Any, D: Any) -> None:
    """Fill in `D` (n, n), by which :func:`reset` will carry errors to those that are left."""
    for j in range(len(D)):
        for i in range(len(D)):
            D[j, i] = 1.0 * (i == j)
        carry(s, x, aux, drift, lever, D[j])
    _transpose(D)
