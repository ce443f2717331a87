"""Random processes of sensor errors, sampled exactly at a constant interval and stationary from the first sample.

(An IMU gives integrals over its intervals; those of its drifts are in :mod:`truenorth.simulation.drift`.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled

Array = NDArray[np.float64]


def gauss_markov(
    sigma: float | Array, tau: float, interval: float, count: int, rng: np.random.Generator, axes: int = 3
) -> Array:
    """First-order Gauss-Markov process of independent axes, (count, axes): covariance ``sigma^2 exp(-|t|/tau)``."""
    decay = float(np.exp(-interval / tau))
    noise = sigma * np.sqrt(1 - decay**2) * rng.standard_normal((count, axes))
    noise[0] = sigma * rng.standard_normal(axes)
    return first_order(decay, noise)


def second_order_gauss_markov(
    sigma: float | Array, beta: float, interval: float, count: int, rng: np.random.Generator, axes: int = 3
) -> tuple[Array, Array]:
    """Second-order Gauss-Markov process of independent axes, and its derivative, (count, axes).

    ``x'' + 2 beta x' + beta^2 x = w``. Its covariance is ``sigma^2 (1 + beta |t|) exp(-beta |t|)``. With ``y = x' + beta x`` it is
    two first-order ones in cascade, ``y' = -beta y + w`` and ``x' = -beta x + y``, whose joint covariance is
    ``sigma^2 [[1, beta], [beta, 2 beta^2]]``.
    """
    h, decay = interval, float(np.exp(-beta * interval))
    Phi = decay * np.array([[1.0, h], [0.0, 1.0]])
    # In units in which y is counted in beta: the covariance then has no unit, and is well conditioned.
    P = np.array([[1.0, 1.0], [1.0, 2.0]])
    U = np.diag([1.0, beta])
    scaled = np.linalg.inv(U) @ Phi @ U
    driven = np.einsum(
        "ij,kja->kia", U @ np.linalg.cholesky(P - scaled @ P @ scaled.T), rng.standard_normal((count, 2, axes))
    )
    driven[0] = U @ np.linalg.cholesky(P) @ rng.standard_normal((2, axes))
    y = first_order(decay, driven[:, 1])
    into = driven[:, 0]
    into[1:] += decay * h * y[:-1]
    x = first_order(decay, into)
    return sigma * x, sigma * (y - beta * x)


def first_order(decay: float, driven: Array) -> Array:
    """``x[k] = decay x[k-1] + driven[k]`` along the first axis, (count, ...); zero stands before it.

    (SciPy's filter does the same to the same bits; what comes with it takes .7 s to load.)
    """
    x = np.array(driven, dtype=np.float64, order="C")
    _go_on(decay, x.reshape(len(x), -1))
    return x


@compiled
def _go_on(decay: float, x: Any) -> None:
    """The recursion, in the place of what drives it."""
    for k in range(1, x.shape[0]):
        for j in range(x.shape[1]):
            x[k, j] += decay * x[k - 1, j]
