"""A bias known as a whole, taken apart into its constant and its slow part.

An alignment sees the mean over its data of constant and slow bias together, ``m = c + mean(w)``. The slow one is a
Gauss-Markov process of variance ``s^2`` and correlation time ``tau``; over a time ``T``, ``x = T/tau``,

    var mean(w) = s^2 2 (x - 1 + exp(-x))/x^2,     cov(w(T), mean(w)) = s^2 (1 - exp(-x))/x

(A. Papoulis, *Probability, Random Variables, and Stochastic Processes*, 3rd ed. (1991), sec. 10-1: time averages). What
the data say of ``c`` and ``w(T)``, they say through m alone: both follow from it by regression on their joint prior.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.model import InsModel
from truenorth.state.layout import BA, BG, SLOW_ACCEL, SLOW_GYRO, STATES
from truenorth.state.prior import WholeBiases

Array = NDArray[np.float64]

SHORT = 1e-3  # of the correlation time: a process does not change in less


def time_average(x: float) -> tuple[float, float]:
    """Variance of a Gauss-Markov process's mean over ``x`` correlation times, and its covariance with the last value."""
    if x < SHORT:
        return 1.0 - x / 3.0, 1.0 - 0.5 * x
    return 2.0 * (x - 1.0 + math.exp(-x)) / x**2, (1.0 - math.exp(-x)) / x


def taken_apart(model: InsModel, P15: Array, bias: Array, whole: WholeBiases) -> tuple[Array, Array]:
    """Covariance and values at the start of a model whose slow biases are states of their own.

    Parameters
    ----------
    P15 : (15, 15) array
        Of phi, dv, dp and the whole biases.
    bias : (6,) array
        The whole biases, gyro and accelerometer.

    Returns
    -------
    P : (n, n) array
    values : (n,) array
        In the places of the states; zero where those are no biases.
    """
    M, values = np.eye(model.states, STATES), np.zeros(model.states)
    values[BG.start : BA.stop] = bias
    P = model.prior(np.zeros((STATES, STATES)))
    for group, name, c in ((BG, SLOW_GYRO, whole.constant[:3]), (BA, SLOW_ACCEL, whole.constant[3:])):
        slow = model.layout.slice_of(name)
        if slow is None:
            continue
        s = np.diag(P)[slow].copy()
        process = model.groups[model.layout.names.index(name)]
        mean, late = time_average(whole.averaged / process.lasts[0])
        said = c + mean * s  # variance a priori of what the data see
        a, b = c / said, late * s / said
        M[group, group], M[slow, group] = np.diag(a), np.diag(b)
        P[group, group] = np.diag(c * (1.0 - a))
        P[slow, slow] = np.diag(s * (1.0 - late * b))
        P[group, slow] = P[slow, group] = np.diag(-c * b)
        values[slow] = b * values[group]
        values[group] = a * values[group]
    held = np.ones(STATES)
    held[5] = 0.0 if model.fixed_altitude else 1.0
    return M @ (P15 * np.outer(held, held)) @ M.T + P, values
