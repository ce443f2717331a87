"""Fixes that converge: a receiver that starts up is off by metres, says so row by row, and is off by the same for seconds.

What it says of a row is honest, and is no white noise: it estimates what it does not know yet, phase ambiguities or the delay of
the atmosphere, once and for all, and gets better. Of an estimate that new measurements improve, the error e_k is what is left of
the one before without what the new ones have shown: with ``s_j > s_k`` by what two rows say,

    E e_j e_k = s_k^2:    e_k = s_k x_k,    E x_j x_k = s_k / s_j,

and x is a Gauss-Markov process of variance one. Where s falls by e in a time T, T is its correlation time. Taken for white noise,
such fixes lead the velocity away by ``ds/dt x``, and the filter is the surer of it the more rows there are: aircraft and cars were
up to 16 sigmas off while their receiver converged.

How much of what a row says is such an error nobody knows: the sigma of a receiver in a street grows by noise as well. So a row
keeps all of it as white noise, too. The filter then has no less variance than either of the two makes, and its covariance bounds
that of both.

Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, sec. 4.2: errors of a recursive estimate of a constant. The rule is ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.position import CONVERGING_POSITION
from truenorth.aiding.source import Aiding
from truenorth.errors.group import Group
from truenorth.quality.slow_aids import FIXES, USUAL_TIME

Array = NDArray[np.float64]

CONVERGING = "GNSS convergence"  # the name of its states
LEAST = 12  # rows: two in each of the thirds
BEST = 0.1  # quantile of what the rows say: a receiver that has settled is no better than that
POOR, GOOD = 1.25, 1.02  # times that: first rows of one that has not, and the first of one that has
STEADY = 0.9  # of what a third of half a log has fallen by, the next third's: more is no end to be seen, or noise
SHORTEST = 1.0  # s, of a correlation time


class Convergence(NamedTuple):
    """How a receiver's fixes converge.

    Attributes
    ----------
    settled : (3,) array, m
        One sigma that its rows come down to.
    until : float, s
        The last row that has not; infinity: none has.
    time : float, s
        In which the error falls by e.
    """

    settled: Array
    until: float
    time: float

    def of(self, source: Aiding) -> Aiding:
        """A receiver's places with that error among their states."""
        said = np.where(np.isfinite(source.sigma), source.sigma, 0.0)
        open_ = np.sqrt(np.maximum(said**2 - self.settled**2, 0.0))
        return replace(
            source,
            kind=CONVERGING_POSITION,
            measured=np.hstack([source.measured, open_ * (source.time <= self.until)[:, None]]),
            states={**source.states, "own": Group(CONVERGING, np.ones(3), self.time)},
        )


def with_convergence(aiding: Sequence[Aiding]) -> list[Aiding]:
    """The same sources; a receiver's places whose first rows are poor and say so have that error among their states."""
    found = [(source, convergence(source) if source.name == FIXES else None) for source in aiding]
    return [source if converges is None else converges.of(source) for source, converges in found]


def convergence(source: Aiding) -> Convergence | None:
    """How a receiver's places converge; None: their first rows are as good as any, or too few."""
    order = np.argsort(source.time, kind="stable")
    order = order[np.isfinite(source.measured[order, :2]).all(axis=1)]
    said, time = source.sigma[order], source.time[order]
    if "own" in source.states or len(order) < LEAST or not np.isfinite(said).all():
        return None
    settled = _settled(said**2)
    if np.all(said[0] <= POOR * settled):
        return None
    # Until all axes have come down to what they settle at; what gets worse again later is another matter. The last of it counts:
    # of a vehicle that knows its velocity to millimetres a second, a third of a fix that is lost within seconds is many sigmas.
    good = np.all(said <= GOOD * settled, axis=1)
    first = int(np.argmax(good)) if good.any() else len(order)
    open_ = np.linalg.norm(np.sqrt(np.maximum(said**2 - settled**2, 0.0)), axis=1)
    open_[first:] = 0.0
    return Convergence(settled, float(time[first - 1]) if good.any() else math.inf, _lasts(time, open_))


def _settled(variance: Array) -> Array:
    """(3,) sigma that what rows say, of variances (M, 3) in order, comes down to; 0: it would go on falling beyond the last row.

    Of ``c + a exp(-2 t/T)`` at three times that are equally far apart, c is what Aitken's rule makes of them: the medians of thirds
    of the log's second half.
    """
    begun, half, end = (np.median(part, axis=0) for part in np.array_split(variance[len(variance) // 2 :], 3))
    fell, falls = begun - half, half - end
    goes_on = (fell > 0.0) & (falls > 0.0)
    ratio = np.where(goes_on, np.minimum(falls / np.where(goes_on, fell, 1.0), STEADY), 0.0)
    return np.asarray(np.sqrt(np.clip(end - falls * ratio / (1.0 - ratio), 0.0, np.quantile(variance, BEST, axis=0))))


def _lasts(time: Array, size: Array) -> float:
    """In which time, s, an error of such a size falls by e, no longer than slow errors usually last.

    Of ``exp(-t / T)`` the squares have the integral ``T / 2``.
    """
    lasts = 2.0 * float(np.sum(size[:-1] ** 2 * np.diff(time))) / float(np.max(size)) ** 2
    return min(max(lasts, SHORTEST), USUAL_TIME)
