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
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.vectors import load3, load4, plus4, store3, store4, times4
from truenorth.simulation.normals import Normals, draw, normals_of, words_of
from truenorth.simulation.streams import stream

Array = NDArray[np.float64]
BLOCK = 1024  # rows that are worked on at once
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
    return _drawn(of_gauss_markov(sigma, tau, interval), count, rng)


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
    return _drawn(of_random_walk(density, interval), count, rng)


class Recursion(NamedTuple):
    """Of integrals: ``x[k+1] = decay x[k] + alpha e[k+1] + beta e[k]``, which begins at ``x[0] = before e' + alpha e[0]``."""

    decay: float
    alpha: float
    beta: float
    before: float


def of_gauss_markov(sigma: float, tau: float, interval: float) -> Recursion:
    """How :func:`gauss_markov` goes on."""
    return _recursion(2.0 * sigma**2 / tau, tau, sigma**2, interval)


def of_random_walk(density: float, interval: float) -> Recursion:
    """How :func:`random_walk` goes on."""
    return _recursion(density**2, math.inf, 0.0, interval)


def with_errors(
    x: Array, matrix: Array, bias: Array, recursion: Recursion, steps: Normals, white: Normals, walk: float
) -> Array:
    """Increments (N, 3) as sensors give them: ``(I + matrix) x``, a bias (3,), what a recursion gives, white noise of sigma `walk`.

    The bits are those of one after the other, in this order: rows are passed over once, and what wanders takes no memory.
    """
    out = np.empty_like(x)
    _recur(recursion, steps, bias, white, walk, x, matrix, out)
    return out


@dataclass(frozen=True, eq=False)
class Wander:
    """What wanders in one run of three sensors, as it can be drawn again; true where something does.

    Attributes
    ----------
    count : int
        Intervals.
    interval : float, s
    terms : mapping
        Recursions by the numbers of their streams.
    warmth : (count,) array or None
        Temperature above that of calibration, K, and
    by_temperature : (3,) array
        what a kelvin does.
    """

    count: int
    interval: float
    terms: Mapping[tuple[int, int, int, int], Recursion]
    warmth: Array | None
    by_temperature: Array

    def __bool__(self) -> bool:
        return bool(self.terms) or self.warmth is not None

    def integrals(self) -> Array:
        """(count, 3) over each interval."""
        total = np.zeros((self.count, 3))
        if self.warmth is not None:
            total += np.multiply.outer(self.warmth * self.interval, self.by_temperature)
        for numbers, recursion in self.terms.items():
            total += _drawn(recursion, self.count, stream(*numbers))
        return total


def _drawn(recursion: Recursion, count: int, rng: np.random.Generator) -> Array:
    """Integrals of three axes, (count, 3)."""
    x, steps = np.zeros((count, 3)), normals_of(rng)
    _recur(recursion, steps, np.zeros(3), steps, 0.0, x, np.zeros((3, 3)), x)
    generator: Any = rng.bit_generator
    generator.advance(words_of(steps))
    return x


@lru_cache(maxsize=16)
def _recursion(q: float, tau: float, variance: float, T: float) -> Recursion:
    """Of a bias with this variance before the first interval."""
    v, weights = 0.5 * T * (1.0 + NODES), 0.5 * T * WEIGHTS
    g1, g0 = _ramp(v, tau), np.exp(-v / tau) * _ramp(T - v, tau)
    total = math.sqrt(q * float(weights @ (g1 + g0) ** 2))  # alpha + beta
    apart = math.sqrt(q * float(weights @ (g1 - g0) ** 2))  # beta - alpha
    alpha, beta = 0.5 * (total - apart), 0.5 * (total + apart)
    first = variance * float(_ramp(np.array(T), tau)) ** 2 + q * float(weights @ g1**2)
    before = math.sqrt(first - alpha**2)  # what the first integral has besides its share in the second
    return Recursion(math.exp(-T / tau), alpha, beta, before)


def _ramp(v: Array, tau: float) -> Array:
    return v if math.isinf(tau) else -tau * np.expm1(-v / tau)


@compiled
def _recur(
    recursion: Any, steps: Normals, bias: Any, white: Normals, walk: float, sensed: Any, matrix: Any, out: Any
) -> None:
    """``(I + matrix) x`` of rows that are sensed, a bias, the recursion and white noise, in this order; `out` may be `sensed`.

    What is drawn are the numbers of ``standard_normal((count + 1, 3))``. A row is a vector of four; the last counts nowhere.
    """
    d, alpha, beta = recursion.decay, recursion.alpha, recursion.beta
    e, w = np.zeros(3 * BLOCK + 4), np.zeros(3 * BLOCK + 1)  # before `e` the numbers of the row before
    constants = np.zeros((5, 4))  # columns of the matrix, the bias, and what wanders before the first row
    draw(steps, e[:3])
    for i in range(3):
        for j in range(3):
            constants[j, i] = matrix[i, j]
        constants[3, i], constants[4, i] = bias[i], recursion.before * e[i]
        e[i] = 0.0
    a, b, c = load4(constants, (0, 0)), load4(constants, (1, 0)), load4(constants, (2, 0))
    offset, x = load4(constants, (3, 0)), load4(constants, (4, 0))
    decay = 1.0  # none before the first
    for first in range(0, len(out), BLOCK):
        count = min(BLOCK, len(out) - first)
        draw(steps, e[3 : 3 + 3 * count])
        if walk > 0.0:
            draw(white, w[: 3 * count])
        ideal, rows = sensed[first : first + count], out[first : first + count]
        for k in range(count):
            x = plus4(times4(decay, x), times4(alpha, load4(e, (3 * k + 3,))))
            x = plus4(x, times4(beta, load4(e, (3 * k,))))
            row = plus4(load3(ideal, (k, 0)), times4(ideal[k, 0], a))
            row = plus4(plus4(row, times4(ideal[k, 1], b)), times4(ideal[k, 2], c))
            row = plus4(plus4(row, offset), x)
            store3(rows, (k, 0), plus4(row, times4(walk, load4(w, (3 * k,)))))
            decay = d
        store4(e, (0,), load4(e, (3 * count,)))


@compiled
def sense(x: Any, matrix: Any, out: Any) -> None:
    """``(I + matrix) x``."""
    for k in range(len(x)):
        a, b, c = x[k, 0], x[k, 1], x[k, 2]
        out[k, 0] = a + matrix[0, 0] * a + matrix[0, 1] * b + matrix[0, 2] * c
        out[k, 1] = b + matrix[1, 0] * a + matrix[1, 1] * b + matrix[1, 2] * c
        out[k, 2] = c + matrix[2, 0] * a + matrix[2, 1] * b + matrix[2, 2] * c
