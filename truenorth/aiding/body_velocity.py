"""What an odometer or a Doppler log gives an INS: velocity in the vehicle's axes, scale and mounting angles unknown.

The sensor's axes m are the vehicle's (x right, y forward, z up), turned against the IMU's body by ``C_mb`` and displaced
by a lever arm l. What it shows, with the scale factor k, the mounting angles mu left in ``C_mb`` (``C_mb true = (I - [mu
x]) C_mb assumed``; that about the forward axis cannot be seen from forward motion and is no state), a constant error and a lag:

    y = (1 + k) C_mb u + bias - tau dy/dt,   u = C' v + w x l
    dy/dt = (1 + k) C_mb (C' a - w x C' v): the axes turn as well, in a steady turn nothing changes
    z = y_hat - y = (1 + k) C_mb (C' dv - C' v x phi + eps x l - w x dl) - y/(1+k) dk - y x dmu - dbias + dy/dt dtau

A log in the water shows the velocity against it: a drift d, east and north, adds ``(1 + k) C_mb C' d`` to y.

A wheel does not slide sideways nor leave the road: components 0 of y are measurements too (non-holonomic constraint). They hold
at every moment, whatever the clock of the counter: they have no lag. With one, a body that pitches on its springs by p at w rad/s,
at a speed v, on an arm l, would show ``v p`` where the lag's column is ``l p''``, and a clock that is late by ``v / (l w^2)``.

Source: P. Groves, "Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed. (2013), sec.
15.2.3, 15.4.1 and 6.3; signs mapped to ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.aiding.row import (
    ARM,
    AT_ARM,
    AT_BIAS,
    AT_LAG,
    AT_MOUNT,
    AT_OWN,
    AT_SCALE,
    BODY_FRAME,
    MOUNT,
    OWN,
    Row,
    lag_now,
    row,
    state_of,
    with_state,
)
from truenorth.core.attitude import cross, quaternion_from_rotation_vector, rotate, times_back
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_C, NOW_NORTH, NOW_PUSH, NOW_TURN, matrix_of, vector_of

_PHI, _DV, _BG = 0, 3, 9


@compiled
def body_velocity_row(
    s: Any,  # as of :func:`truenorth.aiding.position.position_row`; z in m/s
    C: Any,
    w_b: Any,  # tuple of 3, rad/s; rate of the body against the earth, body axes
    push: Any,  # tuple of 3, m/s^2; change of the velocity along w
    C_mb: Any,  # (3, 3): body to vehicle axes, as assumed now
    arm: Any,  # as assumed now: m in body axes, 1, m/s, s
    scale: float,
    bias: Any,
    lag: float,
    aside: float,  # the part of it that components 0 and 2 have: 0 where they are no measurements but constraints, else 1
    at_arm: int,  # the first state of each; -1: none. The mounting angles are those about x and z.
    at_scale: int,
    at_mount: int,
    at_bias: int,
    at_lag: int,
    measured: Any,  # (3,) m/s: right, forward, up
    H: Any,
    z: Any,
) -> None:
    """Velocity in the vehicle's axes."""
    gain = 1.0 + scale
    v = times_back(C, (s[4], s[5], s[6]))
    change = times_back(C, push)  # of the velocity as its axes do not turn
    swing = cross(w_b, v)  # and as they do: in a steady turn nothing changes sideways
    u = cross(w_b, arm)
    late = (aside * lag, lag, aside * lag)
    forward, sideways = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)  # the whole velocity, as late as either
    for k in range(3):
        counted, held = v[k] + u[k] + late[1] * swing[k], v[k] + u[k] + late[0] * swing[k]
        m = (C_mb[0, k], C_mb[1, k], C_mb[2, k])
        forward = (forward[0] + m[0] * counted, forward[1] + m[1] * counted, forward[2] + m[2] * counted)
        sideways = (sideways[0] + m[0] * held, sideways[1] + m[1] * held, sideways[2] + m[2] * held)
    y = (sideways[0], forward[1], sideways[2])
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        along, tilt = times_back(C, e), times_back(C, cross((s[4], s[5], s[6]), e))
        along_late, tilt_late = cross(w_b, along), cross(w_b, tilt)
        turn, turn_late, sweep = cross(e, arm), cross(e, v), cross(w_b, e)
        aslant = cross(sideways, e)
        mount = (aslant[0], cross(forward, e)[1], aslant[2])
        for i in range(3):
            for k in range(3):
                M = gain * C_mb[i, k]
                H[i, _DV + j] += M * (along[k] + late[i] * along_late[k])
                H[i, _PHI + j] -= M * (tilt[k] + late[i] * tilt_late[k])
                H[i, _BG + j] += M * (turn[k] + late[i] * turn_late[k])
                if at_arm >= 0:
                    H[i, at_arm + j] -= M * sweep[k]
            if at_mount >= 0 and j != 1:
                H[i, at_mount + j // 2] = -gain * mount[i]
        if at_scale >= 0:
            H[j, at_scale] = -y[j]
        if at_bias >= 0:
            H[j, at_bias + j] = -1.0
    for i in range(3):
        z[i] = gain * y[i] + bias[i] - measured[i]
        for k in range(3):
            M = gain * C_mb[i, k]
            z[i] -= late[i] * M * change[k]
            if at_lag >= 0:
                H[i, at_lag] += (1.0 if i == 1 else aside) * M * (change[k] - swing[k])


@compiled
def _drift(now: Any, C_mb: Any, gain: float, at: int, assumed: Any, H: Any, z: Any) -> None:
    """Add a drift east and north, which the hull turns."""
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    C = matrix_of(now, NOW_C)
    for j in range(2):
        along = times_back(C, (c, -s, 0.0)) if j == 0 else times_back(C, (s, c, 0.0))
        for i in range(3):
            shown = gain * (C_mb[i, 0] * along[0] + C_mb[i, 1] * along[1] + C_mb[i, 2] * along[2])
            z[i] += shown * assumed[at + j]
            H[i, at + j] = -shown


@compiled
def vehicle_velocity(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any) -> Any:
    """Fill in the row but for what is its own; ``C_mb`` (3, 3) as assumed now."""
    arm = with_state(figures, ARM, assumed, at[AT_ARM])
    bias, angles = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if at[AT_BIAS] >= 0:
        bias = vector_of(assumed, at[AT_BIAS])
    if at[AT_MOUNT] >= 0:
        angles = (-assumed[at[AT_MOUNT]], 0.0, -assumed[at[AT_MOUNT] + 1])
    q = quaternion_from_rotation_vector(angles)
    C_mb = np.empty((3, 3))
    for j in range(3):
        axis = (figures[MOUNT + j], figures[MOUNT + 3 + j], figures[MOUNT + 6 + j])
        C_mb[0, j], C_mb[1, j], C_mb[2, j] = rotate(q, axis)
    body_velocity_row(
        now,
        matrix_of(now, NOW_C),
        vector_of(now, NOW_TURN),
        vector_of(now, NOW_PUSH),
        C_mb,
        arm,
        state_of(assumed, at[AT_SCALE]),
        bias,
        lag_now(now, assumed, at[AT_LAG]),
        1.0 - figures[OWN],
        at[AT_ARM],
        at[AT_SCALE],
        at[AT_MOUNT],
        at[AT_BIAS],
        at[AT_LAG],
        measured,
        H,
        z,
    )
    return C_mb


@row
def _body_velocity(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    C_mb = vehicle_velocity(now, figures, at, assumed, measured, H, z)
    if at[AT_OWN] >= 0:
        _drift(now, C_mb, 1.0 + state_of(assumed, at[AT_SCALE]), at[AT_OWN], assumed, H, z)


BODY_VELOCITY = Row(
    "body velocity",
    _body_velocity,
    {"lever arm": 3, "scale": 1, "mounting": 2, "bias": 3, "lag": 1, "own": 2},
    axes=BODY_FRAME,
    swings=True,
)
