"""Velocity of an antenna or of a log that knows north, as a row of the closed loop; see :mod:`truenorth.aiding.position`.

Its own states are a drift east and north (:mod:`truenorth.errors.log`): ``z = v_hat + d - measured``.

An antenna moves by ``w x l`` besides its vehicle. A receiver that filters its velocities does not show all of what is quick in
that: with q the part of w that is quicker than its filter, and d the arm whose swing it leaves out, it shows

    y = v + C (w x l - q x d):  z = y_hat - y = ... - C (w x dl) + C dD q,  D q = q x d

A filter shows less of a swing the quicker it is, and each axis swings in its own time: so there is a d for the rate about each
axis, and ``q x d`` has six numbers. What gyros that are askew by M do to the quick part, ``C (M q x l)``, is among them: how much
of it is shown nobody knows either. Along an axis that a swing about it does not move it is three more: all is ``C D q``, D any
matrix. With one d for all, a roll that is shown otherwise than a pitch made a gyro's scale six times what its specification says.

So an arm that nobody has said is known by slow turns and by places, and what is quick says how much of it is shown, l - d, alone.
Else the swing that is missing would be a shorter arm (ours; :mod:`truenorth.quality.swing`).

An antenna that is shown late is that of an earlier moment, swing and all. Of a vehicle that hardly pushes, a ship in a swell, the
swing is what says how late; with s the part of w that is slow, a swell,

    y(t - tau) = y - tau (dv/dt + C (s' x l + s x (s x l)))

Without the second term a mast of 7 m that rolls by 8 deg in 9 s, shown .5 s late, leaves .2 m/s that no delay explains (ours).

Of an antenna that shakes more quickly than its delay is known that is so of all of w, and of the IMU itself, which shakes too: the
mean push since the last event is not that of the moment (:mod:`truenorth.estimate.moment`).

A receiver counts metres by seconds of its own. Where those run apart from the IMU's, its delay grows by r a second, and of the
velocity y by the IMU's seconds it shows ``(1 - r) y``. Without this a place and a velocity that agree in the receiver's seconds
would say that the clocks do.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from truenorth.aiding.position import convergence, into_north
from truenorth.aiding.row import (
    ARM,
    AT_ARM,
    AT_BIAS,
    AT_FILTER,
    AT_LAG,
    AT_OWN,
    OWN,
    Row,
    by_axes,
    lag_now,
    row,
    with_state,
)
from truenorth.core.attitude import cross, times
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_C, NOW_FORCE_B, NOW_PUSH, NOW_TURN, matrix_of, vector_of

_PHI, _DV, _DP, _BG = 0, 3, 6, 9


@compiled
def velocity_row(
    s: Any,
    C: Any,
    w_b: Any,
    push: Any,
    arm: Any,
    unseen: Any,
    slow: Any,
    spin: Any,
    lag: float,
    at_arm: int,
    at_lag: int,
    measured: Any,
    H: Any,
    z: Any,
) -> None:
    """Velocity of an antenna, east, north, up, m/s; as :func:`position_row`.

    Parameters
    ----------
    w_b : tuple of 3, rad/s
        Rate of the body against the earth, body axes.
    push : tuple of 3, m/s^2
        Change of the velocity along w.
    unseen : tuple of 3, m/s
        What of the swing about the IMU is not shown, body axes.
    slow, spin : tuple of 3, rad/s and rad/s^2
        The slow part of `w_b`, and its change: the swing that a delay shows of an earlier moment.
    """
    swing, pull, across = cross(w_b, arm), cross(spin, arm), cross(slow, cross(slow, arm))
    u_b = (swing[0] - unseen[0], swing[1] - unseen[1], swing[2] - unseen[2])
    grown_b = (pull[0] + across[0], pull[1] + across[1], pull[2] + across[2])
    grown = times(C, grown_b)
    u = times(C, (u_b[0] - lag * grown_b[0], u_b[1] - lag * grown_b[1], u_b[2] - lag * grown_b[2]))
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        c = cross(u, e)
        g, m, p, a = cross(e, arm), cross(w_b, e), cross(spin, e), cross(slow, cross(slow, e))
        m = (m[0] - lag * (p[0] + a[0]), m[1] - lag * (p[1] + a[1]), m[2] - lag * (p[2] + a[2]))
        for i in range(3):
            H[i, _PHI + j] = c[i]
            H[i, _DV + j] = e[i]
            H[i, _BG + j] = C[i, 0] * g[0] + C[i, 1] * g[1] + C[i, 2] * g[2]
            if at_arm >= 0:
                H[i, at_arm + j] = -(C[i, 0] * m[0] + C[i, 1] * m[1] + C[i, 2] * m[2])
        if at_lag >= 0:
            H[j, at_lag] = push[j] + grown[j]
        z[j] = s[4 + j] + u[j] - lag * push[j]
    turn = convergence(s)
    for j in range(2):
        H[0, _DP + j] = turn[j] * z[1]
        H[1, _DP + j] = -turn[j] * z[0]
    into_north(s, H, z)
    for j in range(3):
        z[j] -= measured[j]


@compiled
def _shown(
    now: Any,
    figures: Any,
    at: Any,
    assumed: Any,
    measured: Any,
    push: Any,
    unseen: Any,
    slow: Any,
    spin: Any,
    H: Any,
    z: Any,
) -> None:
    """Velocity of an antenna without what of its swing is not shown, with its slow errors."""
    arm = with_state(figures, ARM, assumed, at[AT_ARM])
    lag = lag_now(now, assumed, at[AT_LAG])
    C, w_b = matrix_of(now, NOW_C), vector_of(now, NOW_TURN)
    velocity_row(now, C, w_b, push, arm, unseen, slow, spin, lag, at[AT_ARM], at[AT_LAG], measured, H, z)
    if figures[OWN] > 0.0 and at[AT_LAG] >= 0:  # the delay grows
        rate = at[AT_LAG] + 1
        for j in range(3):
            if not math.isnan(measured[j]):
                y = z[j] + measured[j]
                H[j, rate] = y
                z[j] -= assumed[rate] * y
    if at[AT_OWN] >= 0:
        for j in range(2):
            z[j] += assumed[at[AT_OWN] + j]
            H[j, at[AT_OWN] + j] = -1.0
    if at[AT_BIAS] >= 0:
        for j in range(3):
            z[j] += assumed[at[AT_BIAS] + j]
            H[j, at[AT_BIAS] + j] = -1.0


@row
def _velocity(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    nothing = (0.0, 0.0, 0.0)
    _shown(now, figures, at, assumed, measured, vector_of(now, NOW_PUSH), nothing, nothing, nothing, H, z)


@compiled
def _with_swing(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, push: Any, H: Any, z: Any) -> None:
    """Velocity of an antenna without the part of its swing that is a state, and with that of an earlier moment."""
    C, quick, unseen = matrix_of(now, NOW_C), vector_of(measured, 3), (0.0, 0.0, 0.0)
    if at[AT_FILTER] >= 0:
        a = at[AT_FILTER]
        unseen = by_axes(assumed, a, quick)
        for j in range(3):
            for i in range(3):
                for k in range(3):
                    H[i, a + 3 * j + k] = C[i, j] * quick[k]
    slow, spin = vector_of(measured, 6), vector_of(measured, 9)
    _shown(now, figures, at, assumed, measured, push, unseen, slow, spin, H, z)


@row
def _smoothed(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    _with_swing(now, figures, at, assumed, measured, vector_of(now, NOW_PUSH), H, z)


@row
def _shaken(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    force, mean, push = vector_of(measured, 12), vector_of(now, NOW_FORCE_B), vector_of(now, NOW_PUSH)
    jolt = times(matrix_of(now, NOW_C), (force[0] - mean[0], force[1] - mean[1], force[2] - mean[2]))
    push = (push[0] + jolt[0], push[1] + jolt[1], push[2] + jolt[2])
    _with_swing(now, figures, at, assumed, measured, push, H, z)


VELOCITY = Row("velocity", _velocity, {"lever arm": 3, "lag": 1, "bias": 3, "own": 2}, swings=True)
# As measured: velocity; the rate of the body less its mean over what the receiver filters, rad/s; its slow part, and the change of
# that, rad/s^2: all in body axes.
SMOOTHED_VELOCITY = replace(
    VELOCITY, name="smoothed velocity", function=_smoothed, sizes={**VELOCITY.sizes, "filter": 9}, width=12
)
# The same with all of the rate in the place of its slow part; besides, the specific force of this moment, m/s^2, body axes.
SHAKEN_VELOCITY = replace(SMOOTHED_VELOCITY, name="shaken velocity", function=_shaken, width=15)
