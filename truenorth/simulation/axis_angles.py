"""How an axis of an indexer turns: at a constant rate, to and fro, or from position to position."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.simulation.profile import Profile, Ramp, profile
from truenorth.simulation.tones import Tone, Triple, cosines

Array = NDArray[np.float64]
TURN = math.pi

# Steps of 180 deg: each position of the eight is reached from both sides; in the sixteen also by turns of both signs, so
# that constant errors of sensors average out of the slews as well as of the positions.
EIGHT = ((0, 1), (1, 1), (0, 1), (1, 1), (1, -1), (0, -1), (1, -1), (0, -1))
SCHEMES: Mapping[str, tuple[float, tuple[tuple[int, float], ...]]] = {
    "4": (-0.75 * math.pi, ((0, math.pi), (0, 0.5 * math.pi), (0, -math.pi), (0, -0.5 * math.pi))),
    "8": (0.0, tuple((axis, sign * TURN) for axis, sign in EIGHT)),
    "16": (0.0, tuple((axis, sign * TURN) for s in (1, -1) for axis, sign in ((a, s * x) for a, x in EIGHT))),
}


class Turning(Protocol):
    """The angle of an axis over time."""

    def __call__(self, t: Array) -> Triple:
        """Angle and its two derivatives at times `t` (s), rad."""

    @property
    def breaks(self) -> Array:
        """Times where a higher derivative jumps, s."""

    @property
    def peak_rate(self) -> float:
        """Largest rate, rad/s."""


@dataclass(frozen=True)
class Spin:
    """Constant rate for ever.

    Attributes
    ----------
    rate : float, rad/s
    start : float, rad
        Angle at time 0.
    """

    rate: float
    start: float = 0.0
    breaks: Array = field(default_factory=lambda: np.empty(0), init=False, repr=False, compare=False)

    def __call__(self, t: Array) -> Triple:
        """Angle and its two derivatives."""
        return self.start + self.rate * t, np.full_like(t, self.rate), np.zeros_like(t)

    @property
    def peak_rate(self) -> float:
        """The rate itself."""
        return abs(self.rate)


@dataclass(frozen=True)
class Swing:
    """To and fro about a mean angle, as a sinusoid."""

    tone: Tone  # amplitude in rad
    mean: float = 0.0  # rad
    breaks: Array = field(default_factory=lambda: np.empty(0), init=False, repr=False, compare=False)

    def __call__(self, t: Array) -> Triple:
        """Angle and its two derivatives."""
        return cosines((self.tone,), t, self.mean)

    @property
    def peak_rate(self) -> float:
        """In the middle; at least one turn in a period, which quadrature has to follow."""
        return 2 * math.pi / self.tone.period * max(1.0, abs(self.tone.amplitude))


@dataclass(frozen=True, eq=False)
class Steps:
    """From position to position, with slews of finite rate; it stays in the last one.

    Attributes
    ----------
    angle : Profile
        Of time, rad.
    """

    angle: Profile

    def __call__(self, t: Array) -> Triple:
        """Angle and its two derivatives."""
        return self.angle(t)

    @property
    def breaks(self) -> Array:
        """Beginnings and ends of the slews and their onsets."""
        return self.angle.breaks

    @cached_property
    def peak_rate(self) -> float:
        """Of the fastest slew; its rate is steady between two onsets."""
        middle = 0.5 * (self.breaks[1:] + self.breaks[:-1])
        return float(np.max(np.abs(self.angle(np.concatenate([self.breaks, middle]))[1])))


def steps(
    turns: Sequence[tuple[int, float]],
    *,
    dwell: float,
    duration: float,
    rate: float = math.radians(10.0),
    onset: float = 0.5,
    start: Sequence[float] = (0.0, 0.0),
) -> tuple[Steps, ...]:
    """Axes that turn one after the other, over and over again.

    Parameters
    ----------
    turns : sequence of (axis, angle)
        Number of the axis (0 the outermost) and by how much it turns (rad); all of them make one cycle.
    dwell : float, s
        In each position, the first one included.
    duration : float, s
        Cycles begin until then.
    rate : float, rad/s
        Of the slews.
    onset : float, s
        In which a slew comes to its rate, and ends.
    start : sequence of float, rad
        Angle of each axis to begin with.

    Returns
    -------
    tuple of Steps
        One an axis.

    Raises
    ------
    UsageError
        No turns, an axis that is not there, or a time or rate that is not positive.
    """
    if not (turns and dwell >= 0 and duration > 0 and rate > 0 and onset > 0):
        raise UsageError(
            f"{len(turns)} turns, dwell {dwell:g} s, duration {duration:g} s, rate {math.degrees(rate):g} deg/s, onset "
            f"{onset:g} s; expected one turn at least and positive values"
        )
    for number, (axis, angle) in enumerate(turns, 1):
        if not (0 <= axis < len(start) and math.isfinite(angle) and angle != 0.0):
            raise UsageError(
                f"turn {number} is of axis {axis} by {math.degrees(angle):g} deg; expected an axis below {len(start)} and "
                "an angle that is not zero"
            )
    ramps: list[list[Ramp]] = [[] for _ in start]
    at = dwell
    while at < duration:
        for axis, angle in turns:
            length = abs(angle) / rate + onset
            ramps[axis].append(Ramp(at, length, angle, min(onset, 0.5 * length)))
            at += length + dwell
    return tuple(Steps(profile(angle, own)) for angle, own in zip(start, ramps, strict=True))


def scheme(name: str, *, dwell: float, duration: float, rate: float = math.radians(10.0)) -> tuple[Steps, ...]:
    """Angles of a rotation scheme: one axis of four positions, or two of eight or sixteen.

    Raises
    ------
    UsageError
        A name that is not known, or a time or rate that makes no sense.
    """
    if name not in SCHEMES:
        raise UsageError(f"scheme {name!r} is not known; choose one of {', '.join(SCHEMES)}")
    first, turns = SCHEMES[name]
    axes = 1 + max(axis for axis, _ in turns)
    return steps(turns, dwell=dwell, duration=duration, rate=rate, start=[first, 0.0][:axes])
