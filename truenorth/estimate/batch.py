"""The batch estimator: a log is linearised about a nominal solution, estimated, and linearised anew until it settles.

Gauss and Newton's method on the whole log. What is estimated, and how, is left to others: a `Log` knows what is taken off it and
gives the linear system of what is left; `estimate` filters or fits that system. So one loop serves a base that is still, one that
sways, an indexer, a turntable, and the filters of the rotary paper (whose measurement and filters are its own, the loop is not).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import Estimates, LinearSystem
from truenorth.state.layout import PHI

if TYPE_CHECKING:
    from truenorth.state.track import Track

Array = NDArray[np.float64]

CONVERGED = 0.02  # a pass that moves no angle by more than this part of its sigma is the last
ROUGHLY = 0.3  # the same part, above which the answer is not to be trusted
LITTLE = 0.7  # a pass that moves back by more than this part of the one before comes to rest late or never
BACK = -0.5  # likeness of two steps, from 1 (the same) to -1 (opposite), that go to and fro
ROUNDS = 8  # passes, within which those that come to rest come nearer to it by ...
NEARER = 0.8  # ... this part
LEAST = 1.0 / 16.0  # of a step: with less they do not come that much nearer in so many, wherever they go


S_co = TypeVar("S_co", covariant=True)


class Log(Protocol[S_co]):
    """A log about a nominal solution."""

    def linearise(self) -> S_co:
        """The system of the errors of the nominal solution; or what a loop finds them by, row by row."""
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


S = TypeVar("S")
E = TypeVar("E", bound=HasState)


@dataclass(frozen=True)
class Settled(Generic[E]):
    """The last pass."""

    found: E  # what the estimator gave
    passes: int
    moved: float  # how much this pass would still move the nominal solution, in the unit of `moved` of :func:`settle`


def in_sigmas(states: slice) -> Callable[[Filtered], float]:
    """The largest of these states in units of its sigma: a measure for :func:`settle`."""
    return lambda found: float((np.abs(found.end[states]) / np.sqrt(found.P.diagonal()[states])).max())


def settle(
    log: Log[S],
    estimate: Callable[[S], E],
    moved: Callable[[E], float],
    *,
    enough: float = CONVERGED,
    most: int,
    least: int = 1,
) -> Settled[E]:
    """Linearise and estimate, and correct the nominal solution, until a pass moves nothing.

    Where the passes go to and fro, each about as far as the one before, half of a step is taken from there on (damped
    Gauss-Newton: J. Nocedal and S. Wright, Numerical Optimization, 2nd ed., section 10.3; how we see it is ours): the heading of
    a cheap IMU that turns is a convention, and what shows it bends within the tens of degrees that a pass moves it by. So it is
    where they go round in more than two, or anyhow, and come no nearer in `ROUNDS` passes: of a swing of tens of degrees they
    went round in four for ever.

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
    passes, share, before, last = 0, 1.0, math.inf, np.zeros(0)
    nearest, since = math.inf, 0
    while True:
        passes += 1
        found = estimate(log.linearise())
        by = moved(found)
        if passes >= most or (passes >= least and by < enough):
            return Settled(found, passes, by)
        end = np.array(found.end)
        nearest, since = (by, 0) if by < NEARER * nearest else (nearest, since + 1)
        if (since >= ROUNDS and share > LEAST) or (by > LITTLE * before and _likeness(end, last) < BACK):
            share, nearest, since = 0.5 * share, by, 0
        before, last, end = by, end, share * end
        del found  # a pass takes memory: none of it stays for the next
        log.correct(end)


@dataclass(frozen=True)
class OpenPass:
    """An open loop about a motion, and how far off it found that to be.

    Attributes
    ----------
    track : Track
    end : (n,) array
        Errors of the motion, as led back to the start.
    constants : sequence of str
        Groups that must come to rest besides attitude: arms, delays, a seat.
    """

    track: Track
    end: Array
    constants: Sequence[str]

    @property
    def moved(self) -> float:
        """The largest of attitude and constants in units of its sigma."""
        return moved_by(self.end, self.track, self.constants)


def moved_by(end: Array, track: Track, names: Iterable[str]) -> float:
    """The largest error of attitude and some groups, in units of its sigma at the end of a track.

    Parameters
    ----------
    end : (n,) array
        Errors of the nominal solution.
    track : Track
        That a filter has found them by.
    names : iterable of str
        Groups of its layout; one that it has not is passed over, and so is what is known.
    """
    sigma = track.sigma[-1]
    parts = (PHI, *(part for name in names if (part := track.layout.slice_of(name)) is not None))
    open_ = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    open_ = open_[sigma[open_] > 0.0]
    return float(np.max(np.abs(end[open_]) / sigma[open_]))


def _likeness(a: Array, b: Array) -> float:
    """Of two steps, each state by itself, whatever its unit: 1 where they are the same, -1 where they are opposite."""
    squares = a**2 + b**2
    return float(np.mean(2.0 * (a * b)[squares > 0.0] / squares[squares > 0.0]))
