"""What a barometer or a depth gauge tells an INS: height, with a slowly changing error.

y = h + (C l)_U + b,   z = y_hat - y = dp_U + ((C l) x phi)_U - db
"""

from __future__ import annotations

from typing import Any

from truenorth.core.compiled import compiled

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
