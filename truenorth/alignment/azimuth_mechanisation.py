"""The INS of many runs over one filter interval, with all that the error model needs to know of it, compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.compiled import compiled
from truenorth.errors.in_motion_azimuth import PARAMETERS
from truenorth.strapdown.wander import advance, curvature, earth_axis, set_matrix

Array = NDArray[np.float64]


@compiled
def mechanise_interval(
    steps: Any,  # (N,) s
    dtheta: Any,  # (R, N, 3) rad
    dvel: Any,  # (R, N, 3) m/s
    wheel: Any,  # (R, N) m: distance by the odometer in each sample
    which: Any,  # (B,): of the R logs, which each run has
    first: int,
    last: int,
    errors: Any,  # (B, 7): gyro and accelerometer bias and odometer scale as known so far, taken off
    s: Any,  # (B, 24): the state (:mod:`truenorth.strapdown.wander`); changed in place
    p: Any,  # (B, 28): parameters of the error model (:mod:`truenorth.errors.in_motion_azimuth`), filled in
    z: Any,  # (B, 3) m: displacement of the INS less that of the odometer; filled in
) -> None:
    """Carry each run through the samples ``first`` to ``last - 1``."""
    C, mean = np.zeros((3, 3)), np.zeros((3, 3))
    length = 0.0
    for i in range(first, last):
        length += steps[i]
    for b in range(len(which)):
        r = which[b]
        state, out = s[b], p[b]
        for k in range(PARAMETERS):
            out[k] = 0.0
        for j in range(3):
            z[b, j] = 0.0
            for k in range(3):
                mean[j, k] = 0.0
        set_matrix(state, C)
        elapsed = 0.0
        for i in range(first, last):
            T = steps[i]
            w = (
                dtheta[r, i, 0] - T * errors[b, 0],
                dtheta[r, i, 1] - T * errors[b, 1],
                dtheta[r, i, 2] - T * errors[b, 2],
            )
            f = (
                dvel[r, i, 0] - T * errors[b, 3],
                dvel[r, i, 1] - T * errors[b, 4],
                dvel[r, i, 2] - T * errors[b, 5],
            )
            way = 0.5 * wheel[r, i] / (1.0 + errors[b, 6])
            for j in range(3):  # trapezoids: attitude and velocity before and after the sample
                z[b, j] += 0.5 * T * state[4 + j]
                out[16 + j] += way * C[j, 1]
                for k in range(3):
                    mean[j, k] += 0.5 * T / length * C[j, k]
            advance(state, T, 1.0, w, f, True, False)
            set_matrix(state, C)
            elapsed += T
            for j in range(3):
                z[b, j] += 0.5 * T * state[4 + j]
                out[16 + j] += way * C[j, 1]
                out[10 + j] += state[21 + j]
                out[13 + j] += (elapsed - 0.5 * T) / length * state[21 + j]
                for k in range(3):
                    mean[j, k] += 0.5 * T / length * C[j, k]
        out[0] = length
        axis = earth_axis(state)
        Kxx, Kxy, Kyy = curvature(axis, state[11])
        out[25], out[26], out[27] = Kxx, Kxy, Kyy
        for j in range(3):
            out[19 + j] = z[b, j] / length
            out[22 + j] = earth.EARTH_RATE * axis[j]
            z[b, j] -= out[16 + j]
            for k in range(3):
                out[1 + 3 * j + k] = mean[j, k]
