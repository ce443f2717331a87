"""What a barometer or a depth gauge gives an INS: height, with a slowly changing error.

y = h + (C l)_U + b,   z = y_hat - y = dp_U + ((C l) x phi)_U - db
"""

from __future__ import annotations

from typing import Any

from truenorth.aiding.row import ARM, AT_ARM, AT_BIAS, Row, row, state_of, with_state
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_C, matrix_of

_PHI, _DP = 0, 6


@compiled
def height_row(s: Any, C: Any, arm: Any, bias: float, at_bias: int, measured: Any, H: Any, z: Any) -> None:
    """Height above the ellipsoid, m, in the first row of `H` and `z`; the others stay as they are."""
    x = C[0, 0] * arm[0] + C[0, 1] * arm[1] + C[0, 2] * arm[2]
    y = C[1, 0] * arm[0] + C[1, 1] * arm[1] + C[1, 2] * arm[2]
    up = C[2, 0] * arm[0] + C[2, 1] * arm[1] + C[2, 2] * arm[2]
    z[0] = s[11] + up + bias - measured[0]
    H[0, _PHI] = -y
    H[0, _PHI + 1] = x
    H[0, _DP + 2] = 1.0
    if at_bias >= 0:
        H[0, at_bias] = -1.0


@row
def _height(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    arm = with_state(figures, ARM, assumed, at[AT_ARM])
    height_row(now, matrix_of(now, NOW_C), arm, state_of(assumed, at[AT_BIAS]), at[AT_BIAS], measured, H, z)


HEIGHT = Row("height", _height, {"bias": 1}, rows=1, unit="m", axes=("height",))
