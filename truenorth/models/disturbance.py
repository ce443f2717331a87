"""How a base moves that goes nowhere: white motion and lightly damped oscillators, as states of a filter.

The output of an oscillator is the *velocity* of a displacement that stays bounded: its spectrum vanishes at zero frequency, so
that a filter which knows it takes no slow change of velocity for sway. Two kinds, driven by white noise n,

    order 1   x''  = -w^2 x  - 2 zeta w x'  + n,                                             output x'
    order 2   x1'' = -w^2 x1 - 2 zeta w x1' + n,   x2'' = -w^2 x2 - 2 zeta w x2' + x1',      output x2'

the second for narrow-band swell, whose spectrum falls faster beside its peak. Without damping it is a sinusoid of unknown
amplitude and phase.

Source: T. I. Fossen, *Handbook of Marine Craft Hydrodynamics and Motion Control*, 2011, sec. 8.2.6 (linear approximations of
wave spectra).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # over a step of up to half a period: exact to rounding


@dataclass(frozen=True)
class Oscillator:
    """One oscillator.

    Attributes
    ----------
    order : {1, 2}
    sigma : float, m/s
        Of the velocity that it puts out.
    frequency : float, rad/s
    damping : float
        Fraction of the critical, above 0 and below 1.
    """

    order: int
    sigma: float
    frequency: float
    damping: float

    @property
    def states(self) -> int:
        """Displacement and velocity, of each stage."""
        return 2 * self.order

    @cached_property
    def stationary(self) -> Array:
        """(n, n) covariance of the states at any time."""
        w, damp = self.frequency, 2.0 * self.damping * self.frequency
        first = np.array([1.0 / w**2, 1.0])  # of a stage with unit variance of velocity
        if self.order == 1:
            return np.diag(self.sigma**2 * first)
        # The Lyapunov equation of the two stages, by hand: with stage 1 of unit velocity (x1, v1), stage 2 (x2, v2),
        # E[v1 x2] = -E[x1 v2] = p, E[x1 x2] = r, E[v1 v2] = s; A P + P A' + noise = 0 gives p = 0 = s - w^2 r + ...
        s = 1.0 / (2.0 * damp)  # d/dt E[v1 v2] = -2 damp s - w^2 (E[x1 v2] + E[v1 x2]) + E[v1^2] = 0
        v2 = s / damp  # d/dt E[v2^2] = -2 damp v2 + 2 s = 0
        P = np.zeros((4, 4))
        P[[0, 1, 2, 3], [0, 1, 2, 3]] = first[0], first[1], v2 / w**2, v2
        P[1, 3] = P[3, 1] = s
        P[0, 2] = P[2, 0] = s / w**2  # d/dt E[x1 v2] = s - w^2 r = 0
        return self.sigma**2 / v2 * P

    def transition(self, interval: float) -> Array:
        """(n, n) over an interval, s."""
        one = self._stage(np.asarray(interval))
        if self.order == 1:
            return one
        Phi = np.zeros((4, 4))
        Phi[:2, :2] = Phi[2:, 2:] = one
        Phi[2:, :2] = self._coupled(np.asarray(interval))
        return Phi

    def noise(self, interval: float) -> Array:
        """(n, n) covariance that an interval adds, ``int exp(A s) n exp(A' s) ds``: what keeps the states stationary."""
        density = 4.0 * self.damping * self.frequency * self.stationary[1, 1]  # of n
        s = 0.5 * interval * (1.0 + NODES)
        reached = self._stage(s)[:, :, 1]
        if self.order == 2:
            reached = np.concatenate([reached, self._coupled(s)[:, :, 1]], axis=1)
        Q: Array = (0.5 * interval * density * WEIGHTS * reached.T) @ reached
        return 0.5 * (Q + Q.T)

    def _stage(self, t: Array) -> Array:
        """``exp(A t)`` of one stage, (..., 2, 2)."""
        w, decay = self.frequency, self.damping * self.frequency
        turn = w * math.sqrt(1.0 - self.damping**2)
        fade = np.exp(-decay * t)
        c, s = fade * np.cos(turn * t), fade * np.sin(turn * t) / turn
        out = np.empty((*t.shape, 2, 2))
        out[..., 0, 0], out[..., 0, 1] = c + decay * s, s
        out[..., 1, 0], out[..., 1, 1] = -(w**2) * s, c - decay * s
        return out

    def _coupled(self, t: Array) -> Array:
        """``int_0^t exp(A (t - s)) B exp(A s) ds``, (..., 2, 2), where B takes x1' to x2''."""
        s = 0.5 * t[..., None] * (1.0 + NODES)
        after, before = self._stage(t[..., None] - s)[..., 1], self._stage(s)[..., 1, :]
        return np.einsum("...k,...ki,...kj->...ij", 0.5 * t[..., None] * WEIGHTS, after, before)

    @property
    def output(self) -> Array:
        """(n,) row that takes the states to the velocity put out."""
        row = np.zeros(self.states)
        row[-1] = 1.0
        return row


@dataclass(frozen=True)
class AxisMotion:
    """Motion of the base along one axis.

    Attributes
    ----------
    white : float, m/s
        One sigma of what is white in the mean velocity of an interval.
    oscillators : tuple of Oscillator
    """

    white: float
    oscillators: tuple[Oscillator, ...] = ()

    @property
    def states(self) -> int:
        """Of all oscillators."""
        return sum(item.states for item in self.oscillators)

    @property
    def sigma(self) -> float:
        """One sigma of the mean velocity of an interval, m/s."""
        return math.sqrt(self.white**2 + sum(item.sigma**2 for item in self.oscillators))

    def blocks(self, interval: float) -> tuple[Array, Array, Array, Array]:
        """Transition, process noise, stationary covariance (n, n), and output row (n,), of all oscillators."""
        n = self.states
        Phi, Q, P, h = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        first = 0
        for item in self.oscillators:
            part = slice(first, first + item.states)
            Phi[part, part], Q[part, part], P[part, part] = _matrices(item, interval)
            h[part] = item.output
            first = part.stop
        return Phi, Q, P, h


@lru_cache(maxsize=256)
def _matrices(item: Oscillator, interval: float) -> tuple[Array, Array, Array]:
    """Transition, process noise and stationary covariance; kept, since a search moves one oscillator at a time."""
    return item.transition(interval), item.noise(interval), item.stationary
