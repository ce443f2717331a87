"""Biases that wander: Gauss-Markov processes and random walks, exactly as an integrating sensor gives them.

A bias ``db = -b/tau dt + sqrt(q) dW`` (tau infinite: a random walk) is put out as its integrals x over successive
intervals T. What one interval adds to another, ``x[k+1] - d x[k]`` with ``d = exp(-T/tau)``, holds the noise of just
those two,

    x[k+1] - d x[k] = sqrt(q) (int g1(v) dW[k+1] + int g0(v) dW[k]),   g1(v) = r(v), g0(v) = exp(-v/tau) r(T - v)

with ``r(v) = tau (1 - exp(-v/tau))`` and v the time to the end of the interval; it is a moving average of two white
terms, ``alpha e[k+1] + beta e[k]`` with the same variance and covariance. One draw a sample thus gives the very law.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled

Array = NDArray[np.float64]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(48)


def gauss_markov(sigma: float, tau: float, interval: float, count: int, rng: np.random.Generator) -> Array:
    """Integrals of a stationary Gauss-Markov process of three axes over successive intervals.

    Parameters
    ----------
    sigma : float
        Of the process.
    tau : float, s
        Correlation time.
    interval : float, s

    Returns
    -------
    (count, 3) array, unit of `sigma` times s
    """
    return _integrals(2.0 * sigma**2 / tau, tau, sigma**2, interval, count, rng)


def random_walk(density: float, interval: float, count: int, rng: np.random.Generator) -> Array:
    """Integrals over successive intervals of a random walk of three axes that begins at zero.

    Parameters
    ----------
    density : float
        The walk spreads as ``density sqrt(t)``.
    interval : float, s
    count : int
    rng : Generator

    Returns
    -------
    (count, 3) array, unit of `density` times s^1.5
    """
    return _integrals(density**2, math.inf, 0.0, interval, count, rng)


def _integrals(q: float, tau: float, variance: float, T: float, count: int, rng: np.random.Generator) -> Array:
    """Of a bias with this variance before the first interval."""
    v, weights = 0.5 * T * (1.0 + NODES), 0.5 * T * WEIGHTS
    g1, g0 = _ramp(v, tau), np.exp(-v / tau) * _ramp(T - v, tau)
    total = math.sqrt(q * float(weights @ (g1 + g0) ** 2))  # alpha + beta
    apart = math.sqrt(q * float(weights @ (g1 - g0) ** 2))  # beta - alpha
    alpha, beta = 0.5 * (total - apart), 0.5 * (total + apart)
    first = variance * float(_ramp(np.array(T), tau)) ** 2 + q * float(weights @ g1**2)
    before = math.sqrt(first - alpha**2)  # what the first integral has besides its share in the second
    x = np.empty((count, 3))
    _recur(rng, math.exp(-T / tau), alpha, beta, before, x)
    return x


def _ramp(v: Array, tau: float) -> Array:
    return v if math.isinf(tau) else -tau * np.expm1(-v / tau)


@compiled
def _recur(rng: Any, d: float, alpha: float, beta: float, before: float, x: Any) -> None:
    """Draw as they are needed the numbers that ``rng.standard_normal((count + 1, 3))`` gives: in a third of its time."""
    last, at = np.empty(3), np.empty(3)
    for i in range(3):
        at[i] = before * rng.standard_normal()
    for i in range(3):
        last[i] = rng.standard_normal()
        at[i] += alpha * last[i]
        x[0, i] = at[i]
    for k in range(1, len(x)):
        for i in range(3):
            e = rng.standard_normal()
            at[i] = d * at[i] + alpha * e + beta * last[i]
            last[i] = e
            x[k, i] = at[i]
