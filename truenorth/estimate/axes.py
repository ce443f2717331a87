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


@borrowing
def convergence(C: Any, v: Any, place: Any, sign: float, J: Any) -> None:
    """Fill in J (9, 9) from errors phi, dv, dp along w to those along ENU.

    Turned into these axes, by `C` (3, 3); and since ENU at the computed place is turned against ENU at the true one by the
    convergence of the meridians, ``c = tan L dp_E/(R_N + h)``: ``phi_U`` grows by it, and velocity (`v`, ENU) is measured in
    axes turned by it. With a `sign` of -1 and w along ENU it leads back.
    """
    lat = min(max(place[0], -POLE), POLE)
    rate = sign * math.tan(lat) / (_radii_at(math.sin(lat) ** 2)[1] + place[2])
    for j in range(3):
        for i in range(DYNAMIC):
            for group in (0, _DV, _DP):
                J[i, group + j] = 0.0
        for i in range(3):
            for group in (0, _DV, _DP):
                J[group + i, group + j] = C[i, j]
        c = rate * C[0, j]  # given by dp along w
        J[_DV - 1, _DP + j] = c
        J[_DV, _DP + j] = c * v[1]
        J[_DV + 1, _DP + j] = -c * v[0]


@compiled
def turn(C: Any, v: Any, place: Any, sign: float, P: Any) -> None:
    """``P = J P J'`` in place, of (K, n, n) covariances; `C`, `v`, `place` and `sign` are those of :func:`convergence`."""
    count, n = P.shape[0], P.shape[1]
    work, J = np.empty((DYNAMIC, n)), np.empty((DYNAMIC, DYNAMIC))
    for k in range(count):
        convergence(C[k], v[k], place[k], sign, J)
        for i in range(DYNAMIC):
            for j in range(n):
                work[i, j] = 0.0
            for a in range(DYNAMIC):
                factor = J[i, a]
                if factor != 0.0:
                    for j in range(n):
                        work[i, j] += factor * P[k, a, j]
        for i in range(DYNAMIC):
            for j in range(DYNAMIC, n):
                P[k, i, j] = P[k, j, i] = work[i, j]
            for j in range(i, DYNAMIC):
                total = 0.0
                for a in range(DYNAMIC):
                    total += work[i, a] * J[j, a]
                P[k, i, j] = P[k, j, i] = total
