"""What an INS learns from a base that does not turn: the gyros show the earth's rate and their own errors, nothing else.

    z = w_hat - C' w_ie = eps + C' (w_ie x phi)

The mean is over the time T since the last event of any sensor. What shakes a base about a place, and a gyro's quantum, is an angle
at both ends of it: a rate of ``angle / T``, whatever T; a row's sigma is that angle (rad), and its R made of it here.
The white noise of the gyros over the interval is both the row's noise and the process noise of phi. The two are treated
as independent: the reported sigma of heading is then larger than its error, never smaller.
"""

from __future__ import annotations

from typing import Any

from truenorth.aiding.row import BODY_FRAME, Row, row
from truenorth.core.attitude import cross
from truenorth.core.compiled import compiled
from truenorth.state.now import NOW_C, NOW_EARTH, NOW_GYRO_NOISE, NOW_MEAN_RATE, NOW_SINCE, matrix_of, vector_of

_PHI, _BG = 0, 9
STILL_RATE = 1e-6  # rad/s, of a base's rotation, besides what the gyros show of themselves


@compiled
def rotation_row(C: Any, w_b: Any, w_ie: Any, H: Any, z: Any) -> None:
    """Mean rate of a base that does not turn.

    Parameters
    ----------
    C : (3, 3) array
        ``C_wb``.
    w_b : tuple of 3, rad/s
        Mean of ``w_ib_b`` as computed over the interval.
    w_ie : tuple of 3, rad/s
        The earth's rate, level frame.
    H : (3, N) array
        Zeros; filled in.
    z : (3,) array, rad/s
        Filled in.
    """
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        c = cross(w_ie, e)
        for i in range(3):
            H[i, _PHI + j] = C[0, i] * c[0] + C[1, i] * c[1] + C[2, i] * c[2]
        H[j, _BG + j] = 1.0
        z[j] = w_b[j] - (C[0, j] * w_ie[0] + C[1, j] * w_ie[1] + C[2, j] * w_ie[2])


@row
def _rotation(now: Any, figures: Any, at: Any, assumed: Any, measured: Any, H: Any, z: Any, R: Any) -> None:
    rotation_row(matrix_of(now, NOW_C), vector_of(now, NOW_MEAN_RATE), vector_of(now, NOW_EARTH), H, z)
    if now[NOW_SINCE] > 0.0:  # a mean rate has the gyros' noise, too
        for i in range(3):
            R[i] = R[i] / now[NOW_SINCE] ** 2 + STILL_RATE**2 + now[NOW_GYRO_NOISE] / now[NOW_SINCE]


ROTATION = Row("rotation", _rotation, {}, unit="rad/s", axes=BODY_FRAME)
