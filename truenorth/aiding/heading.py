"""The heading of a line in the body: of two antennas' baseline, a compass, a gyrocompass of its own, a star, a quay.

The line b (body axes) points along ``u = C b``, and its heading is ``psi = atan2(u_E, u_N)``. With
``C_hat = (I - [phi x]) C`` its error is ``du = u x phi``, so that

    z = psi_hat + bias - psi - lag psi' = phi_U - u_U (u_E phi_E + u_N phi_N) / (u_E^2 + u_N^2) - db + psi' dlag

with ``psi' = (u_N u'_E - u_E u'_N) / (u_E^2 + u_N^2)`` and ``u' = C (w x b)``. North at the computed place is turned against that
at the true one by the convergence of the meridians, ``tan L dp_E / R`` about up.
"""

from __future__ import annotations

from math import atan2, pi
from typing import Any

from truenorth.aiding.position import convergence
from truenorth.aiding.row import AT_BIAS, AT_LAG, MOUNT, Row, lag_now, row, state_of
from truenorth.core.attitude import cross, times
from truenorth.state.now import NOW_C, NOW_NORTH, NOW_TURN, matrix_of, vector_of

_PHI, _DP, _BG = 0, 6, 9
STEEPEST = 0.01  # square of the part of the line that is level, below which it has no heading


@row
def _heading(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    b = (figures[MOUNT + 3], figures[MOUNT + 4], figures[MOUNT + 5])  # the sensor's forward axis in the body
    C = matrix_of(now, NOW_C)
    swing = cross(vector_of(now, NOW_TURN), b)
    u, v = times(C, b), times(C, swing)
    level = u[0] * u[0] + u[1] * u[1]
    if level < STEEPEST:
        return
    rate = (u[1] * v[0] - u[0] * v[1]) / level
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    lag = lag_now(now, assumed, at[AT_LAG])
    said = atan2(c * u[0] - s * u[1], s * u[0] + c * u[1]) - lag * rate
    off = said + state_of(assumed, at[AT_BIAS]) - measured[0]
    z[0] = (off + pi) % (2.0 * pi) - pi
    H[0, _PHI] = -u[2] * u[0] / level
    H[0, _PHI + 1] = -u[2] * u[1] / level
    H[0, _PHI + 2] = 1.0
    H[0, _DP], H[0, _DP + 1] = convergence(now)
    for j in range(3):
        g = times(C, cross((1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2)), b))
        H[0, _BG + j] = -lag * (u[1] * g[0] - u[0] * g[1]) / level
    if at[AT_BIAS] >= 0:
        H[0, at[AT_BIAS]] = -1.0
    if at[AT_LAG] >= 0:
        H[0, at[AT_LAG]] = rate


HEADING = Row("heading", _heading, {"bias": 1, "lag": 1}, rows=1, width=1, unit="rad", axes=("heading",))
