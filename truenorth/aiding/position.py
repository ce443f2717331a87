"""What GNSS gives an INS: position and velocity of an antenna, written once, as compiled functions of one epoch.

A row is *predicted less measured*, so that ``z = H x + noise`` with the states of :mod:`truenorth.errors.ins` (errors
computed minus true; what is left of a parameter, true minus assumed). With the lever arm l (body axes) and the clock lag
tau (the measurement shows the antenna as it was tau before its time stamp):

    position   z = dp - tau dv + (C l - tau u) x phi - tau C (eps x l) - C (dl - tau w x dl) + (v - tau a + u) dtau - dbias
    velocity   z = dv + u x phi + C (eps x l) - C (w x dl) + a dtau,   u = C (w x l)

What is late is the antenna, not the vehicle: on the roof of a tractor that rolls it moves by as much as the tractor drives, and of
a fix of a centimetre .02 s of that are two. Rates are noisy, and what is within their noise tells of no delay: the column of the
delay has a rate of its own, whose noise is not in z. And what is linear in a delay is so of one that is short against the swing: of
a receiver .8 s late on a cart that shakes its mast once a second, it says nothing of where the mast was. Such a delay is found by
the vehicle's way alone, and the next pass begins with it.

That way is a curve: a place is predicted as ``p - tau v + a tau^2/2``. Of an aircraft that turns by 4.6 m/s^2, shown .4 s late, the
tangent is off by .4 m, which fixes of centimetres take for a delay that grows.

A receiver that starts up errs by metres for a while, and says so row by row. Its own state is that error in parts of what the row
says, x of a variance of one: ``z = ... - s dx``, so that the error of two rows differs as what they say does
(:mod:`truenorth.quality.converging`).

Rows are in ENU. A velocity is measured in the axes at the true place; those at the computed place are turned against them
by the convergence of the meridians, ``tan L dp_E/R`` about up.

Source: P. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed. (2013), sec.
14.3.2 and 14.3.3; signs mapped to ours.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from truenorth.aiding.row import ARM, AT_ARM, AT_BIAS, AT_LAG, AT_OWN, Row, beyond_noise, lag_now, row, with_state
from truenorth.core.attitude import cross, rotate, times, times_back
from truenorth.core.compiled import compiled
from truenorth.state.now import (
    NOW_C,
    NOW_EARTH,
    NOW_OTHER_RATE,
    NOW_PUSH,
    NOW_RATE_NOISE,
    NOW_TURN,
    matrix_of,
    vector_of,
)
from truenorth.strapdown.wander import azimuth, curvature, earth_axis

_PHI, _DV, _DP, _BG = 0, 3, 6, 9
_SHORT = 0.5  # s, of a delay: a quarter of a swing of two seconds


@compiled
def into_north(s: Any, H: Any, z: Any) -> None:
    """Turn three rows along w into east, north, up."""
    sine, cosine = azimuth(s)
    for j in range(H.shape[1]):
        x, y = H[0, j], H[1, j]
        H[0, j] = cosine * x - sine * y
        H[1, j] = sine * x + cosine * y
    x, y = z[0], z[1]
    z[0] = cosine * x - sine * y
    z[1] = sine * x + cosine * y


@compiled
def convergence(s: Any) -> Any:
    """Of the meridians: by what north turns a metre along x and y of w, rad/m, two numbers."""
    sine, cosine = azimuth(s)
    axis = earth_axis(s)
    Kxx, Kxy, Kyy = curvature(axis, s[11])
    east = cosine * cosine * Kxx - 2.0 * sine * cosine * Kxy + sine * sine * Kyy  # curvature along east
    level = math.sqrt(axis[0] * axis[0] + axis[1] * axis[1])
    rate = 0.0
    if level > 0.0:
        rate = axis[2] / level * east
    return rate * cosine, -rate * sine


@compiled
def position_row(
    s: Any,  # (24,): the state, see :mod:`truenorth.strapdown.wander`
    C: Any,  # (3, 3): ``C_wb``
    w_b: Any,  # tuple of 3, rad/s: rate of the body against the earth, body axes
    turn: Any,  # the same for the column of the delay: what of another rate is beyond its noise
    push: Any,  # tuple of 3, m/s^2: change of the velocity along w
    arm: Any,  # tuple of 3, m; IMU to antenna, body axes
    lag: float,  # s
    bias: Any,  # tuple of 3, m; East, north, up: what the receiver is off by for minutes
    at_arm: int,  # the first state of lever arm, lag and bias; -1: none
    at_lag: int,
    at_bias: int,
    measured: Any,  # (3,): latitude, longitude (rad), height (m)
    H: Any,  # (3, N): zeros; filled in
    z: Any,  # (3,) m: filled in
) -> None:
    """Position of an antenna."""
    lat, lon = measured[0], measured[1]
    level = math.cos(lat)
    back = (s[7], -s[8], -s[9], -s[10])
    n = rotate(back, (level * math.cos(lon), level * math.sin(lon), math.sin(lat)))
    # The measured place's normal leans by K dr from ours.
    Kxx, Kxy, Kyy = curvature(earth_axis(s), s[11])
    determinant = Kxx * Kyy - Kxy * Kxy
    swing, shown = cross(w_b, arm), times(C, cross(turn, arm))
    out = times(C, (arm[0] - lag * swing[0], arm[1] - lag * swing[1], arm[2] - lag * swing[2]))
    half = 0.5 * lag
    z[0] = -(Kyy * n[0] - Kxy * n[1]) / determinant + out[0] - lag * (s[4] - half * push[0])
    z[1] = -(Kxx * n[1] - Kxy * n[0]) / determinant + out[1] - lag * (s[5] - half * push[1])
    z[2] = s[11] - measured[2] + out[2] - lag * (s[6] - half * push[2])
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        c, g, m = cross(out, e), times(C, cross(e, arm)), cross(w_b, e)
        m = times(C, (e[0] - lag * m[0], e[1] - lag * m[1], e[2] - lag * m[2]))
        for i in range(3):
            H[i, _PHI + j] = c[i]
            H[i, _DP + j] = e[i]
            H[i, _DV + j] = -lag * e[i]
            H[i, _BG + j] = -lag * g[i]
            if at_arm >= 0:
                H[i, at_arm + j] = -m[i]
        if at_lag >= 0:
            H[j, at_lag] = s[4 + j] - lag * push[j] + shown[j]
    into_north(s, H, z)
    for j in range(3):
        z[j] += bias[j]
        if at_bias >= 0:
            H[j, at_bias + j] = -1.0


@compiled
def _shown(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any) -> None:
    """Position of an antenna with its slow errors."""
    arm = with_state(figures, ARM, assumed, at[AT_ARM])
    bias = (0.0, 0.0, 0.0)
    if at[AT_BIAS] >= 0:
        bias = vector_of(assumed, at[AT_BIAS])
    lag = lag_now(now, assumed, at[AT_LAG])
    C = matrix_of(now, NOW_C)
    still, other = times_back(C, vector_of(now, NOW_EARTH)), vector_of(now, NOW_OTHER_RATE)
    turn = (other[0] - still[0], other[1] - still[1], other[2] - still[2])
    part = 1.0 / (1.0 + (lag / _SHORT) ** 4)
    seen = part * beyond_noise(turn, now[NOW_RATE_NOISE])
    turn = (seen * turn[0], seen * turn[1], seen * turn[2])
    w_b = vector_of(now, NOW_TURN)
    w_b = (part * w_b[0], part * w_b[1], part * w_b[2])
    push = vector_of(now, NOW_PUSH)
    push = (part * push[0], part * push[1], part * push[2])
    position_row(now, C, w_b, turn, push, arm, lag, bias, at[AT_ARM], at[AT_LAG], at[AT_BIAS], measured, H, z)


@row
def _position(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    _shown(now, figures, at, assumed, measured, H, z)


@row
def _converging(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    _shown(now, figures, at, assumed, measured, H, z)
    own = at[AT_OWN]
    if own >= 0:
        for j in range(3):
            z[j] += measured[3 + j] * assumed[own + j]
            H[j, own + j] = -measured[3 + j]


@row
def _of_known_motion(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    _shown(now, figures, at, assumed, measured, H, z)
    lag = at[AT_LAG]
    if lag >= 0:
        tau = lag_now(now, assumed, lag)
        back = tau / (1.0 + (tau / _SHORT) ** 4)
        x, y = now[4] - back * now[NOW_PUSH], now[5] - back * now[NOW_PUSH + 1]
        sine, cosine = azimuth(now)
        H[0, lag] += measured[3] - cosine * x + sine * y
        H[1, lag] += measured[4] - sine * x - cosine * y
        H[2, lag] += measured[5] - now[6] + back * now[NOW_PUSH + 2]


POSITION = Row("position", _position, {"lever arm": 3, "bias": 3, "lag": 1}, swings=True, swings_late=True, unit="m")
# As measured: latitude, longitude, height; how large the error is that a receiver has not lost yet, m, east, north, up.
CONVERGING_POSITION = replace(
    POSITION, name="converging position", function=_converging, sizes={**POSITION.sizes, "own": 3}, width=6
)
# As measured: latitude, longitude, height; the velocity that is shown, m/s, east, north, up, of which the delay's column is.
POSITION_OF_KNOWN_MOTION = replace(POSITION, name="position of a known motion", function=_of_known_motion, width=6)
