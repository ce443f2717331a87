"""Is the base leaving? A generalised likelihood ratio test of the innovations against drift signatures.

A base that begins to drift away looks to the filter like tilt or a wrong heading, and the mean NIS does not see it.
A bank of signatures (a step of velocity, a velocity that grows; east or north; from each sixteenth of the log on) is sent
through the filter, and its innovations are matched with the real ones. A constant velocity from the very beginning cannot
be seen by anyone: north velocity v equals a heading error of v/(R w_ie cos L).

What a signature of the size found does to attitude follows from the same recursion (:mod:`truenorth.alignment.matched`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Match, Signatures
from truenorth.errors.staying import PHI
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

# Of fewer, a departure lies between two: one at .59 of a log matched with a ratio of 14 at quarters of it, of 22 close by.
ONSETS = tuple(k / 16 for k in range(1, 16))
KINDS, AXES = ("step", "ramp"), ("east", "north")


@dataclass(frozen=True)
class Drift:
    """The best matching drift."""

    # twice the logarithm of the likelihood ratio; chi-square with one degree of freedom where there is no drift
    ratio: float
    kind: str  # ``step`` or ``ramp`` of velocity; ``east`` or ``north``
    axis: str
    onset: float  # s; since the beginning of the log
    velocity: float  # m/s; at the end of the log
    # rad; errors that the drift leaves in the answer: the largest of all signatures that match beyond chance
    heading: float
    level: float  # rad

    @property
    def found(self) -> bool:
        """Whether it is likelier than chance."""
        return self.ratio > limit("hint")

    @property
    def sure(self) -> bool:
        """Whether chance is ruled out."""
        return not may_be_chance(self.ratio)

    def evidence(self) -> Evidence:
        """The drift, with its effect: another course of the same size does about as much."""
        figures: dict[str, Figure] = {
            "axis": self.axis,
            "onset": self.onset,
            "velocity": abs(self.velocity),
            "ratio": self.ratio,
            "chance": limit("hint"),
            "heading": self.heading,
            "level": self.level,
        }
        kind: Kind = "bounded" if self.sure else "hint"
        return Evidence(f"drift.{self.kind}", figures, kind, Effect(self.heading, self.level), remedies=("still_part",))


def detect_drift(fine: FineAlignment, match: Match) -> Drift:
    """The best of the drift signatures, of how they match."""
    courses = list(product(ONSETS, KINDS, AXES))
    ratio, size, left = match
    best = int(np.argmax(ratio))
    onset, kind, axis_name = courses[best]
    start = onset * fine.integrals.time[-1]
    turned = np.where(ratio > limit("hint"), np.abs(left[PHI] * size), 0.0)  # (3, S): E, N, U
    heading, level = turned[2].max(), np.hypot(turned[0], turned[1]).max()
    return Drift(float(ratio[best]), kind, axis_name, float(start), float(size[best]), float(heading), float(level))


def drift_signatures(fine: FineAlignment) -> Signatures:
    """Of each onset, each kind, along each axis; the courses are those of the mean velocity, or of the velocity gained."""
    return _signatures_over(fine.integrals.time.tobytes(), fine.system.states, fine.form == "velocity")


@lru_cache(maxsize=4)
def _signatures_over(times: bytes, n: int, by_velocity: bool) -> Signatures:
    """The same for so many states over intervals between times (of doubles): those of all logs as long. Nobody writes to them."""
    t = np.frombuffer(times)
    at = (t[1:] + t[:-1]) / 2 if by_velocity else t[1:]
    onsets, kinds, axes = (np.array(x) for x in zip(*product(ONSETS, (0, 1), (0, 1)), strict=True))
    start = onsets * t[-1]
    steps, span = kinds == 0, t[-1] - start
    epoch = np.minimum(np.searchsorted(at, start, side="right"), len(at) - 1)
    since = np.maximum(at[epoch] - start, 0.0)
    measured, after = np.zeros((3, len(start))), np.zeros((4, len(start)))
    each = np.arange(len(start))
    measured[axes, each] = np.where(steps, since > 0.0, since / span)
    course = np.zeros((len(at), 3, 4))
    for axis in (0, 1):
        # Of the mean velocity 1 and the time, of the velocity gained the interval.
        course[:, axis, axis] = 1.0 if by_velocity else 0.0
        course[:, axis, 2 + axis] = at if by_velocity else np.diff(t)
    after[2 + axes, each] = np.where(steps, 0.0, 1.0 / span)
    if by_velocity:
        after[axes, each] = np.where(steps, 1.0, -start / span)
    return Signatures(epoch, np.zeros((n, len(start))), measured, after, np.zeros((n, 4)), course)
