"""How much a base moves that stays where it is, as measurement noise: read from the innovations of the filter itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.errors.staying import QUIETEST_BASE
from truenorth.estimate.batch import Filtered
from truenorth.filters import Estimates, LinearSystem, kalman
from truenorth.filters.gains import SharedGains
from truenorth.filters.known import Known, SharedSystem

Array = NDArray[np.float64]

SAME_NOISE = 0.1  # of the expected innovation variance
COLOUR_BLOCK = 10  # epochs over which the innovations are added up to see colour
COLOUR_ALARM = 3.0902  # quantile of a normal that white innovations exceed once in a thousand
COLOUR_RUNS = 5  # fewer blocks than this show nothing of it


def white_variance(velocity: Array) -> Array:
    """Variance (m,) of what is white in a velocity (K, m): half the variance of its differences.

    A start for the variance of the base's motion that slow errors of the INS do not enter; a bias of 100 ug is a difference of
    a mm/s every second.
    """
    found = np.empty(velocity.shape[1])
    _differ(velocity, found)
    return np.maximum(0.5 * found, QUIETEST_BASE**2)


@compiled
def _differ(velocity: Any, found: Any) -> None:
    """Variance (m,) of the differences of neighbours of (K, m)."""
    count = len(velocity) - 1
    for i in range(len(found)):
        total = squares = 0.0
        for k in range(count):
            total += velocity[k + 1, i] - velocity[k, i]
        mean = total / count
        for k in range(count):
            squares += (velocity[k + 1, i] - velocity[k, i] - mean) ** 2
        found[i] = squares / count


def base_variance(estimates: Estimates, R: Array, colour: bool) -> tuple[Array, Array]:
    """Variance of the base's velocity that makes the innovations as large as expected, at low frequency too.

    Returns it with the expected variance of the innovations: the mean of all epochs, weighted by what each shows of R, one over the
    square of its variance. A plain mean is that of the first epochs under a wide prior: steps of its size went from nothing to
    metres a second and back, or nowhere.
    """
    return _variance_of(estimates.innovation, estimates.innovation_covariance, R, colour)


def _variance_of(innovation: Array, covariance: Array, R: Array, colour: bool) -> tuple[Array, Array]:
    """:func:`base_variance` of innovations (K, 3) and their covariances (K, 3, 3)."""
    asked, expected = np.empty((2, 3))
    _ask(innovation, covariance, R, colour, asked, expected)
    return asked, expected


@compiled
def _ask(innovation: Any, covariance: Any, R: Any, colour: bool, asked: Any, expected: Any) -> None:
    """:func:`base_variance`, axis by axis."""
    skip = min(5, len(innovation) // 5)
    count = len(innovation) - skip
    blocks = count // COLOUR_BLOCK
    colour = colour and blocks >= COLOUR_RUNS
    # What white noise itself may give: Wilson and Hilferty's limit of chi-square over its freedom, 1 % at 5 blocks.
    freedom = 2.0 / (9.0 * max(blocks, 1))
    chance = (1.0 - freedom + COLOUR_ALARM * np.sqrt(freedom)) ** 3
    for i in range(len(R)):
        squares, weighted, weights, low = 0.0, 0.0, 0.0, 0.0
        whole, total = 0, 0.0
        for k in range(skip, len(innovation)):
            nu, variance = innovation[k, i], covariance[k, i, i]
            squares += nu * nu / variance
            weighted += 1.0 / variance
            weights += 1.0 / variance**2
            total += nu / np.sqrt(variance)
            whole += 1
            if whole == COLOUR_BLOCK:
                low += total * total
                whole, total = 0, 0.0
        ratio = squares / count
        # White innovations add up as their variances. A base that wanders slowly adds up to more, and that is what tilts
        # the answer: then R is what a white noise of that low-frequency density would have. Less is never taken off.
        low = low / max(blocks, 1) / COLOUR_BLOCK
        # Innovations within it are left alone although they are coloured: a larger R would only colour them more.
        if colour and low > chance * ratio:
            ratio = max(ratio, low if low > chance else 1.0)
        expected[i] = weighted / weights
        asked[i] = np.maximum(R[i] + (ratio - 1.0) * expected[i], QUIETEST_BASE**2)


class _Bracket:
    """Variances that were too small and too large: a step that leaves them goes to their geometric middle, and not round."""

    def __init__(self) -> None:
        self.small, self.large = [0.0] * 3, [math.inf] * 3

    def within(self, before: list[float], asked: list[float]) -> list[float]:
        """Where to go from a variance, of three axes each, of which another one is asked for."""
        return [self._of_axis(i, before[i], asked[i]) for i in range(3)]

    def _of_axis(self, i: int, before: float, asked: float) -> float:
        if asked > before:
            self.small[i] = max(self.small[i], before)
        else:
            self.large[i] = min(self.large[i], before)
        small, large = self.small[i], self.large[i]
        closed = 0.0 < small < large < math.inf
        return math.sqrt(small * large) if closed and (asked >= large or asked <= small) else asked


@dataclass(frozen=True)
class FilteredAsKnown(Filtered):
    """With the gains that other logs share."""

    gains: SharedGains


class VelocityNoise:
    """An estimator that filters with the variance of the base's velocity that the innovations ask for.

    First as white, then for its colour. The variance is remembered from pass to pass.

    Parameters
    ----------
    R : (K, 3) array, (m/s)^2
        Variance of the base's mean velocity over each interval (E, N, U), to begin with.
    parts : sequence of (K,) bool arrays
        Intervals that share one variance.
    most : int
        Filter runs at the most, for white and for coloured motion each.
    history : bool
        Whether the estimates of every epoch are wanted, or those of the last alone.
    coloured : bool
        Whether the variance covers a base that wanders slowly, too. It is larger then than the likeliest.
    usual : bool
        Whether R, to begin with, is that of all bases at rest: what a filter makes of a system that logs share is known with it.
    """

    def __init__(
        self,
        R: Array,
        parts: Sequence[NDArray[np.bool_]],
        most: int,
        *,
        history: bool = True,
        coloured: bool = True,
        usual: bool = False,
    ) -> None:
        self.usual = R if usual else None
        self.R, self.most, self.history = R, most, history
        self.whole = len(parts) == 1 and bool(parts[0].all())
        self.rows: list[Any] = [slice(None)] if self.whole else list(parts)  # of each part
        self.colours = (False, True) if coloured else (False,)

    def __call__(self, quiet: LinearSystem) -> Filtered:
        """Filter a system that holds the variance of the quietest base so far."""
        system = self._with_motion(quiet)
        known = self._known(system)
        estimates = self._filtered(system, known)
        for colour in self.colours:
            brackets = [_Bracket() for _ in self.rows]
            for _ in range(self.most):
                R, same = self.R.copy(), True
                for rows, bracket in zip(self.rows, brackets, strict=True):
                    nu, covariance = estimates.innovation[rows], estimates.innovation_covariance[rows]
                    now = self.R[rows][0]
                    asked, expected = (x.tolist() for x in _variance_of(nu, covariance, now, colour))
                    before = now.tolist()
                    R[rows] = after = bracket.within(before, asked)
                    # The vertical carries no attitude.
                    same &= all(abs(after[i] - before[i]) < SAME_NOISE * expected[i] for i in (0, 1))
                if same:
                    break
                self.R = R
                system = self._with_motion(quiet)
                known = None
                estimates = self._filtered(system, known)
        return Filtered(system, estimates) if known is None else FilteredAsKnown(system, estimates, known.gains)

    @property
    def of_base(self) -> Array:
        """(3,) the variance of its first part."""
        return np.asarray(self.R[self.rows[0]][0])

    def _known(self, system: LinearSystem) -> Known | None:
        """What a filter makes of a system that logs share, as long as the variance is the usual one."""
        return system.known() if self.usual is self.R and isinstance(system, SharedSystem) else None

    def _filtered(self, system: LinearSystem, known: Known | None) -> Estimates:
        if known is not None:
            return known.estimates_of(system.z, system.x0, "full" if self.history else "last")
        return kalman(system, history="full" if self.history else "last", innovations=True)

    def _with_motion(self, quiet: LinearSystem) -> LinearSystem:
        if self.usual is self.R and self.whole and isinstance(quiet, SharedSystem) and quiet.common is not None:
            return quiet.with_made(R=quiet.common.noise_with(self.R[0] - QUIETEST_BASE**2))
        own = self.R[:1] if self.whole else self.R
        R, more = np.empty((len(self.R), 3, 3)), np.zeros((len(own), 3, 3))
        more.reshape(len(more), -1)[:, ::4] = own - QUIETEST_BASE**2  # its diagonal
        np.add(quiet.R, more, out=R)
        return quiet.with_made(R=R)
