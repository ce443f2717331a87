"""How likely a motion of the base makes a series of its velocity: the exact likelihood, and that of its periodogram.

A motion enters as orders of its oscillators (q,) and the logarithms (1 + 3 q,) of its white sigma and of sigma, frequency and
damping of each oscillator; many at once, since a search asks for derivatives.

Sources: A. M. Sykulski, S. C. Olhede et al., The debiased Whittle likelihood, Biometrika 106 (2), 2019;
:mod:`truenorth.filters.scalar` for the exact one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.windowed import hann
from truenorth.core.compiled import compiled
from truenorth.errors.sway import AxisMotion, Oscillator, add_autocovariance, fill_blocks
from truenorth.filters.scalar import products, restricted

Array = NDArray[np.float64]
Orders = NDArray[np.int64]

TREND = 4  # degree of the polynomial that takes what the first fit missed
LOWEST_BIN = 3  # slower than this is the trend's
LINES = 16  # that go through a filter at once: each is multiplied by all others


@dataclass(frozen=True)
class Walks:
    """Random walks that reach the velocity besides the base's motion: of the accelerometers, and of the gyros through gravity."""

    velocity: float  # m/s/sqrt(s)
    tilt: float  # m/s^2/sqrt(s); random walk of angle times gravity

    def blocks(self, interval: float) -> tuple[Array, Array]:
        """Transition and noise of velocity and acceleration."""
        T, q, r = interval, self.velocity**2, self.tilt**2
        return (
            np.array([[1.0, T], [0.0, 1.0]]),
            np.array([[q * T + r * T**3 / 3, r * T**2 / 2], [r * T**2 / 2, r * T]]),
        )


def parameters(motion: AxisMotion) -> tuple[Orders, Array]:
    """Orders and logarithms of a motion."""
    orders, values = motion.table
    return orders, np.log(np.concatenate([[motion.white], values.ravel()]))


def motion_of(orders: Orders, logs: Array) -> AxisMotion:
    """The motion of such parameters."""
    values = np.exp(logs)
    items = [Oscillator(int(m), *row.tolist()) for m, row in zip(orders, values[1:].reshape(-1, 3), strict=True)]
    return AxisMotion(float(values[0]), tuple(items))


