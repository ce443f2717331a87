"""A turntable: positions held one after the other, with slews of finite rate in between."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.simulation.motion import Kinematics, Motion, staying
from truenorth.simulation.profile import Profile, Ramp, profile

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hold:
    """A position of the table."""

    duration: float  # s
    heading: float = 0.0  # rad; not wrapped: from 0 to 720 deg the table turns twice
    pitch: float = 0.0  # rad
    roll: float = 0.0  # rad


@dataclass(frozen=True, eq=False)
class Turntable(Motion):
    """A base that turns at a fixed place."""

    position: Position
    heading: Profile  # of time, rad
    pitch: Profile
    roll: Profile
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (3,) m: from the axes' common point to the IMU

    @property
    def breaks(self) -> Array:
        """Beginnings and ends of the slews and their onsets."""
        return np.unique(np.concatenate([x.breaks for x in (self.heading, self.pitch, self.roll)]))

    def kinematics(self, t: Array) -> Kinematics:
        """The profiles at a fixed place."""
        angles, rates, accelerations = (
            np.stack(x) for x in zip(self.heading(t), self.pitch(t), self.roll(t), strict=True)
        )
        return Kinematics(angles, rates, accelerations, *staying(self.position, t))


def turntable(
    position: Position,
    holds: Sequence[Hold],
    *,
    rate: float = math.radians(10.0),
    onset: float = 0.5,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Turntable:
    """A table that goes through positions; it stays in the last one.

    Parameters
    ----------
    position : Position
    holds : sequence of Hold
    rate : float, rad/s
        Of the axis that has farthest to go; all axes begin and end together.
    onset : float, s
        In which a slew comes to its rate, and ends.
    lever_arm : (3,) floats, m

    Raises
    ------
    UsageError
        No position, a duration below zero, or a rate or onset that is not positive.
    """
    if not holds or not (rate > 0 and onset > 0):
        raise UsageError(
            f"turntable: {len(holds)} positions, slews of {math.degrees(rate):g} deg/s with an onset of {onset:g} s; "
            "expected one position at least, a positive rate and onset"
        )
    axes = ("heading", "pitch", "roll")
    ramps: dict[str, list[Ramp]] = {axis: [] for axis in axes}
    at = 0.0
    for number, (before, hold) in enumerate(zip([holds[0], *holds], holds, strict=False), 1):
        if not hold.duration >= 0:
            raise UsageError(f"turntable: position {number} is held for {hold.duration:g} s; expected zero or more")
        changes = {axis: getattr(hold, axis) - getattr(before, axis) for axis in axes}
        farthest = max(abs(change) for change in changes.values())
        if farthest > 0:
            length = farthest / rate + onset
            for axis, change in changes.items():
                if change:
                    ramps[axis].append(Ramp(at, length, change, min(onset, 0.5 * length)))
            at += length
        at += hold.duration
    first = holds[0]
    heading, pitch, roll = (profile(getattr(first, axis), ramps[axis]) for axis in axes)
    return Turntable(position, heading, pitch, roll, lever_arm)


def positions(headings: Sequence[float], duration: float, pitch: float = 0.0, roll: float = 0.0) -> list[Hold]:
    """Positions about the vertical, each held equally long: ``(0, pi)`` is the two-position alignment."""
    return [Hold(duration, heading, pitch, roll) for heading in headings]
