"""The heading of a line in the body: of two antennas' baseline, a compass, a gyrocompass of its own, a star, a quay.

The line b (body axes) points along ``u = C b``, and its heading is ``psi = atan2(u_E, u_N)``. With
``C_hat = (I - [phi x]) C`` its error is ``du = u x phi``, so that

    z = psi_hat(t - lag) - psi = phi_U - u_U (u_E phi_E + u_N phi_N) / (u_E^2 + u_N^2) - dpsi/db db + psi' dlag
    dpsi/db = (u_N C_E - u_E C_N) / (u_E^2 + u_N^2)

with ``psi' = dpsi/db (w x b)`` and ``C_E``, ``C_N`` rows of C. North at the computed place is turned against that at the true one
by the convergence of the meridians, ``tan L dp_E / R`` about up.

How the line sits may be two states, angles about the sensor's right and up axes, as of a wheel: ``b = forward + mu_x up - mu_z
right``. Level, that about the right axis does nothing; in a bank by 45 deg it is a heading. One error of heading for both
contradicts itself there.
"""

from __future__ import annotations

from math import atan2, pi
from typing import Any

from truenorth.aiding.position import convergence
from truenorth.aiding.row import AT_LAG, AT_MOUNT, MOUNT, Row, lag_now, row
from truenorth.core.attitude import cross, quaternion_from_rotation_vector, rotate, times
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_C, NOW_NORTH, NOW_TURN, matrix_of, vector_of

_PHI, _DP, _BG = 0, 6, 9
STEEPEST = 0.01  # square of the part of the line that is level, below which it has no heading


@compiled
def _heading_by(u: Any, change: Any, level: float) -> float:
    """By which the heading of a line `u` changes with it, rad."""
    return (u[1] * change[0] - u[0] * change[1]) / level


@row
def _heading(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    # The sensor's axes in the body.
    right, b, up = vector_of(figures, MOUNT), vector_of(figures, MOUNT + 3), vector_of(figures, MOUNT + 6)
    if at[AT_MOUNT] >= 0:
        tilt, turn = assumed[at[AT_MOUNT]], assumed[at[AT_MOUNT] + 1]
        b = (
            b[0] + tilt * up[0] - turn * right[0],
            b[1] + tilt * up[1] - turn * right[1],
            b[2] + tilt * up[2] - turn * right[2],
        )
    C, w_b = matrix_of(now, NOW_C), vector_of(now, NOW_TURN)
    lag = lag_now(now, assumed, at[AT_LAG])
    half = quaternion_from_rotation_vector((-0.5 * lag * w_b[0], -0.5 * lag * w_b[1], -0.5 * lag * w_b[2]))
    halfway = rotate(half, b)
    b = rotate(half, halfway)  # as the line was when it was measured
    u, v = times(C, b), times(C, cross(w_b, b))
    level = u[0] * u[0] + u[1] * u[1]
    if level < STEEPEST:
        return
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    said = atan2(c * u[0] - s * u[1], s * u[0] + c * u[1])
    z[0] = (said - measured[0] + pi) % (2.0 * pi) - pi
    H[0, _PHI] = -u[2] * u[0] / level
    H[0, _PHI + 1] = -u[2] * u[1] / level
    H[0, _PHI + 2] = 1.0
    H[0, _DP], H[0, _DP + 1] = convergence(now)
    for j in range(3):
        swept = rotate(half, cross((1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2)), halfway))
        H[0, _BG + j] = -lag * _heading_by(u, times(C, swept), level)
    if at[AT_MOUNT] >= 0:
        H[0, at[AT_MOUNT]] = -_heading_by(u, times(C, rotate(half, rotate(half, up))), level)
        H[0, at[AT_MOUNT] + 1] = _heading_by(u, times(C, rotate(half, rotate(half, right))), level)
    if at[AT_LAG] >= 0:
        H[0, at[AT_LAG]] = _heading_by(u, v, level)


HEADING = Row("heading", _heading, {"mounting": 2, "lag": 1}, rows=1, width=1, unit="rad", axes=("heading",))
