"""Position matching: where a master INS says it is, late, from another place on the vehicle.

The master stands at -r in the slave (r: from master to slave, slave axes) and is late by tau:

    position   z = p_hat - C_hat r - p_master = dp + v tau + phi x C r + C dr

Source: Xia Jiahe et al., "Study on transfer alignment algorithm considering space-time difference", Navigation Positioning
and Timing 3 (2016), eq. 5; the sign of tau is that of its (9), right where the reference is late.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.aiding.position import position_row
from truenorth.aiding.row import ARM, AT_ARM, AT_LAG, Row, lag_now, row, with_state
from truenorth.state.now import NOW_C, NOW_NORTH, matrix_of


@row
def _position(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    """Measured: latitude, longitude (rad) and height (m) of the master."""
    if np.isnan(measured[0]):
        return
    r = with_state(figures, ARM, assumed, at[AT_ARM])
    C, away, nothing = matrix_of(now, NOW_C), (-r[0], -r[1], -r[2]), (0.0, 0.0, 0.0)
    position_row(now, C, away, lag_now(now, assumed, at[AT_LAG]), nothing, -1, at[AT_LAG], -1, measured, H, z)
    if at[AT_ARM] >= 0:
        s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
        for j in range(3):
            a = at[AT_ARM] + j
            H[0, a], H[1, a], H[2, a] = c * C[0, j] - s * C[1, j], s * C[0, j] + c * C[1, j], C[2, j]


MASTER_POSITION = Row("master position", _position, {"lever arm": 3, "lag": 1}, unit="m")
