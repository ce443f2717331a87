"""What a master INS on the same vehicle gives a slave: velocity and attitude, late, from another place and another seat.

The master is late by tau, stands at -r in the slave (r: from master to slave, slave axes) and is turned by ``C_mb`` (slave to
master axes, ``C_mb true = (I + [mu x]) C_mb assumed``); the slave's seat bends by theta:

    velocity   z = v_hat - C_hat (w_hat x r) - v_master
                 = dv + a (tau + lambda) - a' chi + a'' kappa + C [w x] dr + phi x C (w x r) - C ((eps + M w) x r)
                   + C (dk theta' x r) - db
    attitude   C_hat (C_master C_mb)' = exp(-[z x]),   z = phi - C w_nb tau - C_master mu - C theta - dm

with `a` the *master's* acceleration: the slave's holds that of the arm itself, which would tell a delay from the master's
smooth motion falsely. The rows are re-timed: they are taken at the stamp less the delay as known now, so that only what
is left of it is linearised. ``b`` and ``m`` are the master's own slow errors of velocity and attitude, east, north, up; `M` holds
scale factors and misalignments of the gyros: of an arm of 30 m one per cent is an arm of 30.3 m. A filter that the master's
velocity went through makes it late by ``lambda``, the mean of its impulse response, and flatter by ``chi`` and ``kappa``, parts of
the variance and the third moment of that (:mod:`truenorth.alignment.transfer_smoothed`). Where the seat bends, `w` is that of the
chord of the arm, ``w - (1 - k) theta'`` (:mod:`truenorth.errors.bending`).

Sources: Xia Jiahe et al., "Study on transfer alignment algorithm considering space-time difference", Navigation Positioning
and Timing 3 (2016), eq. 6-9, corrected: a zero column is missing in its (9); the sign of tau in its (8) is that of (9) when
the reference is late; J. Kain, J. Cloutier, "Rapid transfer alignment for tactical weapon applications", AIAA GNC 1989
(velocity and attitude matching, flexure).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from truenorth.aiding.position import convergence, into_north
from truenorth.aiding.row import (
    ARM,
    AT_ARM,
    AT_BIAS,
    AT_FILTER,
    AT_FLEXURE,
    AT_LAG,
    AT_MOUNT,
    AT_OWN,
    MOUNT,
    OWN,
    Row,
    beyond_noise,
    by_axes,
    idle_part,
    lag_now,
    row,
    state_of,
    with_state,
)
from truenorth.aiding.velocity import velocity_row
from truenorth.core.attitude import (
    cross,
    quaternion_from_rotation_vector,
    quaternion_product,
    rotate,
    times,
    times_back,
)
from truenorth.core.compiled import compiled
from truenorth.state.now import (
    NOW_C,
    NOW_EARTH,
    NOW_FORCE,
    NOW_NORTH,
    NOW_OTHER_RATE,
    NOW_RATE,
    NOW_SPIN,
    matrix_of,
    vector_of,
)
from truenorth.strapdown.wander import acceleration, curvature, earth_axis

_PHI, _DP, _BG = 0, 6, 9


@compiled
def from_north(now: Any, v: Any) -> Any:
    """A vector of east, north, up along w; tuples."""
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    return c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]


@compiled
def into_n(now: Any, v: Any) -> Any:
    """A vector along w, of east, north, up; tuples."""
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@compiled
def turned_from_north(now: Any, q: Any, first: int) -> Any:
    """An attitude against east, north, up (four numbers of a vector), against w: a quaternion, tuple."""
    # w is turned against ENU about up: x = c E + s N.
    half = 0.5 * math.atan2(now[NOW_NORTH], now[NOW_NORTH + 1])
    turn = (math.cos(half), 0.0, 0.0, -math.sin(half))
    return quaternion_product(turn, (q[first], q[first + 1], q[first + 2], q[first + 3]))


@row
def _velocity(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    """Measured: velocity; the master's acceleration, or the slave's spin; its attitude to linearise with; its rate; or NaN.

    Then the columns of delay and arm (n, 3 x 4, by rows), and by what ``C [w x]`` is to be multiplied (3 x 4) to be what of the
    instant's noise is in them, or NaN (:mod:`truenorth.alignment.transfer_columns`). Last the
    derivatives of velocity of which a filter makes it flatter, m/s^3 and m/s^4, n, and how much before its stamp the row is taken
    already since a filter made it late, s; or NaN. At the very end how fast the seat bends, rad/s, body axes, or NaN.

    Acceleration and attitude (quaternion) are of n. Without either, the spin is that of the instant. The rate is what its gyros
    say, in body axes, without what vibrates (:mod:`truenorth.alignment.transfer_shaken`); else that of the instant.

    Columns of the arm are of a rate with another noise than that of `z`: one that is in both (4 cm/s of an industrial gyro at
    37 m) is taken for an arm that is too long, .6 m of it. Its own figures: the variance of a component of that rate; and 1 where
    the slave's spin is measured, rad/s^2, 2 where the acceleration is not known (:mod:`truenorth.alignment.transfer_turns`); the
    coupling of a seat that bends (3).
    """
    if np.isnan(measured[0]):
        return
    r = with_state(figures, ARM, assumed, at[AT_ARM])
    C, w, spin, f = matrix_of(now, NOW_C), vector_of(now, NOW_RATE), vector_of(now, NOW_SPIN), vector_of(now, NOW_FORCE)
    earth = vector_of(now, NOW_EARTH)
    still, other = times_back(C, earth), vector_of(now, NOW_OTHER_RATE)
    if not np.isnan(measured[10]):
        w = (measured[10] - assumed[_BG], measured[11] - assumed[_BG + 1], measured[12] - assumed[_BG + 2])
        other = w
    off = by_axes(assumed, at[AT_OWN], w)
    w = (w[0] - off[0], w[1] - off[1], w[2] - off[2])
    bends = not np.isnan(measured[44])
    if bends:
        idle = idle_part(figures, OWN + 2, assumed, at[AT_FLEXURE], measured, 44)
        w = (w[0] - idle[0], w[1] - idle[1], w[2] - idle[2])
        other = (other[0] - idle[0], other[1] - idle[1], other[2] - idle[2])
    w_eb = (w[0] - still[0], w[1] - still[1], w[2] - still[2])
    push = (0.0, 0.0, 0.0)
    if not np.isnan(measured[3]) and figures[OWN + 1] == 0.0:
        push = from_north(now, (measured[3], measured[4], measured[5]))
    elif figures[OWN + 1] < 2.0:
        if not np.isnan(measured[3]):
            spin = vector_of(measured, 3)
        force = times(C, f)
        if not np.isnan(measured[6]):
            force = rotate(turned_from_north(now, measured, 6), f)
        swing, roll = cross(w, cross(w, r)), cross(spin, r)
        arms = times(C, (swing[0] + roll[0], swing[1] + roll[1], swing[2] + roll[2]))
        own = acceleration(now, force, False)
        push = (own[0] - arms[0], own[1] - arms[1], own[2] - arms[2])
    away = (-r[0], -r[1], -r[2])
    lag = lag_now(now, assumed, at[AT_LAG]) + state_of(assumed, at[AT_FILTER])
    lag -= 0.0 if np.isnan(measured[43]) else measured[43]
    nothing = (0.0, 0.0, 0.0)
    velocity_row(now, C, w_eb, push, away, nothing, nothing, nothing, lag, -1, at[AT_LAG], measured, H, z)
    if at[AT_ARM] >= 0:
        turn = (other[0] - still[0], other[1] - still[1], other[2] - still[2])
        seen = beyond_noise(turn, figures[OWN])
        for j in range(3):
            m = into_n(now, times(C, cross(turn, (seen * (j == 0), seen * (j == 1), seen * (j == 2)))))
            a = at[AT_ARM] + j
            H[0, a], H[1, a], H[2, a] = m[0], m[1], m[2]
    if not np.isnan(measured[13]):
        for j in range(4):
            a = at[AT_LAG] if j == 0 else at[AT_ARM]
            if a >= 0:
                m = into_n(now, times(C, cross(w_eb, (measured[25 + j], measured[29 + j], measured[33 + j]))))
                a += max(0, j - 1)
                for i in range(3):
                    H[i, a] = measured[13 + 4 * i + j] - m[i]
    if bends and at[AT_FLEXURE] >= 0:
        for j in range(3):
            rate = measured[44 + j]
            m = into_n(now, times(C, cross((rate * (j == 0), rate * (j == 1), rate * (j == 2)), r)))
            for i in range(3):
                H[i, at[AT_FLEXURE] + j] = m[i]
    if at[AT_FILTER] >= 0:
        a, late = at[AT_FILTER], into_n(now, push)
        for i in range(3):
            H[i, a] = H[i, at[AT_LAG]] if at[AT_LAG] >= 0 else late[i]
            if not (np.isnan(measured[37]) or np.isnan(measured[40])):
                H[i, a + 1], H[i, a + 2] = -measured[37 + i], measured[40 + i]
                z[i] -= H[i, a + 1] * assumed[a + 1] + H[i, a + 2] * assumed[a + 2]
    if at[AT_OWN] >= 0:  # as biases of the gyros; by a rate of another noise, as the arm
        seen = beyond_noise(other, figures[OWN])
        for i in range(3):
            for j in range(3):
                for k in range(3):
                    H[i, at[AT_OWN] + 3 * j + k] = seen * H[i, _BG + j] * other[k]
    if at[AT_BIAS] >= 0:
        for j in range(3):
            z[j] += assumed[at[AT_BIAS] + j]
            H[j, at[AT_BIAS] + j] = -1.0


@row
def _attitude(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    """Measured: the master's attitude against n (quaternion); the turn from it to the one to linearise with; a rate of the slave.

    The turn is a rotation vector in n; the rate is what its gyros say, body axes, or NaN: that of the instant. Its own figure: the
    variance of a component of the rate, (rad/s)^2. A turn within that noise tells of no delay: the squares of
    its column would be taken for knowledge, that of 60 ms in 200 s of straight flight of a tactical IMU.
    """
    if np.isnan(measured[0]):
        return
    C = matrix_of(now, NOW_C)
    # The seat as assumed: mounting, then what it bends, then the given axes.
    mount, bend = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if at[AT_MOUNT] >= 0:
        mount = vector_of(assumed, at[AT_MOUNT])
    if at[AT_FLEXURE] >= 0:
        bend = vector_of(assumed, at[AT_FLEXURE])
    q_mount, q_bend = quaternion_from_rotation_vector(mount), quaternion_from_rotation_vector(bend)
    q_m = turned_from_north(now, measured, 0)
    q_linear = quaternion_product(quaternion_from_rotation_vector(from_north(now, vector_of(measured, 4))), q_m)
    error = (0.0, 0.0, 0.0)
    if at[AT_BIAS] >= 0:
        b = vector_of(assumed, at[AT_BIAS])
        error = from_north(now, b)
    q_error = quaternion_from_rotation_vector(error)
    sine, cosine, zx, zy, zz = 0.0, -0.5, 0.0, 0.0, 0.0
    for k in range(3):  # z: axis times sine of C reference', column by column
        e = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
        b_k = rotate(q_bend, e)
        a_k = (
            figures[MOUNT] * b_k[0] + figures[MOUNT + 1] * b_k[1] + figures[MOUNT + 2] * b_k[2],
            figures[MOUNT + 3] * b_k[0] + figures[MOUNT + 4] * b_k[1] + figures[MOUNT + 5] * b_k[2],
            figures[MOUNT + 6] * b_k[0] + figures[MOUNT + 7] * b_k[1] + figures[MOUNT + 8] * b_k[2],
        )
        r = rotate(q_error, rotate(q_m, rotate(q_mount, a_k)))
        own = (C[0, k], C[1, k], C[2, k])
        zx += 0.5 * (own[1] * r[2] - own[2] * r[1])
        zy += 0.5 * (own[2] * r[0] - own[0] * r[2])
        zz += 0.5 * (own[0] * r[1] - own[1] * r[0])
        cosine += 0.5 * (own[0] * r[0] + own[1] * r[1] + own[2] * r[2])
    sine = math.sqrt(zx * zx + zy * zy + zz * zz)
    scale = 1.0
    if sine > 1e-12:
        scale = math.atan2(sine, cosine) / sine
    lag = lag_now(now, assumed, at[AT_LAG])
    axis = earth_axis(now)
    Kxx, Kxy, Kyy = curvature(axis, now[11])
    v, w, earth = (now[4], now[5], now[6]), vector_of(now, NOW_RATE), vector_of(now, NOW_EARTH)
    w_n = (earth[0] - (Kxy * v[0] + Kyy * v[1]), earth[1] + Kxx * v[0] + Kxy * v[1], earth[2])
    turn = times(C, w)
    turn = (turn[0] - w_n[0], turn[1] - w_n[1], turn[2] - w_n[2])
    z[0], z[1], z[2] = scale * zx + lag * turn[0], scale * zy + lag * turn[1], scale * zz + lag * turn[2]
    if not np.isnan(measured[7]):
        mean = (measured[7] - assumed[_BG], measured[8] - assumed[_BG + 1], measured[9] - assumed[_BG + 2])
        turn = times(C, mean)
        turn = (turn[0] - w_n[0], turn[1] - w_n[1], turn[2] - w_n[2])
    seen = beyond_noise(turn, figures[OWN])
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        m = rotate(q_linear, e)
        for i in range(3):
            if at[AT_MOUNT] >= 0:
                H[i, at[AT_MOUNT] + j] = -m[i]
            if at[AT_FLEXURE] >= 0:
                H[i, at[AT_FLEXURE] + j] = -C[i, j]
        H[j, _PHI + j] = 1.0
        if at[AT_LAG] >= 0:
            H[j, at[AT_LAG]] = -seen * turn[j]
    # East and north at the computed place are turned against those at the master's by the convergence of the meridians.
    H[2, _DP], H[2, _DP + 1] = convergence(now)
    into_north(now, H, z)
    if at[AT_BIAS] >= 0:
        for j in range(3):
            H[j, at[AT_BIAS] + j] = -1.0


MASTER_VELOCITY = Row(
    "master velocity",
    _velocity,
    {"lever arm": 3, "bias": 3, "lag": 1, "own": 9, "filter": 3, "flexure": 3},
    width=47,
    instant=True,
)
MASTER_ATTITUDE = Row(
    "master attitude", _attitude, {"lag": 1, "mounting": 3, "flexure": 3, "bias": 3}, width=10, instant=True, unit="rad"
)
