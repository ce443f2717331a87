"""Errors along the wander frame and along east, north, up: how the closed loop's covariance is put out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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


def turned(J: Array, P: Array) -> Array:
    """``J P J'`` of (..., n, n) covariances whose first nine states are turned by J (..., 9, 9)."""
    P = P.copy()
    P[..., :DYNAMIC, :] = J @ P[..., :DYNAMIC, :]
    P[..., :, :DYNAMIC] = P[..., :, :DYNAMIC] @ np.swapaxes(J, -1, -2)
    return P
