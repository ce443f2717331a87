"""The motion of a base that sways, as states of the filter of its alignment: fitted to what is left, and fitted anew.

A motion is fitted to the velocity that a nominal solution leaves. That has the error of its attitude in it, and a motion explains
what it is fitted to: about an attitude that is off it is too large, and the next pass moves less than it should. So it is fitted
anew as long as that shows. Industrial gyros on an indexer of a moored ship: the windowed fit was 1.4 deg off in level; fitted once
about that, the motion was .5 m/s for .05, twice the log-likelihood 4340 for 6560, and level 8 sigmas off. A tactical IMU on an
indexer of a still base: 1.8e-4 m/s for 1e-5, innovations of .4 of their size, twice the log-likelihood 159 less, and a scale factor
of 28 % that explained it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.motion_fit import search, with_guess
from truenorth.alignment.motion_likelihood import Series, Walks
from truenorth.alignment.swing_fit import fit_swing, long_enough
from truenorth.errors.staying import PHI, QUIETEST_BASE
from truenorth.errors.sway import MOST_OSCILLATORS, AxisMotion, with_motion
from truenorth.estimate.batch import Filtered, in_sigmas
from truenorth.filters import LinearSystem, kalman
from truenorth.state.limits import may_be_chance

Array = NDArray[np.float64]

STALE = 1.0  # sigmas: an attitude that is off by more leaves its own error in what the motion is fitted to
LOUD = 2.0  # sigmas of a chi-square: innovations that are smaller by more have a motion that is too large
MOST_FITS = 12  # of passes with a stale motion


class _Fits:
    """Motions fitted to velocities along E, N, U; a velocity that was searched or fitted is not again."""

    def __init__(self, interval: float, walks: Walks, *, slow_is_motion: bool = False) -> None:
        self.interval, self.walks, self.slow_is_motion = interval, walks, slow_is_motion
        self.searched: dict[tuple[int, bytes], tuple[Series, AxisMotion]] = {}
        self.found: dict[tuple[int, bytes, AxisMotion | None], AxisMotion] = {}

    def __call__(self, residual: Array, guesses: Sequence[AxisMotion] | None = None) -> tuple[AxisMotion, ...]:
        """To a residual (K, 3), from nothing and from guesses; no quieter than bedrock."""
        return _no_quieter(
            self._along(axis, residual[:, axis], None if guesses is None else guesses[axis]) for axis in range(3)
        )

    def _along(self, axis: int, velocity: Array, guess: AxisMotion | None) -> AxisMotion:
        seen = axis, velocity.tobytes()
        if seen not in self.searched:
            series = Series(velocity, self.interval, self.walks, slow_is_motion=self.slow_is_motion)
            self.searched[seen] = series, search(series, MOST_OSCILLATORS[axis])
        if (*seen, guess) not in self.found:
            self.found[*seen, guess] = with_guess(*self.searched[seen], guess)
        return self.found[*seen, guess]


class MotionFilter:
    """A Kalman filter whose states hold the base's motion, as fitted to a residual; fitted anew about the first answers.

    Parameters
    ----------
    residual : (K, 3) array, m/s
    interval : float, s
    walks : Walks
    fits : int
        Anew, after the first pass.
    poor : bool
        Of poor sensors on an indexer: errors of second order are slow then, and no walks. What they leave passes for motion.

    Attributes
    ----------
    motion : three AxisMotion
    stale : bool
        Whether the motion explains an error of the attitude that it was fitted about: it is fitted anew in the next pass.
    """

    stale = False
    likely = -math.inf  # twice the log-likelihood of the last pass
    turns = slice(0, 0)  # states of the arm of a base that swings on lines

    def __init__(self, residual: Array, interval: float, walks: Walks, fits: int = 1, *, poor: bool = False) -> None:
        self.interval, self.walks, self.fits, self.passes = interval, walks, fits, 0
        self.fit = _Fits(interval, walks, slow_is_motion=poor)
        self.motion = self.fit(residual)

    def __call__(self, system: LinearSystem) -> Filtered:
        """A pass: the system of what a nominal solution leaves, filtered with the motion."""
        self.passes, self.base = self.passes + 1, system
        # About a good attitude: what was in the first residual besides the motion is gone.
        if 1 < self.passes <= 1 + self.fits or self.stale:
            self.motion = self.fit(system.z, self.motion)
        found = self.filtered()
        self.stale = self.passes <= MOST_FITS and self._explains_attitude(found)
        return found

    def moved(self, found: Filtered) -> float:
        """How far off the nominal solution was: attitude in sigmas; a motion that is stale is no end."""
        return max(in_sigmas(PHI)(found), STALE if self.stale else 0.0)

    def _explains_attitude(self, found: Filtered) -> bool:
        """Whether the motion was fitted to an error of attitude, too.

        By the way that attitude moves; and since a motion that is too large makes that look small, by innovations that are smaller
        than it says, as long as a fit makes the log likelier by more than chance. Of a motion that fits they have their size.
        """
        before, self.likely = self.likely, 2.0 * float(found.estimates.log_likelihood)
        if in_sigmas(PHI)(found) > STALE:
            return True
        rows = float(found.estimates.nis_rows.sum())
        loud = float(found.estimates.nis.sum()) < rows - LOUD * math.sqrt(2.0 * rows)
        return loud and not may_be_chance(self.likely - before)

    def filtered(self) -> Filtered:
        """With the motion as fitted."""
        full = self.full()
        return Filtered(full, kalman(full, history="full"))

    def full(self) -> LinearSystem:
        """The last system, with the motion as fitted."""
        return with_motion(self.base, self.interval, self.motion)

    def likeliest(self, motion: Sequence[AxisMotion]) -> float:
        """Twice the log-likelihood of the last system with another log's motion, or with what a fit makes of that: the larger."""
        tried = motion, self.fit(self.base.z, motion)
        return max(self._likelihood(m) for m in tried)

    def on_lines(self) -> float:
        """Twice the log-likelihood of the last system of a base that swings on lines as well; -inf of too short a log."""
        if not long_enough(self.interval * len(self.base.z)):
            return -math.inf
        turns = self.base.H[:, :, self.turns]
        return self._likelihood(_no_quieter(fit_swing(self.base, self.interval, self.walks, self.motion, turns)))

    def _likelihood(self, motion: Sequence[AxisMotion]) -> float:
        return 2.0 * float(kalman(with_motion(self.base, self.interval, motion)).log_likelihood)

    def without(self, seen: Array) -> tuple[float, Array]:
        """With so much (K, 3) off the measurements, the motion fitted anew: -2 log-likelihood, and phi (3,) at the end."""
        left = self.base.with_arrays(z=self.base.z - seen)
        motion = self.fit(left.z, self.motion)
        estimates = kalman(with_motion(left, self.interval, motion, spare=False))
        return -2.0 * float(estimates.log_likelihood), np.asarray(estimates.x[-1][PHI])


class SwingFilter(MotionFilter):
    """The same of a base that swings on lines, about an attitude that is good already: fitted once."""

    def __init__(self, plain: MotionFilter, turns: slice) -> None:
        self.interval, self.walks, self.motion, self.turns = plain.interval, plain.walks, plain.motion, turns
        self.passes, self.fit = 0, _Fits(self.interval, self.walks)

    def __call__(self, system: LinearSystem) -> Filtered:
        """A pass, the first of which fits the swing."""
        self.passes, self.base = self.passes + 1, system
        if self.passes == 1:
            self.motion = _no_quieter(
                fit_swing(system, self.interval, self.walks, self.motion, system.H[:, :, self.turns])
            )
        return self.filtered()


def _no_quieter(motion: Iterable[AxisMotion]) -> tuple[AxisMotion, ...]:
    """The same motions, no quieter than bedrock."""
    return tuple(replace(item, white=max(item.white, QUIETEST_BASE)) for item in motion)
