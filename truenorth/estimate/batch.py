"""The batch estimator: a log is linearised about a nominal solution, estimated, and linearised anew until it settles.

Gauss and Newton's method on the whole log. What is estimated, and how, is left to others: a `Log` knows what is taken off it and
gives the linear system of what is left; `estimate` filters or fits that system. So one loop serves a base that is still, one that
sways, an indexer, a turntable, and the filters of the rotary paper (whose measurement and filters are its own, the loop is not).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import Estimates, LinearSystem

Array = NDArray[np.float64]

CONVERGED = 0.02  # a pass that moves no angle by more than this part of its sigma is the last
ROUGHLY = 0.3  # the same part, above which the answer is not to be trusted


class Log(Protocol):
    """A log about a nominal solution."""

    def linearise(self) -> LinearSystem:
        """The system of the errors of the nominal solution."""
        ...

    def correct(self, x: Array) -> None:
        """Take the errors (n,), as known at the last epoch, off the nominal solution."""
        ...


class HasState(Protocol):
    """What an estimator gives: the state at the last epoch among it."""

    @property
    def end(self) -> Array:
        """(n,) errors of the nominal solution at the last epoch."""
        ...


@dataclass(frozen=True)
class Filtered:
    """A system and what a filter made of it."""

    system: LinearSystem  # as filtered: its noise may have been fitted on the way
    estimates: Estimates  # with the history that the next step needs

    @property
    def end(self) -> Array:
        """(n,) the last state."""
        return self.estimates.x[-1]

    @property
    def P(self) -> Array:
        """(n, n) its covariance."""
        return self.estimates.P[-1]


E = TypeVar("E", bound=HasState)


@dataclass(frozen=True)
class Settled(Generic[E]):
    """The last pass."""

    found: E  # what the estimator gave
    passes: int
    moved: float  # how much this pass would still move the nominal solution, in the unit of `moved` of :func:`settle`


def in_sigmas(states: slice) -> Callable[[Filtered], float]:
    """The largest of these states in units of its sigma: a measure for :func:`settle`."""
    return lambda found: float(np.max(np.abs(found.end[states]) / np.sqrt(np.diag(found.P)[states])))


def settle(
    log: Log,
    estimate: Callable[[LinearSystem], E],
    moved: Callable[[E], float],
    *,
    enough: float = CONVERGED,
    most: int,
    least: int = 1,
) -> Settled[E]:
    """Linearise and estimate, and correct the nominal solution, until a pass moves nothing.

    Parameters
    ----------
    log : Log
        Left as the last pass was linearised about it: what that pass found is the error of it.
    estimate : callable
        Of a system: a filter, a smoother or a fit; may remember from pass to pass.
    moved : callable
        How far off the nominal solution was, of what `estimate` gives.
    enough : float
        The pass that moves less is the last.
    most, least : int
        Passes.
    """
    passes = 0
    while True:
        passes += 1
        found = estimate(log.linearise())
        by = moved(found)
        if passes >= most or (passes >= least and by < enough):
            return Settled(found, passes, by)
        end = np.array(found.end)
        del found  # a pass takes memory: none of it stays for the next
        log.correct(end)
