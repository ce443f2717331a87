"""What a wheel gives an INS: forward speed, and a path from which the body leans no more than its tyres and springs give.

The row is that of :mod:`truenorth.aiding.body_velocity`. Its constraints (a wheel neither slides sideways nor leaves the road) are
those of the wheel's path. A tyre runs askew by an angle that grows with the force across, and springs let the body dip its
nose by the force along. With f the specific force in the vehicle's axes (x right, y forward), V the speed and the compliances
c (of tyres and of springs), the velocity of the wheel's hub along the body's axes is

    y = (-c_tyres f_x V, V, -c_springs f_y V)
    z = y_hat - y:  z_x += c_tyres f_x V,  z_z += c_springs f_y V,   H = -f_x V dc_tyres, -f_y V dc_springs

An axle leans by 1 to 5 deg/g, a body by 2 to 4 deg/g: at 20 m/s and 1 m/s^2 .1 m/s, the same way in each bend and at each braking,
which no white noise stands for. Gravity's part of the force counts, as on a slope and in a bank it does. Of the body's own swing on
its springs (1 to 2 Hz), and quicker, this does not hold: where the IMU's whole log is there, quick motion, index q, is taken off y
and f (:mod:`truenorth.aiding.sprung`); else it is noise. What a bias of an accelerometer adds to the force is left
out: 1 mg of it makes 1 mm/s at 20 m/s.

Source: T. Gillespie, "Fundamentals of Vehicle Dynamics" (1992), ch. 6 (cornering compliance: slip angle by lateral force); the
dip by the force along, as a state of the INS, is ours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from truenorth.aiding.body_velocity import BODY_VELOCITY, vehicle_velocity
from truenorth.aiding.row import ARM, AT_ARM, AT_MOUNT, AT_OWN, AT_SCALE, row, state_of, with_state
from truenorth.core.attitude import cross, times
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_FORCE_B, vector_of

COUNTED_FORWARD = (1.0,)  # figures of a source that counts forward speed alone: the rest are constraints
COMPLIANCE = "odometer compliance"  # the name of its states


@compiled
def _lean(C_mb: Any, f_b: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any) -> None:
    """Take off what tyres and springs give under a force, body axes."""
    if at[AT_OWN] >= 0:
        V = measured[1] / (1.0 + state_of(assumed, at[AT_SCALE]))
        f = times(C_mb, f_b)
        for i, k in ((0, 0), (2, 1)):  # across by the tyres, up by the springs
            c = assumed[at[AT_OWN] + k]
            z[i] += c * f[k] * V
            H[i, at[AT_OWN] + k] = -f[k] * V
            if at[AT_MOUNT] >= 0:  # axes that are turned find a part of gravity along them
                H[i, at[AT_MOUNT]] += c * V * cross((1.0, 0.0, 0.0), f)[k]
                H[i, at[AT_MOUNT] + 1] += c * V * cross((0.0, 0.0, 1.0), f)[k]


@row
def _wheel(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    C_mb = vehicle_velocity(now, figures, at, assumed, measured, H, z)
    _lean(C_mb, vector_of(now, NOW_FORCE_B), at, assumed, measured, H, z)


@row
def _sprung_wheel(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    C_mb = vehicle_velocity(now, figures, at, assumed, measured, H, z)
    u_q, w_q, f_q = vector_of(measured, 3), vector_of(measured, 6), vector_of(measured, 9)
    f = vector_of(now, NOW_FORCE_B)
    gain = 1.0 + state_of(assumed, at[AT_SCALE])
    swing = cross(w_q, with_state(figures, ARM, assumed, at[AT_ARM]))
    y_q = times(C_mb, (u_q[0] + swing[0], u_q[1] + swing[1], u_q[2] + swing[2]))
    for i in (0, 2):
        z[i] -= gain * y_q[i]
        if at[AT_SCALE] >= 0:
            H[i, at[AT_SCALE]] += y_q[i]
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        sweep, turn = times(C_mb, cross(w_q, e)), cross(y_q, e)
        for i in (0, 2):
            if at[AT_ARM] >= 0:
                H[i, at[AT_ARM] + j] += gain * sweep[i]
            if at[AT_MOUNT] >= 0 and j != 1:
                H[i, at[AT_MOUNT] + j // 2] += gain * turn[i]
    _lean(C_mb, (f[0] - f_q[0], f[1] - f_q[1], f[2] - f_q[2]), at, assumed, measured, H, z)


WHEEL = replace(BODY_VELOCITY, name="wheel", function=_wheel)
SPRUNG_WHEEL = replace(WHEEL, name="wheel of a sprung body", function=_sprung_wheel, width=12)
