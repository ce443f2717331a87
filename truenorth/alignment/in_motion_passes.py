"""Passes over the log of a vehicle under way, until the heading that one begins with is the one that it leads back to."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.in_motion_start import Guess, backtracked, led_back
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.attitude import dcm_from_euler
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.state.layout import PHI
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

MORE_PASSES = 6  # at the most, where what was learnt of the sensors still changes, or heading
SETTLED = 0.3  # of its sigma, that heading may still move
# A pass that follows the heading that it begins with by more than this has too narrow a guess: the next has twice its sigma.
# Steps are up to ten times what a pass moves.
FOLLOWED, MOST_FOLLOWED = 0.75, 0.9
# Of the guess's sigma, by which two guesses must differ that show how far passes follow them: level and biases, which they begin
# with too, move heading by less.
LEAST_TURN = 0.3


@dataclass(frozen=True)
class Pass:
    """One pass over the log.

    The guess that it begins with has a heading of the pass before, with a narrow sigma, since errors are linear about a narrow
    guess only. A pass then follows its guess, and moves by a part of the way to what the log says. By how much, two passes show:
    the secant rule finds where a pass does not move any more, and what is known of heading without the guess (ours).

    Attributes
    ----------
    task : MovingTask
    guess : Guess
    track : Track
    back : (3, 3) array
        Attitude at the beginning that the track leads back to.
    response : float
        Change of heading in `back` by that in `guess`; zero where the guess is no other pass's.
    """

    task: MovingTask
    guess: Guess
    track: Track
    back: Array
    response: float = 0.0

    @property
    def turned(self) -> float:
        """By which it leads away from its guess, about the vertical, rad."""
        return turn_between(self.back, self.guess.C_nb)

    @property
    def step(self) -> float:
        """From the guess to the heading at which a pass would stay, rad."""
        return self.turned / (1.0 - self.response)

    @property
    def settled(self) -> bool:
        """Whether heading would stay nearly where it is."""
        return abs(self.step) <= SETTLED * self.sigma

    @property
    def sigma(self) -> float:
        """Of heading at the end, rad, the guess counted."""
        return float(self.track.sigma[-1, PHI][2])

    @property
    def used_twice(self) -> float:
        """One sigma, rad, by which heading is known less than the track says, since its guess is of the same log."""
        return self.guess.heading_sigma * self.response / math.sqrt(1.0 - self.response)

    @property
    def unsettled(self) -> float:
        """How far heading may still move, rad."""
        return 0.0 if self.settled else abs(self.step)


def begun(task: MovingTask, guess: Guess, track: Track) -> Pass:
    """A pass whose guess is of no other pass."""
    return Pass(task, guess, track, backtracked(task.record, track))


def once_more(task: MovingTask, before: Pass, first: Guess) -> Pass:
    """The next pass, from where the one before would settle; `first`: the guess of the first.

    Raises
    ------
    DataError
        The filter broke down.
    """
    guess = led_back(before.track, before.back, task.spec, first)
    follows = before.guess is not first
    if follows:  # passes that are compared begin with the same sigma
        narrow = before.response > FOLLOWED
        sigma = before.guess.heading_sigma * (2.0 if narrow else 1.0)
        guess = replace(guess, heading_sigma=min(first.heading_sigma, sigma))
    C = dcm_from_euler(before.turned - before.step, 0.0, 0.0) @ before.back
    guess = replace(guess, C_nb=C)
    track = task.run(guess, gated=True)
    back = backtracked(task.record, track)
    return Pass(task, guess, track, back, _response(task, guess, track, back, before if follows else None, first))


def _response(task: MovingTask, guess: Guess, track: Track, back: Array, before: Pass | None, first: Guess) -> float:
    """By the secant of two passes of one task; before there are two, by the filter's own sigma.

    That one counts what gyro biases do to heading until the end, too: it alone makes no guess wider.
    """
    if guess.heading_sigma >= first.heading_sigma:
        return 0.0
    if before is not None and guess.heading_sigma == before.guess.heading_sigma:
        change = turn_between(guess.C_nb, before.guess.C_nb)
        if abs(change) <= LEAST_TURN * guess.heading_sigma:
            return before.response
        if task is before.task:
            return float(np.clip(turn_between(back, before.back) / change, 0.0, MOST_FOLLOWED))
    return min(float(track.sigma[-1, PHI][2]) ** 2 / guess.heading_sigma**2, FOLLOWED)


def turn_between(C: Array, D: Array) -> float:
    """From D to C about the vertical, rad."""
    R = C @ D.T
    return float(math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))


def fits_worse(track: Track, other: Track) -> bool:
    """Whether the log speaks for the first of two tracks by more than chance does, or the other rejects more of it."""
    rejected = sum(
        int(np.sum(b.used)) < int(np.sum(a.used)) for a, b in zip(track.residuals, other.residuals, strict=True)
    )
    return rejected > 0 or likelihood_ratio(other.residuals, track.residuals) > limit("rival")