class Series:
    """Velocity of the base along one axis in the two forms in which the likelihoods take it.

    Parameters
    ----------
    residual : (K,) array, m/s
    interval : float, s
    walks : Walks
    others : (K, p) array, optional
        What is taken out besides the trend, each of unknown size.
    """

    def __init__(self, residual: Array, interval: float, walks: Walks, others: Array | None = None) -> None:
        K = len(residual)
        basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, K), min(TREND, max(K - 8, 0)))
        if others is not None:
            basis = np.column_stack([basis, others])
        self.interval, self.walks = interval, walks.blocks(interval)
        self.columns = np.column_stack([residual, basis])
        self.detrended = residual - basis @ np.linalg.lstsq(basis, residual, rcond=None)[0]
        taper = hann(K)
        taper /= math.sqrt(float(np.sum(taper**2)))
        self.taper_weights = taper
        spectrum = np.fft.rfft(taper, 2 * K)
        self.taper = np.fft.irfft(np.abs(spectrum) ** 2)[:K]  # its autocorrelation
        self.periodogram = np.abs(np.fft.rfft(taper * self.detrended)) ** 2
        self.frequencies = 2 * np.pi * np.fft.rfftfreq(K, interval)
        self.lags: Array = interval * np.arange(K, dtype=np.float64)

    def expected(self, orders: Orders, logs: Array) -> Array:
        """Expected periodograms (m, K // 2 + 1) of the tapered series, of motions with logarithms (m, 1 + 3 q)."""
        acf = np.zeros((len(logs), len(self.lags)))
        _autocovariances(orders, np.exp(logs), self.interval, acf)
        acf *= self.taper
        # Sum over lags -(K-1) .. K-1 of acf taper exp(-i w lag), at the frequencies of the series' own transform.
        acf[:, 1:] += acf[:, :0:-1].copy()
        return np.maximum(np.fft.rfft(acf).real, 1e-30)

    def whittle(self, expected: Array) -> float:
        """Minus twice the debiased Whittle log-likelihood, of an expected periodogram."""
        f = expected[LOWEST_BIN:]
        return float(np.sum(np.log(f) + self.periodogram[LOWEST_BIN:] / f))

    def exact(self, orders: Orders, logs: Array) -> Array:
        """Minus twice the restricted log-likelihoods (m,) of motions with logarithms (m, 1 + 3 q)."""
        found = np.empty(len(logs))
        _deviances(orders, np.exp(logs), self.interval, *self.walks, self.columns, found)
        return found

    def lines(self, motion: AxisMotion, frequencies: Array) -> tuple[Array, Array]:
        """What lines of frequencies (m,), rad/s, would gain besides a motion and what is taken out, and their sigmas (m,), m/s.

        Of each the cosine and the sine go through the motion's filter as the columns that are taken out do.
        """
        orders, logs = parameters(motion)
        gain, sigma = np.empty((2, len(frequencies)))
        for first in range(0, len(frequencies), LINES):
            part = slice(first, first + LINES)
            phase = np.outer(self.lags, frequencies[part])
            p, m = self.columns.shape[1], phase.shape[1]
            columns = np.concatenate([self.columns, np.cos(phase), np.sin(phase)], axis=1)
            gram = np.zeros((p + 2 * m, p + 2 * m))
            _products(orders, np.exp(logs), self.interval, *self.walks, columns, gram)
            gram += np.tril(gram, -1).T
            out = slice(1, p)
            left = gram - gram[:, out] @ np.linalg.solve(gram[out, out], gram[out])
            pairs = p + np.arange(m)[:, None] + [0, m]
            normal, match = left[pairs[:, :, None], pairs[:, None]], left[pairs, 0]
            size = np.linalg.solve(normal, match[..., None])[..., 0]
            gain[part], sigma[part] = np.sum(size * match, axis=1), np.sqrt(0.5 * np.sum(size**2, axis=1))
        return gain, sigma

    def score(self, motion: AxisMotion) -> float:
        """Schwarz's criterion."""
        orders, logs = parameters(motion)
        return float(self.exact(orders, logs[None])[0]) + math.log(len(self.lags)) * len(logs)


@compiled
def _autocovariances(orders: Any, values: Any, interval: float, acf: Any) -> None:
    for m in range(len(values)):
        add_autocovariance(orders, values[m, 1:].reshape(-1, 3), interval, acf[m])
        acf[m, 0] += values[m, 0] ** 2


@compiled
def _products(orders: Any, values: Any, interval: float, walk_Phi: Any, walk_Q: Any, Y: Any, gram: Any) -> None:
    Phi, Q, P, h, first = _model(orders, values, interval, walk_Phi, walk_Q)
    products(Phi, Q, P, h, values[0] ** 2, Y, first, gram)


@compiled
def _deviances(orders: Any, values: Any, interval: float, walk_Phi: Any, walk_Q: Any, Y: Any, found: Any) -> None:
    for m in range(len(values)):
        Phi, Q, P, h, first = _model(orders, values[m], interval, walk_Phi, walk_Q)
        found[m] = restricted(Phi, Q, P, h, values[m, 0] ** 2, Y, first)


@compiled
def _model(orders: Any, values: Any, interval: float, walk_Phi: Any, walk_Q: Any) -> Any:
    """Transition, noise, first covariance and output row of a motion and the walks behind it, and the motion's states."""
    n = 2
    for order in orders:  # np.sum would load a part of Numba that nothing else here needs, .2 s
        n += 2 * order
    Phi, Q, P, h = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    first = fill_blocks(orders, values[1:].reshape(-1, 3), interval, Phi, Q, P, h)
    for i in range(2):  # one by one: for blocks Numba compiles the message of shapes that differ, 3 s of strings
        for j in range(2):
            Phi[first + i, first + j], Q[first + i, first + j] = walk_Phi[i, j], walk_Q[i, j]
    h[first] = 1.0
    return Phi, Q, P, h, first
