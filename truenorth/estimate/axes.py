"""Errors along the wander frame and along east, north, up: how the closed loop's covariance begins and is put out."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.earth import radii_at
from truenorth.errors.ins import DYNAMIC

Array = NDArray[np.float64]
POLE = math.radians(89.999)  # beyond, north has no meaning that a metre of position leaves
_DV, _DP = 3, 6
_radii_at = compiled(radii_at)


@compiled
def turn(C: Any, v: Any, place: Any, sign: float, P: Any) -> None:
    """Turn (K, n, n) covariances in place, ``P = J P J'``, from errors phi, dv, dp along w to those along ENU.

    Turned into these axes, by `C` (K, 3, 3), about up; and since ENU at the computed place is turned against ENU at the true one by
    the convergence of the meridians, ``c = tan L dp_E/(R_N + h)``: ``phi_U`` grows by it, and velocity (`v`, ENU) is measured in
    axes turned by it. With a `sign` of -1 and w along ENU it leads back.
    """
    count, n = P.shape[0], P.shape[1]
    work, back = np.empty((DYNAMIC, n)), np.empty((DYNAMIC, DYNAMIC))
    for k in range(count):
        lat = min(max(place[k, 0], -POLE), POLE)
        rate = sign * math.tan(lat) / (_radii_at(math.sin(lat) ** 2)[1] + place[k, 2])
        cosine, sine, east, north = C[k, 0, 0], C[k, 1, 0], v[k, 0], v[k, 1]
        _turn_rows(P[k], n, cosine, sine, rate, east, north, work)
        for i in range(DYNAMIC):
            for j in range(DYNAMIC):
                back[j, i] = work[i, j]
            for j in range(DYNAMIC, n):
                P[k, i, j] = P[k, j, i] = work[i, j]
        _turn_rows(back, DYNAMIC, cosine, sine, rate, east, north, work)
        for i in range(DYNAMIC):
            for j in range(i, DYNAMIC):
                P[k, i, j] = P[k, j, i] = work[i, j]


@borrowing(forceinline=True)
def _turn_rows(
    P: Any, columns: int, cosine: float, sine: float, rate: float, east: float, north: float, out: Any
) -> None:
    """``J P`` of the nine rows of `P` that are errors along w, so many columns; of a velocity east, north."""
    for j in range(columns):
        for at in (0, _DV, _DP):
            out[at, j] = cosine * P[at, j] - sine * P[at + 1, j]
            out[at + 1, j] = sine * P[at, j] + cosine * P[at + 1, j]
            out[at + 2, j] = P[at + 2, j]
        c = rate * out[_DP, j]
        out[_DV - 1, j] += c
        out[_DV, j] += c * north
        out[_DV + 1, j] -= c * east
