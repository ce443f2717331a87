"""Rows over the ground of a motion that is known in the body: along the curve on which it turns with its azimuth.

A heading that is off by ``psi`` turns velocity and way: of a way of 5 km and 15 deg the place is off by 1300 m to the side, which
the covariance holds, and by 170 m along it, which no tangent shows. A fix of 10 m is then refused, or takes those 170 m for a
wrong scale of the log. So the row is linear where the correction ends, not where it begins. With ``x`` the error along the tangent
and ``c(x)`` the one that is taken off along the curve (:mod:`truenorth.errors.azimuth_free`),

    z = H c(x) + noise,   H_i = H c'(x_i),   z_i = z - H (c(x_i) - c'(x_i) x_i),   x_{i+1} = P H_i' (H_i P H_i' + R)^-1 z_i

which is Gauss and Newton's way to the most likely x; ``z_i' S_i^-1 z_i`` is there what it costs, and the gate's measure.

A vehicle turns as a whole about the place where it began if its heading is off by the same angle all the way. With a heading that
drifts, ``p = p_0 + exp([-psi u x]) (L - zeta)`` and ``p' = exp([-psi u x]) (v_hat - xi)`` give

    zeta' = xi - psi' u x (L - zeta)

of which the covariance holds all but ``psi' u x zeta``. Its mean is ``u x cov(zeta, psi')``; of a drift of k sigmas it is k^2 times
as much, so that k sigmas hold it up to four if a sigma is four times the mean. The sum of it, ``s``, is noise of place along the
way: ``s^2`` grows as that of one cause, not of many. Without it one fix in 30 minutes was 10 to 20 sigmas off in heading.

Source: B. Bell and F. Cathey, "The iterated Kalman filter update as a Gauss-Newton method", IEEE Trans. Autom. Control 38 (1993).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.errors import azimuth_free, invariant
from truenorth.errors.azimuth_free import beyond_tangent, lever_of, share_of_gyros, turns_with_azimuth
from truenorth.estimate.memory import AS_IT_IS, EITHER, IN_BODY, Memory, Model
from truenorth.strapdown.wander import azimuth

Array = NDArray[np.float64]

_PHI, _DV, _DP = 0, 3, 6
MOST, NEAR = 20, 1e-6  # steps, and rad: a step this small is the last
SIGMAS = 4.0  # of a drift of heading that what the curve leaves out is to hold


class Bent(NamedTuple):
    """Room for rows: `H` (3, N) and `z` (3,) as they were, `x` (N,), `a` (3, N) ``H P``, `S` (3, 4)."""

    H: Array
    z: Array
    x: Array
    a: Array
    S: Array


@compiled
def bent(N: int) -> Bent:
    """Room for rows of N states."""
    return Bent(np.zeros((3, N)), np.zeros(3), np.zeros(N), np.zeros((3, N)), np.zeros((3, 4)))


@borrowing
def knows_body(model: Model, s: Any, aux: Any, P: Any) -> bool:
    """Whether a correction is fed back along the curve of what the body sees."""
    return bool(
        model.invariant == IN_BODY or (model.invariant == EITHER and turns_with_azimuth(s, aux, model.drift, P))
    )


@borrowing
def lever_now(model: Model, s: Any, lever: Any, P: Any) -> Any:
    """What :func:`truenorth.errors.azimuth_free.reset` asks for, by the lever of the loop and the covariance; a tuple of 3."""
    return lever[0], lever[1], share_of_gyros(s, model.sensors[0], P)


@borrowing
def reset(m: Memory, model: Model, in_body: bool, lever: Any, w: Any) -> None:
    """Prepare the correction `w.x` for being fed back, and carry `w.P`, as the model says; `in_body` of :func:`knows_body`."""
    if in_body:
        azimuth_free.reset(m.s, w.x, m.aux, model.drift, lever, w.P)
    elif model.invariant != AS_IT_IS:
        invariant.reset(m.s, w.x, w.P, model.fixed_altitude)


@borrowing
def keep_reset(m: Memory, model: Model, in_body: bool, lever: Any, x: Any, D: Any) -> None:
    """Fill in `D` (n, n), by which :func:`reset` will carry errors."""
    if in_body:
        azimuth_free.keep_reset(m.s, x, m.aux, model.drift, lever, D)
    elif model.invariant != AS_IT_IS:
        invariant.keep_reset(m.s, x, model.fixed_altitude, D)


@borrowing
def lengthen_lever(m: Memory, F: Any, P: Any, Q: Any) -> None:
    """Carry the lever over the interval that was predicted, and count what the curve leaves out into place.

    `F` (N, N) are the error dynamics of the interval; `Q` gathers noise for the smoother, of length 0 it does not.
    """
    T, lever = m.means.T[0], m.lever
    for i in range(2):
        lever[i] += T * m.means.vectors[1, i]
    east = north = 0.0  # covariance of the place off the curve with the rate of azimuth
    for j in range(len(F)):
        east += F[_PHI + 2, j] * (P[_DP, j] - lever[1] * P[_PHI + 2, j])
        north += F[_PHI + 2, j] * (P[_DP + 1, j] + lever[0] * P[_PHI + 2, j])
    rate = math.hypot(east, north)
    if rate == 0.0:
        return
    was, along = lever[2], (-north / rate, east / rate)
    lever[2] += SIGMAS * T * rate
    more = lever[2] * lever[2] - was * was
    for i in range(2):
        for j in range(2):
            P[_DP + i, _DP + j] += more * along[i] * along[j]
            if len(Q) > 0:
                Q[_DP + i, _DP + j] += more * along[i] * along[j]


@borrowing
def move_lever(lever: Any, x: Any, over_ground: bool, P: Any) -> None:
    """Follow a correction `x` that is about to be fed back; what shows the ground shows where the vehicle turns about, too."""
    for i in range(2):
        lever[i] -= x[_DP + i]
    if over_ground:
        lever[0], lever[1] = lever_of(P)
        lever[2] = min(lever[2], math.sqrt(P[_DP, _DP] + P[_DP + 1, _DP + 1]))


@borrowing
def bend(m: Memory, drift: int, lever: Any, w: Any, room: Bent) -> None:
    """Make `w.H`, `w.z` those rows that are linear at `room.x`."""
    x, s = room.x, m.s
    dv, dp, xi, zeta = beyond_tangent(s, x, m.aux, drift, lever)
    sine, cosine = math.sin(x[_PHI + 2]), math.cos(x[_PHI + 2])
    of_w, of_n = azimuth(s)
    for i in range(3):
        v, p = (room.H[i, _DV], room.H[i, _DV + 1]), (room.H[i, _DP], room.H[i, _DP + 1])
        # h' exp([psi u x]), of velocity and of place
        v_t = (cosine * v[0] + sine * v[1], -sine * v[0] + cosine * v[1])
        p_t = (cosine * p[0] + sine * p[1], -sine * p[0] + cosine * p[1])
        w.H[i, _DV], w.H[i, _DV + 1], w.H[i, _DP], w.H[i, _DP + 1] = v_t[0], v_t[1], p_t[0], p_t[1]
        turn = -v_t[0] * xi[1] + v_t[1] * xi[0] - p_t[0] * zeta[1] + p_t[1] * zeta[0]
        w.H[i, _PHI + 2] = room.H[i, _PHI + 2] + turn
        off = v[0] * dv[0] + v[1] * dv[1] + p[0] * dp[0] + p[1] * dp[1]
        off -= v_t[0] * x[_DV] + v_t[1] * x[_DV + 1] + p_t[0] * x[_DP] + p_t[1] * x[_DP + 1] + turn * x[_PHI + 2]
        if drift >= 0:
            d = (v[0] - v_t[0], v[1] - v_t[1])
            of_d = (of_n * d[0] - of_w * d[1], of_w * d[0] + of_n * d[1])
            for j in range(2):
                w.H[i, drift + j] = room.H[i, drift + j] + of_d[j]
                off -= of_d[j] * x[drift + j]
        w.z[i] = room.z[i] - off


@borrowing
def most_likely(size: Any, w: Any, room: Bent) -> None:
    """``x = P H' (H P H' + R)^-1 z`` of the rows that are present, by Cholesky's factor."""
    N, S = len(size), room.S
    for j in range(N):
        room.x[j] = 0.0
    for i in range(3):
        if np.isnan(w.z[i]):
            continue
        for j in range(N):
            total = 0.0
            for k in range(N):
                total += w.H[i, k] * w.P[k, j]
            room.a[i, j] = total
        S[i, 3] = w.z[i]
        for j in range(i + 1):
            if np.isnan(w.z[j]):
                continue
            total = w.R[i, i] if i == j else 0.0
            for k in range(N):
                total += room.a[i, k] * w.H[j, k]
            for k in range(j):
                if not np.isnan(w.z[k]):
                    total -= S[i, k] * S[j, k]
            if i == j:
                S[i, i] = math.sqrt(total)
            else:
                S[i, j] = total / S[j, j]
                S[i, 3] -= S[i, j] * S[j, 3]
        S[i, 3] /= S[i, i]
    for back in range(3):
        i = 2 - back
        if np.isnan(w.z[i]):
            continue
        for k in range(i + 1, 3):
            if not np.isnan(w.z[k]):
                S[i, 3] -= S[k, i] * S[k, 3]
        S[i, 3] /= S[i, i]
        for j in range(N):
            room.x[j] += room.a[i, j] * S[i, 3]


@borrowing
def follow(size: Any, m: Memory, drift: int, lever: Any, w: Any, room: Bent) -> None:
    """Make the rows of `w` linear at the correction that they and the covariance make most likely.

    Parameters
    ----------
    drift : int
        First state of a log's drift along east and north; -1 where it has none.
    lever : tuple of 3
        Of :func:`lever_now`.
    w : Workspace
        With `P`, `R`, and the rows `H`, `z` at the state that is corrected.
    """
    for i in range(3):
        room.z[i] = w.z[i]
        for j in range(len(size)):
            room.H[i, j] = w.H[i, j]
    was = 0.0
    for _ in range(MOST):
        most_likely(size, w, room)
        bend(m, drift, lever, w, room)
        now = room.x[_PHI + 2]
        if abs(now - was) < NEAR:
            return
        was = now
