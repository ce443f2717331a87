"""Passes over a log whose heading goes round a circle: each to the heading that is likeliest on it, all else by what that shows.

Near the headings at which a log hardly shows heading (:mod:`truenorth.alignment.heading_course`) the passes of a filter that is
linear about its own go to and fro: of 17 of 40 tactical IMUs that spin about an axis within a degree of east by 10 deg a pass, with
sigmas of 3 to 27 deg by turns, and the logs were refused as those of bases that do not stay. About any heading the course of the
likelihood is the same. So a pass goes to its likeliest, and takes of the other states what they are if that is the heading. Then
all of these came to rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.heading_course import HEADING, along_north, course_of
from truenorth.errors.staying import PHI
from truenorth.estimate.batch import Filtered, Settled, in_sigmas, settle
from truenorth.estimate.staying import StayingLog
from truenorth.filters import LinearSystem
from truenorth.filters.gains import filter_gains

Array = NDArray[np.float64]

PASSES = 8


@dataclass(frozen=True)
class _OnCircle(Filtered):
    """A pass that goes to the likeliest heading."""

    there: Array  # (n,)

    @property
    def end(self) -> Array:
        """(n,) errors to take off."""
        return self.there


def settled_on_circle(log: StayingLog, estimate: Callable[[LinearSystem], Filtered]) -> Settled[Filtered]:
    """The last pass over a log, which is left as that was linearised about it; `moved` is of the attitude, in sigmas."""
    north = along_north(log.integrals.time, log.position)

    def passed(system: LinearSystem) -> Filtered:
        found = estimate(system)
        return _OnCircle(found.system, found.estimates, _at_likeliest(found, north))

    last = settle(log, passed, in_sigmas(PHI), most=PASSES)
    return Settled(Filtered(last.found.system, last.found.estimates), last.passes, last.moved)


def _at_likeliest(found: Filtered, north: Array) -> Array:
    """(n,) the last state if the heading is the likeliest on the circle."""
    course, left = course_of(found, filter_gains(found.system, found.estimates), north)
    off = course.likeliest()
    across, along = course.mean
    p = course.P[1, 1]
    shared = np.stack([found.P[:, HEADING] + left * p * left[HEADING], -left * p])
    aside = np.linalg.solve(course.P, [math.sin(off) - across, math.cos(off) - 1.0 - along])
    end = found.end - left * along + aside @ shared
    end[HEADING] = off  # an angle, not its sine
    return np.asarray(end)
