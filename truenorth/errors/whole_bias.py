"""A bias known as a whole, taken apart into its constant and its slow part.

An alignment sees the mean over its data of constant and slow bias together, ``m = c + mean(w)``. The slow one is a
Gauss-Markov process of variance ``s^2`` and correlation time ``tau``; over a time ``T``, ``x = T/tau``,

    var mean(w) = s^2 2 (x - 1 + exp(-x))/x^2,     cov(w(T), mean(w)) = s^2 (1 - exp(-x))/x

(A. Papoulis, *Probability, Random Variables, and Stochastic Processes*, 3rd ed. (1991), sec. 10-1: time averages). What
the data say of ``c`` and ``w(T)``, they say through m alone: both follow from it by regression on their joint prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.state.layout import BA, BG, SLOW_ACCEL, SLOW_GYRO, STATES
from truenorth.state.prior import WholeBiases

if TYPE_CHECKING:
    from truenorth.errors.model import InsModel

Array = NDArray[np.float64]

NONE_KNOWN: Mapping[str, Array] = MappingProxyType({})
SHORT = 1e-3  # of the correlation time: a process does not change in less


def time_average(x: float) -> tuple[float, float]:
    """Variance of a Gauss-Markov process's mean over ``x`` correlation times, and its covariance with the last value."""
    if x < SHORT:
        return 1.0 - x / 3.0, 1.0 - 0.5 * x
    return 2.0 * (x - 1.0 + math.exp(-x)) / x**2, (1.0 - math.exp(-x)) / x


def about_average(before: float, after: float) -> float:
    """Variance of a Gauss-Markov process's value about its mean over so many correlation times before it and after it."""
    x = before + after
    with_mean = (before * time_average(before)[1] + after * time_average(after)[1]) / x
    return 1.0 + time_average(x)[0] - 2.0 * with_mean


def taken_apart(
    model: InsModel, P: Array, bias: Array, whole: WholeBiases, known: Mapping[str, Array] = NONE_KNOWN
) -> tuple[Array, Array]:
    """Covariance and values at the start of a model whose slow biases are states of their own.

    Parameters
    ----------
    P : (15 + m, 15 + m) array
        Of phi, dv, dp and the whole biases, and of the known groups behind them.
    bias : (6,) array
        The whole biases, gyro and accelerometer.
    known : mapping of name to values
        Groups that have been estimated, in the order in which they stand in P; what the model does not have is left out.

    Returns
    -------
    P : (n, n) array
    values : (n,) array
        In the places of the states; zero where those are no biases.
    """
    M, values = np.eye(model.states, len(P)), np.zeros(model.states)
    M[STATES:, STATES:] = 0.0
    values[BG.start : BA.stop] = bias
    own = model.prior(np.zeros((STATES, STATES)))
    at = STATES
    for name, found in known.items():
        there, at = slice(at, at + len(found)), at + len(found)
        here = model.layout.slice_of(name)
        if here is not None:
            M[here, there], values[here], own[here, here] = np.eye(len(found)), found, 0.0
    for group, name, c in ((BG, SLOW_GYRO, whole.constant[:3]), (BA, SLOW_ACCEL, whole.constant[3:])):
        slow = model.layout.slice_of(name)
        if slow is None:
            continue
        s = np.diag(own)[slow].copy()
        process = model.groups[model.layout.names.index(name)]
        mean, late = time_average(whole.averaged / process.lasts[0])
        said = c + mean * s  # variance a priori of what the data see
        a, b = c / said, late * s / said
        M[group, group], M[slow, group] = np.diag(a), np.diag(b)
        own[group, group] = np.diag(c * (1.0 - a))
        own[slow, slow] = np.diag(s * (1.0 - late * b))
        own[group, slow] = own[slow, group] = np.diag(-c * b)
        values[slow] = b * values[group]
        values[group] = a * values[group]
    held = np.ones(len(P))
    held[5] = 0.0 if model.fixed_altitude else 1.0
    return M @ (P * np.outer(held, held)) @ M.T + own, values
