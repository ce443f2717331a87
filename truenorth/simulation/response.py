"""Bandwidth and latency of a sensor: a low pass and a delay of what it senses.

Both act on the running integral of the input, known at the ends of the intervals and taken as a polynomial through eight
of them: the delay is read off it, and each pole of the low pass integrates it exactly. For an oscillation of w the error is
of the order (w T)^8: an input of less than eight samples a period is not followed truly, as no sensor with a sensible
bandwidth would. Before the log the input is steady at the mean of the first interval.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]
POINTS = 8  # of the polynomial
NODES, WEIGHTS = np.polynomial.legendre.leggauss(64)


def respond(increments: Array, interval: float, *, bandwidth: float, order: int, latency: float) -> Array:
    """Increments as a sensor of finite bandwidth gives them, and late.

    Parameters
    ----------
    increments : (N, 3) array
    interval : float, s
    bandwidth : float, Hz
        At which the response has fallen by 3 dB; infinite: no low pass.
    order : {1, 2}
        One pole, or the two of Butterworth's filter.
    latency : float, s

    Returns
    -------
    (N, 3) array

    Raises
    ------
    UsageError
        Fewer than seven rows: the polynomial needs them.
    """
    if math.isinf(bandwidth) and latency == 0.0:
        return increments
    if len(increments) < POINTS - 1:
        raise UsageError(f"a log of {len(increments)} samples; bandwidth and latency need {POINTS - 1} at least")
    theta = np.zeros((len(increments) + 1, 3))
    np.cumsum(increments, axis=0, out=theta[1:])
    slope = theta[1].copy()  # before the log
    if math.isfinite(bandwidth):
        w = 2.0 * math.pi * bandwidth
        pole, gain = (complex(-w), complex(w)) if order == 1 else _butterworth(w)
        # Of dz/dt = p z + theta over one interval, for each place of the interval among the points.
        kernel = 0.5 * WEIGHTS * np.exp(pole * interval * 0.5 * (1.0 - NODES))
        weights = interval * (_basis(0.5 * (1.0 + NODES)) @ kernel)
        out = np.empty_like(theta)
        _low_pass(theta, slope, cmath.exp(pole * interval), gain, weights, -1.0 / (interval * pole**2), out)
        theta = out
    if latency > 0.0:
        samples = latency / interval
        whole = max(1, math.ceil(samples - 1e-9))
        out = np.empty_like(theta)
        _delay(theta, slope, samples, whole, _basis(np.array([whole - samples]))[:, :, 0].copy(), out)
        theta = out
    return np.diff(theta, axis=0)


def _butterworth(w: float) -> tuple[complex, complex]:
    """Pole and residue of ``w^2/(s^2 + sqrt(2) w s + w^2) = gain/(s - pole) + conjugate``; the gain doubled."""
    pole = w * complex(-1.0, 1.0) / math.sqrt(2.0)
    return pole, 2.0 * w**2 / (2j * pole.imag)


def _basis(fraction: Array) -> Array:
    """Lagrange's polynomials, (7, 8, M): of the m-th interval among the points, of each point, at its fractions (M,)."""
    points = np.arange(POINTS)
    at = np.arange(POINTS - 1)[:, None] + fraction
    result = np.ones((POINTS - 1, POINTS, len(fraction)))
    for j in points:
        for other in points[points != j]:
            result[:, j] *= (at - other) / (j - other)
    return result


@compiled
def _low_pass(theta: Any, slope: Any, decay: Any, gain: Any, weights: Any, steady: Any, out: Any) -> None:
    last = len(theta) - 1
    for i in range(3):
        z = steady * slope[i]
        out[0, i] = (gain * z).real
        for k in range(last):
            first = min(max(k - 3, 0), last - 7)
            z *= decay
            for j in range(POINTS):
                z += weights[k - first, j] * theta[first + j, i]
            out[k + 1, i] = (gain * z).real


@compiled
def _delay(theta: Any, slope: Any, samples: float, whole: int, weights: Any, out: Any) -> None:
    last = len(theta) - 1
    for k in range(last + 1):
        at = k - whole
        first = min(max(at - 3, 0), last - 7)
        for i in range(3):
            if at < 0:
                out[k, i] = theta[0, i] + (k - samples) * slope[i]
                continue
            total = 0.0
            for j in range(POINTS):
                total += weights[at - first, j] * theta[first + j, i]
            out[k, i] = total
