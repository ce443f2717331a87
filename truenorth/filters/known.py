"""Filters whose covariance is known already: of logs that share all but their measurements, and come one after the other.

Covariances and gains do not depend on what was measured. :mod:`truenorth.filters.shared` works them out once for runs that are
there at once; here they are kept for those that come later. What is left of a filter is its state,

    y_k = z_k - H_k Phi_k x_(k-1),    x_k = Phi_k x_(k-1) + K_k y_k,

a tenth of the work. By rounding it is not the filter that takes row by row, so whether a log goes this way must not depend on what
is kept: :meth:`Common.known_with` works out what is not there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.filters.drive import History
from truenorth.filters.gains import SharedGains, factors, filter_gains
from truenorth.filters.kalman import kalman
from truenorth.filters.recursion import LOG_2PI
from truenorth.filters.stack import Array
from truenorth.filters.system import Estimates, FilterState, LinearSystem

MOST_KNOWN = 4  # of one system: noises and priors of a check and of an alignment


class Known:
    """What a Kalman filter makes of a system, whatever is measured. Nobody writes to it.

    Parameters
    ----------
    system : LinearSystem
        Of one run, with all rows present.
    """

    def __init__(self, system: LinearSystem) -> None:
        silent = system.with_made(z=np.zeros_like(system.z), x0=np.zeros(system.states))
        self.estimates = kalman(silent, history="full")
        gains = self.gains = SharedGains._make(filter_gains(silent, self.estimates))
        gains.L, gains.found = factors(self.estimates.innovation_covariance), {}
        gains.places = np.argwhere((gains.Phi != 0.0).any(axis=0))
        gains.values = np.empty((len(silent.z), len(gains.places)))
        gains.values[:] = gains.Phi[:, gains.places[:, 0], gains.places[:, 1]]
        self.size = float(np.log(gains.L.diagonal(axis1=1, axis2=2)).sum()) + 0.5 * silent.z.size * LOG_2PI

    def estimates_of(self, z: Array, x0: Array, history: History) -> Estimates:
        """What the filter makes of measurements (K, m) and a state before them."""
        silent, gains, count = self.estimates, self.gains, len(z)
        x, innovation, nis = np.empty(silent.x.shape), np.empty(z.shape), np.empty(count)
        _follow(gains.places, gains.values, gains.gain, gains.H_Phi, gains.L, z, x0, x, innovation, nis)
        log_likelihood = np.array(-0.5 * float(nis.sum()) - self.size)
        state = FilterState(x[-1], silent.P[-1], log_likelihood, silent.state.memory)
        first = count - 1 if history == "last" else 0
        of_states = x[first:], silent.sigma[first:], silent.P[first if history != "full" else 0 :]
        of_rows = innovation, silent.innovation_covariance, nis, log_likelihood
        return Estimates(*of_states, *of_rows, state, silent.adaptation)


class Common:
    """A system without measurements that many logs share, and what is known of it with each noise and prior.

    Parameters
    ----------
    system : LinearSystem
        Of one run, all of it in time. Its `R`, `z`, `x0` and `P0` are not what is shared.
    """

    def __init__(self, system: LinearSystem) -> None:
        self.system = system
        self._known: dict[tuple[bytes, bytes], Known] = {}
        self._noises: dict[bytes, tuple[Array, bytes]] = {}  # noise with so much more variance, and its bytes

    def with_log(self, z: Array, x0: Array, P0: Array) -> SharedSystem:
        """The system with what a log measured."""
        own = self.system
        shared = SharedSystem.__new__(SharedSystem)
        shared.__dict__.update(own.__dict__ | {"z": z, "x0": x0, "P0": P0, "common": self})
        return shared

    def noise_with(self, variance: Array) -> Array:
        """``R`` (K, m, m) with more variance (m,) on its diagonal; one array for all logs, to which nobody writes."""
        key = variance.tobytes()
        there = self._noises.get(key)
        if there is None:
            if len(self._noises) >= MOST_KNOWN:
                self._noises.clear()
            R = self.system.R + np.diag(variance)
            there = self._noises[key] = R, R.tobytes()
        return there[0]

    def known_with(self, R: Array, P0: Array) -> Known:
        """What a filter makes of it."""
        # Bytes that are the same object are not compared, and their hash is known.
        own = next((there for noise, there in tuple(self._noises.values()) if noise is R), None)
        key = R.tobytes() if own is None else own, P0.tobytes()
        known = self._known.get(key)
        if known is None:
            known = Known(self.system.with_made(R=R, P0=P0))
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            self._known[key] = known
        return known


@dataclass(frozen=True)
class SharedSystem(LinearSystem):
    """The system of a log, of which others share what its measurements do not decide."""

    common: ClassVar[Common | None] = None  # each has its own; without one it is a system like any other

    def known(self) -> Known | None:
        """What a filter makes of it; None where something else than a log's own has been put in the place of what is shared."""
        common = self.common
        if common is None or any(
            getattr(self, name) is not getattr(common.system, name) for name in ("Phi", "Q", "H", "S", "u")
        ):
            return None
        return common.known_with(self.R, self.P0)


@compiled
def _follow(
    places: Any, values: Any, gain: Any, H_Phi: Any, L: Any, z: Any, x0: Any, x: Any, innovation: Any, nis: Any
) -> None:
    """State behind each epoch, innovations, and the squares of those made white."""
    n, m = gain.shape[1], gain.shape[2]
    before, now, white = x0.copy(), np.zeros(n), np.zeros(m)
    for k in range(len(z)):
        nis[k] = 0.0
        for a in range(m):
            y = z[k, a]
            for i in range(n):
                y -= H_Phi[k, a, i] * before[i]
            innovation[k, a] = y
            for c in range(a):
                y -= L[k, a, c] * white[c]
            white[a] = y / L[k, a, a]
            nis[k] += white[a] * white[a]
        for i in range(n):
            now[i] = 0.0
            for a in range(m):
                now[i] += gain[k, i, a] * innovation[k, a]
        for e in range(len(places)):
            now[places[e, 0]] += values[k, e] * before[places[e, 1]]
        for i in range(n):
            x[k, i] = before[i] = now[i]
