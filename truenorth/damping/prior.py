"""What a damping filter knows when it is switched on: the error of the INS as it is *then*."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.linalg import symmetric
from truenorth.core.units import parse
from truenorth.damping.course import linearised
from truenorth.errors.marine import BA, BG, DP, DV, PHI, STATES, MarineModel
from truenorth.state.track import Track

Array = NDArray[np.float64]


def paper_prior(course: Track, epoch: int) -> Array:
    """(13, 13) of the paper's scenario at 2.5 h, in our units: 1 m/s, .05 deg, 1'/1'/15', 1e-4 g, .01 deg/h.

    The paper does not state it; these match its figures.
    """
    lat, _, alt = course.position[epoch]
    R_M, R_N = earth.radii(lat)
    degree, minute = math.radians(1.0), math.radians(1.0 / 60.0)
    sigma = np.zeros(STATES)
    sigma[DV] = 1.0
    sigma[DP] = 0.05 * degree * np.array([(R_N + alt) * math.cos(lat), R_M + alt])
    sigma[PHI] = np.array([1.0, 1.0, 15.0]) * minute
    sigma[BA], sigma[BG] = parse("100 ug", "acceleration"), parse("0.01 deg/h", "angular_rate")
    return np.diag(sigma**2)


def carried_prior(course: Track, epoch: int, model: MarineModel, P0: Array) -> Array:
    """(n, n) covariance at an epoch, of errors that had `P0` at the beginning of the course.

    Parameters
    ----------
    course : Track
    epoch : int
        Of the switch.
    model : MarineModel
        Its biases, groups and noise, as they grow in the undamped INS.
    P0 : (13, 13) array
        At the beginning.
    """
    P = model.prior(P0)
    stride = max(1, int(10.0 / course.interval + 1e-9))
    head, rest = course[: max(epoch, 1) + 1 : stride], epoch % stride
    parts = [head[: epoch // stride + 1]] if epoch >= stride else []
    if rest:
        parts.append(course[epoch - rest : epoch + 1])
    for part in parts:
        _, Phi = linearised(part, model)
        Q = model.noise_of(part.interval, 0.5 * (part.v_n[1:] + part.v_n[:-1]))
        for step, noise in zip(Phi, np.broadcast_to(Q, Phi.shape), strict=True):
            P = step @ P @ step.T + noise
    return symmetric(P)
