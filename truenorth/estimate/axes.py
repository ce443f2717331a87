"""Errors along the wander frame and along east, north, up: how the closed loop's covariance is put out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.earth import radii
from truenorth.errors.ins import DYNAMIC
from truenorth.state.layout import DP, DV, PHI

Array = NDArray[np.float64]
POLE = np.radians(89.999)  # beyond, north has no meaning that a metre of position leaves


def convergence(C_nw: Array, v_n: Array, position: Array) -> Array:
    """(K, 9, 9) from errors phi, dv, dp along w to those along ENU; the others stay.

    Turned into these axes; and since ENU at the computed place is turned against ENU at the true one by the convergence
    of the meridians, ``c = tan L dp_E/(R_N + h)``: ``phi_U`` grows by it, and velocity is measured in axes turned by it.
    """
    J = np.zeros((len(C_nw), DYNAMIC, DYNAMIC))
    for group in (PHI, DV, DP):
        J[:, group, group] = C_nw
    lat, alt = position[:, 0], position[:, 2]
    rate = np.tan(np.clip(lat, -POLE, POLE)) / (radii(lat)[1] + alt)
    c = rate[:, None] * C_nw[:, 0, :]  # given by dp along w
    J[:, PHI.stop - 1, DP] = c
    J[:, DV.start, DP] = c * v_n[:, 1:2]
    J[:, DV.start + 1, DP] = -c * v_n[:, :1]
    return J


@compiled
def turn(J: Any, P: Any) -> None:
    """``P = J P J'`` in place, of (K, n, n) covariances whose first nine states are turned by J (K, 9, 9)."""
    count, n = P.shape[0], P.shape[1]
    work = np.empty((DYNAMIC, n))
    for k in range(count):
        for i in range(DYNAMIC):
            for j in range(n):
                work[i, j] = 0.0
            for a in range(DYNAMIC):
                factor = J[k, i, a]
                if factor != 0.0:
                    for j in range(n):
                        work[i, j] += factor * P[k, a, j]
        for i in range(DYNAMIC):
            for j in range(DYNAMIC, n):
                P[k, i, j] = P[k, j, i] = work[i, j]
            for j in range(i, DYNAMIC):
                total = 0.0
                for a in range(DYNAMIC):
                    total += work[i, a] * J[k, j, a]
                P[k, i, j] = P[k, j, i] = total
