"""Heading of the forward axis from outside, as a row of the closed loop: a star, a landmark, a quay.

``z = heading_hat - measured = phi_U + tan L dp_E/(R_N + h)``: the level frame of the filter does not turn with the meridians,
and an INS that is off eastwards has another north (:mod:`truenorth.errors.ins`).
"""

from __future__ import annotations

from math import atan2, pi
from typing import Any

from truenorth.aiding.row import Row, row
from truenorth.aiding.velocity import convergence_of_meridians
from truenorth.state.now import NOW_C, NOW_NORTH

_UP, _DP = 2, 6


@row
def _heading(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    x, y = now[NOW_C + 1], now[NOW_C + 4]  # the forward axis along w
    s, c = now[NOW_NORTH], now[NOW_NORTH + 1]
    off = atan2(c * x - s * y, s * x + c * y) - measured[0]
    z[0] = (off + pi) % (2.0 * pi) - pi
    turn = convergence_of_meridians(now, s, c)
    H[0, _UP] = 1.0
    H[0, _DP], H[0, _DP + 1] = turn * c, -turn * s


HEADING = Row("heading", _heading, {}, rows=1, width=1)
