"""Scalar signals of speed, track, slope and bank: piecewise polynomials, smooth to the third derivative.

A ramp changes a value at a constant rate; its rate itself fades in and out over an *onset* by the quintic step
``S(x) = 10 x^3 - 15 x^4 + 6 x^5``, so that an acceleration or a turn has no jerk that a real vehicle could not follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.compiled import compiled

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Profile:
    """A piecewise polynomial; its first and last piece go on beyond its ends."""

    breaks: Array  # (K+1,): of time (s) or distance (m), increasing
    coefficients: Array  # (D, K): of each piece in powers of the distance from its left end, the highest first

    def __call__(self, x: ArrayLike) -> tuple[Array, Array, Array]:
        """Value, first and second derivative at `x`, of any shape."""
        x = np.asarray(x, dtype=np.float64)
        found = np.empty((3, x.size))
        _evaluate(x.ravel(), self.breaks, *self._pieces, found)
        value, first, second = (row.reshape(x.shape) for row in found)
        return value, first, second

    @cached_property
    def _pieces(self) -> tuple[Array, NDArray[np.int64]]:
        """Coefficients (K, D, 3) of value and derivatives, the lowest power first; how many of each piece are not zero, (K,)."""
        c = self.coefficients[::-1].T
        power = np.arange(c.shape[1], dtype=np.float64)
        found = np.zeros((*c.shape, 3))
        found[..., 0] = c
        found[:, :-1, 1] = c[:, 1:] * power[1:]
        found[:, :-2, 2] = c[:, 2:] * (power[2:] * power[1:-1])
        return found, np.max(np.where(c != 0.0, 1 + np.arange(c.shape[1]), 0), axis=1)

    def integral(self) -> Profile:
        """The antiderivative, zero at the first break."""
        from scipy.interpolate import PPoly

        whole = PPoly(self.coefficients, self.breaks).antiderivative()
        return Profile(np.asarray(whole.x), np.asarray(whole.c))


@dataclass(frozen=True)
class Ramp:
    """A change of a value: from `start` on, for `length`, with onsets of `onset` at both ends."""

    start: float
    length: float
    change: float
    onset: float


def profile(value: float, ramps: Sequence[Ramp]) -> Profile:
    """A value that stays constant but for its ramps.

    Parameters
    ----------
    value : float
        Before the first ramp.
    ramps : sequence of Ramp
        In order, not overlapping.
    """
    breaks, pieces = [min(0.0, ramps[0].start if ramps else 0.0) - 1.0], []

    def add(stop: float, *powers: float) -> None:
        """A piece up to `stop`; `powers` of the distance from its left end, the lowest first."""
        if stop <= breaks[-1]:
            return
        pieces.append([*powers, *[0.0] * (7 - len(powers))][::-1])
        breaks.append(stop)

    for ramp in ramps:
        add(ramp.start, value)
        onset = min(ramp.onset, 0.5 * ramp.length)
        rate = ramp.change / (ramp.length - onset)
        rise = rate / onset**3, rate / onset**4, rate / onset**5
        half = 0.5 * rate * onset
        left = ramp.start
        add(left + onset, value, 0.0, 0.0, 0.0, 2.5 * rise[0], -3.0 * rise[1], rise[2])
        steady = ramp.length - 2 * onset
        if steady > 1e-12 * ramp.length:
            add(left + onset + steady, value + half, rate)
        top = value + half + rate * steady
        add(left + ramp.length, top, rate, 0.0, 0.0, -2.5 * rise[0], 3.0 * rise[1], -rise[2])
        value = value + ramp.change
    add(breaks[-1] + 1.0, value)
    return Profile(np.array(breaks), np.array(pieces).T)


def lead_in(value: float, start: float, length: float, rate: float) -> Profile:
    """A value whose rate fades in from zero over `length` and stays: the track of a ring."""
    rise = 2.5 * rate / length**3, -3.0 * rate / length**4, rate / length**5
    pieces = [
        [0.0] * 6 + [value],
        [*rise[::-1], 0.0, 0.0, 0.0, value],
        [0.0] * 5 + [rate, value + 0.5 * rate * length],
    ]
    return Profile(np.array([start - 1.0, start, start + length, start + length + 1.0]), np.array(pieces).T)


def pulse(start: float, stop: float, fade: float) -> Profile:
    """Zero, then one between `start` and `stop`, then zero; fading in and out inside the window."""
    fades = [Ramp(start, fade, 1.0, 0.5 * fade), Ramp(stop - fade, fade, -1.0, 0.5 * fade)]
    return profile(0.0, fades)


@compiled
def _evaluate(x: Any, breaks: Any, pieces: Any, sizes: Any, found: Any) -> None:
    """Value and derivatives (3, N) at `x` (N,), of which neighbours are mostly of one piece."""
    last = len(sizes) - 1
    piece = 0
    for k in range(len(x)):
        if not breaks[piece] <= x[k] < breaks[piece + 1]:
            piece = min(max(np.searchsorted(breaks, x[k], "right") - 1, 0), last)
        away = x[k] - breaks[piece]
        value, first, second, power = 0.0, 0.0, 0.0, 1.0
        for j in range(sizes[piece]):
            value += pieces[piece, j, 0] * power
            first += pieces[piece, j, 1] * power
            second += pieces[piece, j, 2] * power
            power *= away
        found[0, k], found[1, k], found[2, k] = value, first, second
