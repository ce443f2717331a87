"""Position matching: where a master INS says it is, late, from another place on the vehicle.

The master stands at -r in the slave (r: from master to slave, slave axes) and is late by tau:

    position   z = p_hat - C_hat r - p_master = dp + v_m tau + phi x C r + C dr,   v_m = v - C (w x r)

where the seat bends by `theta`, with the arm ``r - ((1 - k) theta) x r`` (:mod:`truenorth.errors.bending`) and its column
``C (dk theta x r)``. `v_m` is the *master's* velocity: with an arm of 30 m on a ship that rolls it differs from the slave's by a
metre a second, which is all of it that tells a delay while the ship goes straight on.

Source: Xia Jiahe et al., "Study on transfer alignment algorithm considering space-time difference", Navigation Positioning
and Timing 3 (2016), eq. 5, which takes the slave's velocity; the sign of tau is that of its (9), right where the reference is
late.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.aiding.master import beyond_noise
from truenorth.aiding.position import position_row
from truenorth.aiding.row import ARM, AT_ARM, AT_FLEXURE, AT_LAG, OWN, Row, idle_part, lag_now, row, with_state
from truenorth.core.attitude import cross, times, times_back
from truenorth.state.layout import BG
from truenorth.state.now import NOW_C, NOW_EARTH, NOW_NORTH, NOW_RATE, matrix_of, vector_of

_BG = BG.start


@row
def _position(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    """Measured: latitude, longitude (rad) and height (m) of the master; a rate of the slave.

    The rate is what its gyros say, body axes, or NaN: that of the instant. Its own figure: the variance of a component of it,
    (rad/s)^2. What is within that noise tells of no delay, as in a row of attitude. Behind the rate how far the seat bends, rad,
    body axes, or NaN; of its coupling three figures more.
    """
    if np.isnan(measured[0]):
        return
    rigid = with_state(figures, ARM, assumed, at[AT_ARM])
    r, bends = rigid, not np.isnan(measured[6])
    if bends:
        back = cross(idle_part(figures, OWN + 1, assumed, at[AT_FLEXURE], measured, 6), rigid)
        r = (rigid[0] - back[0], rigid[1] - back[1], rigid[2] - back[2])
    C, away, nothing = matrix_of(now, NOW_C), (-r[0], -r[1], -r[2]), (0.0, 0.0, 0.0)
    lag = lag_now(now, assumed, at[AT_LAG])
    position_row(now, C, nothing, nothing, nothing, away, lag, nothing, -1, at[AT_LAG], -1, measured, H, z)
    still, w = times_back(C, vector_of(now, NOW_EARTH)), vector_of(now, NOW_RATE)
    swing = times(C, cross((w[0] - still[0], w[1] - still[1], w[2] - still[2]), away))
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    z[0] -= lag * (c * swing[0] - s * swing[1])
    z[1] -= lag * (s * swing[0] + c * swing[1])
    z[2] -= lag * swing[2]
    if at[AT_LAG] >= 0:
        if not np.isnan(measured[3]):
            w = (measured[3] - assumed[_BG], measured[4] - assumed[_BG + 1], measured[5] - assumed[_BG + 2])
        turn = (w[0] - still[0], w[1] - still[1], w[2] - still[2])
        seen, swing = beyond_noise(turn, figures[OWN]), times(C, cross(turn, away))
        H[0, at[AT_LAG]] += seen * (c * swing[0] - s * swing[1])
        H[1, at[AT_LAG]] += seen * (s * swing[0] + c * swing[1])
        H[2, at[AT_LAG]] += seen * swing[2]
    if at[AT_ARM] >= 0:
        for j in range(3):
            a = at[AT_ARM] + j
            H[0, a], H[1, a], H[2, a] = c * C[0, j] - s * C[1, j], s * C[0, j] + c * C[1, j], C[2, j]
    if bends and at[AT_FLEXURE] >= 0:
        for j in range(3):
            a, angle = at[AT_FLEXURE] + j, measured[6 + j]
            m = times(C, cross((angle * (j == 0), angle * (j == 1), angle * (j == 2)), rigid))
            H[0, a], H[1, a], H[2, a] = c * m[0] - s * m[1], s * m[0] + c * m[1], m[2]


MASTER_POSITION = Row(
    "master position", _position, {"lever arm": 3, "lag": 1, "flexure": 3}, width=9, instant=True, unit="m"
)
