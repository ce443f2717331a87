"""How likely a motion of the base makes a series of its velocity: the exact likelihood, and that of its periodogram.

A motion enters as orders of its oscillators (q,) and the logarithms (1 + 3 q,) of its white sigma and of sigma, frequency and
damping of each oscillator; many at once, since a search asks for derivatives.

Sources: A. M. Sykulski, S. C. Olhede et al., The debiased Whittle likelihood, Biometrika 106 (2), 2019;
:mod:`truenorth.filters.scalar` for the exact one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.windowed import hann
from truenorth.core.compiled import compiled
from truenorth.errors.sway import AxisMotion, Oscillator, add_autocovariance, fill_blocks
from truenorth.filters.scalar import LANES, in_lanes, products, restricted

Array = NDArray[np.float64]
Orders = NDArray[np.int64]

TREND = 4  # degree of the polynomial that takes what the first fit missed
LOWEST_BIN = 3  # slower than this is the trend's
# Of a grid's spacing: where a line is looked for, three times, each a tenth of the last.
FINER = np.linspace(-1.0, 1.0, 21)
LINES = 16  # that go through a lane of a filter at once: each is multiplied by all others


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

    def periodogram(self, frequencies: Array, interval: float) -> Array:
        """Expected at frequencies (m,), rad/s, of a series with a trend taken out; its density at zero is infinite."""
        difference = (2.0 * np.sin(0.5 * interval * frequencies[1:])) ** 2  # squared gain of it
        velocity = self.velocity**2 * interval / difference
        tilt = self.tilt**2 * interval**3 * (1.0 - difference / 6.0) / difference**2
        density = velocity + tilt
        return np.concatenate([density[:1], density])


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
    slow_is_motion : bool
        Whether a search takes what is slow for motion, and not for the walks.
    """

    def __init__(
        self,
        residual: Array,
        interval: float,
        walks: Walks,
        others: Array | None = None,
        *,
        slow_is_motion: bool = False,
    ) -> None:
        K = len(residual)
        basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, K), min(TREND, max(K - 8, 0)))
        if others is not None:
            basis = np.column_stack([basis, others])
        self.interval, self.walks = interval, walks.blocks(interval)
        self.columns = np.column_stack([residual, basis])
        self.lanes = in_lanes(self.columns)
        self.detrended = residual - basis @ np.linalg.lstsq(basis, residual, rcond=None)[0]
        taper = hann(K)
        taper /= math.sqrt(float(np.sum(taper**2)))
        self.taper_weights = taper
        spectrum = np.fft.rfft(taper, 2 * K)
        self.taper = np.fft.irfft(np.abs(spectrum) ** 2)[:K]  # its autocorrelation
        self.periodogram = np.abs(np.fft.rfft(taper * self.detrended)) ** 2
        self.frequencies: Array = np.asarray(2 * np.pi * np.fft.rfftfreq(K, interval), dtype=np.float64)
        walked = walks.periodogram(self.frequencies, interval)
        self.walked = np.zeros_like(walked) if slow_is_motion else walked
        self.lags: Array = interval * np.arange(K, dtype=np.float64)
        self.known: dict[
            AxisMotion, float
        ] = {}  # minus twice the restricted log-likelihood of motions that a search ended in

    def expected(self, orders: Orders, logs: Array) -> Array:
        """Expected periodograms (m, K // 2 + 1) of the tapered series, of motions with logarithms (m, 1 + 3 q) and the walks."""
        acf = np.zeros((len(logs), len(self.lags)))
        _folded_autocovariances(orders, *_values(logs), self.interval, self.taper, acf)
        return np.maximum(np.fft.rfft(acf).real, 1e-30) + self.walked

    def whittle(self, expected: Array) -> float:
        """Minus twice the debiased Whittle log-likelihood, of an expected periodogram."""
        f = expected[LOWEST_BIN:]
        return float((np.log(f) + self.periodogram[LOWEST_BIN:] / f).sum())

    def exact(self, orders: Orders, logs: Array) -> Array:
        """Minus twice the restricted log-likelihoods (m,) of motions with logarithms (m, 1 + 3 q)."""
        found = np.empty(len(logs))
        _deviances(orders, *_values(logs), self.interval, *self.walks, self.lanes, found)
        return found

    def lines(self, motion: AxisMotion, frequencies: Array) -> tuple[Array, Array]:
        """What lines of frequencies (m,), rad/s, would gain besides a motion and what is taken out, and their sigmas (m,), m/s.

        Of each the cosine and the sine go through the motion's filter as the columns that are taken out do.
        """
        orders, logs = parameters(motion)
        gain, sigma = np.empty((2, len(frequencies)))
        p = self.columns.shape[1]
        for first in range(0, len(frequencies), LANES * LINES):
            part = slice(first, first + LANES * LINES)
            # Shared out evenly; the last ones stand in a lane twice.
            m = -(-len(frequencies[part]) // LANES)
            own = np.minimum(first + np.arange(LANES * m), len(frequencies) - 1).reshape(LANES, m)
            phase = self.lags[:, None, None] * frequencies[own]
            pairs = np.swapaxes(np.concatenate([np.cos(phase), np.sin(phase)], axis=2), 1, 2)
            columns = np.concatenate([self.lanes, pairs], axis=1)
            grams = np.zeros((p + 2 * m, p + 2 * m, LANES))
            _products(orders, *_values(logs[None]), self.interval, *self.walks, columns, grams)
            for lane, which in enumerate(own):
                gain[which], sigma[which] = _gained(grams[..., lane], p)
        return gain, sigma

    def score(self, motion: AxisMotion) -> float:
        """Schwarz's criterion."""
        orders, logs = parameters(motion)
        if motion not in self.known:
            self.known[motion] = float(self.exact(orders, logs[None])[0])
        return self.known[motion] + math.log(len(self.lags)) * len(logs)


@lru_cache(maxsize=1)
def finer_grids(count: int, interval: float) -> tuple[NDArray[np.complex128], ...]:
    """What a line of `count` samples is turned by, to the points of three grids about any frequency: (21, count) each."""
    spacing, lags = 2 * np.pi / (count * interval), interval * np.arange(count, dtype=np.float64)
    return tuple(np.exp(-1j * np.outer(spacing / finer * FINER, lags)) for finer in (1.0, 10.0, 100.0))


def _gained(lower: Array, p: int) -> tuple[Array, Array]:
    """What m pairs of columns gain, and their sigmas, of the products of p others and of theirs; the lower half."""
    gram = lower + np.tril(lower, -1).T
    m = (len(gram) - p) // 2
    out = slice(1, p)
    left = gram - gram[:, out] @ np.linalg.solve(gram[out, out], gram[out])
    pairs = p + np.arange(m)[:, None] + [0, m]
    normal, match = left[pairs[:, :, None], pairs[:, None]], left[pairs, 0]
    size = np.linalg.solve(normal, match[..., None])[..., 0]
    return np.sum(size * match, axis=1), np.sqrt(0.5 * np.sum(size**2, axis=1))


def _values(logs: Array) -> tuple[Array, Array]:
    """Variances (m,) of what is white; sigma, frequency and damping of each oscillator (m, q, 3); of logarithms (m, 1 + 3 q)."""
    values = np.exp(logs)
    return np.ascontiguousarray(values[:, 0] ** 2), np.ascontiguousarray(values[:, 1:]).reshape(len(logs), -1, 3)


@compiled
def _folded_autocovariances(orders: Any, white: Any, tables: Any, interval: float, taper: Any, acf: Any) -> None:
    """Sums over lags -(K-1) .. K-1 of acf taper exp(-i w lag) are transforms of this at the frequencies of the series' own."""
    K = len(taper)
    for m in range(len(white)):
        add_autocovariance(orders, tables[m], interval, acf[m])
        acf[m, 0] += white[m]
        for k in range(K):
            acf[m, k] *= taper[k]
        for k in range(1, K // 2 + 1):  # a lag and the one that the transform takes for its negative
            both = acf[m, k] + acf[m, K - k]
            acf[m, k], acf[m, K - k] = both, both


@compiled
def _products(
    orders: Any, white: Any, tables: Any, interval: float, walk_Phi: Any, walk_Q: Any, Y: Any, gram: Any
) -> None:
    own, behind, driven, Q, P, h, r = _models(orders, white, tables, 0, interval, walk_Phi, walk_Q)
    products(own, behind, driven, Q, P, h, r, Y, len(h) - 2, gram, np.empty(LANES))


@compiled
def _deviances(
    orders: Any, white: Any, tables: Any, interval: float, walk_Phi: Any, walk_Q: Any, Y: Any, found: Any
) -> None:
    in_lanes = np.empty(LANES)
    for begin in range(0, len(white), LANES):
        own, behind, driven, Q, P, h, r = _models(orders, white, tables, begin, interval, walk_Phi, walk_Q)
        restricted(own, behind, driven, Q, P, h, r, Y, len(h) - 2, in_lanes)
        for lane in range(min(LANES, len(white) - begin)):
            found[begin + lane] = in_lanes[lane]


@compiled
def _models(orders: Any, white: Any, tables: Any, begin: int, interval: float, walk_Phi: Any, walk_Q: Any) -> Any:
    """Motions from one on, a lane each, and the walks behind them, as :func:`products` takes them.

    Where there are no motions left, the last one stands again.
    """
    n = 2
    for order in orders:  # np.sum would load a part of Numba that nothing else here needs, .2 s
        n += 2 * order
    own, behind, driven = np.zeros((n // 2, 4, LANES)), np.zeros((n // 2, 4, LANES)), np.zeros(n // 2, dtype=np.bool_)
    Q, P, h, r = np.zeros((n, n, LANES)), np.zeros((n, n, LANES)), np.zeros(n), np.zeros(LANES)
    for lane in range(len(r)):  # a length that the compiler knows is unrolled
        m = min(begin + lane, len(white) - 1)
        one_Phi, one_Q, one_P = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
        fill_blocks(orders, tables[m], interval, one_Phi, one_Q, one_P, h)
        for i in range(2):  # one by one: for blocks Numba compiles the message of shapes that differ, 3 s of strings
            for j in range(2):
                one_Phi[n - 2 + i, n - 2 + j], one_Q[n - 2 + i, n - 2 + j] = walk_Phi[i, j], walk_Q[i, j]
        for i in range(n):
            for j in range(n):
                Q[i, j, lane], P[i, j, lane] = one_Q[i, j], one_P[i, j]
            for j in range(2):
                first = i - i % 2
                own[i // 2, 2 * (i % 2) + j, lane] = one_Phi[i, first + j]
                if first > 0:
                    behind[i // 2, 2 * (i % 2) + j, lane] = one_Phi[i, first - 2 + j]
                    driven[i // 2] |= one_Phi[i, first - 2 + j] != 0.0
        r[lane] = white[m]
    h[n - 2] = 1.0
    return own, behind, driven, Q, P, h, r
