"""The standard manoeuvres of alignment and calibration, as legs of a course.

A turn of ``angle`` at ``rate`` lasts ``angle/rate`` plus the time of its onset; the rate holds in between.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from truenorth.core.errors import UsageError
from truenorth.simulation.course import Leg
from truenorth.simulation.motion import Motion
from truenorth.simulation.sway import Disturbed
from truenorth.simulation.tones import Tone

Bank = Literal["flat", "coordinated"]


def straight(duration: float) -> list[Leg]:
    """Straight on, or standing still, for a time (s)."""
    return [Leg(duration)]


def turn(angle: float, rate: float, bank: Bank = "flat", onset: float = 2.0) -> list[Leg]:
    """A level turn: `angle` in rad, positive clockwise, at a `rate` in rad/s.

    Raises
    ------
    UsageError
        No angle, or a rate that is not positive.
    """
    if not (rate > 0 and angle):
        raise UsageError(
            f"turn of {math.degrees(angle):g} deg at {math.degrees(rate):g} deg/s; expected an angle (its sign is the "
            "direction, clockwise positive) and a positive rate"
        )
    steady = abs(angle) / rate
    return [Leg(steady + min(onset, steady), turn=angle, bank=bank, onset=onset)]


def s_turn(angle: float, rate: float, times: int = 1, bank: Bank = "coordinated", onset: float = 2.0) -> list[Leg]:
    """Out by `angle` (rad) to the right, twice back to the left, out again; `times` over. The track ends as it began."""
    right, left = turn(angle, rate, bank, onset), turn(-2 * angle, rate, bank, onset)
    return [*right, *left, *right] * times


def accelerate(speed: float, acceleration: float, before: float, onset: float = 2.0) -> list[Leg]:
    """From the speed `before` to `speed` (m/s) at a rate (m/s^2, positive, also for braking).

    Raises
    ------
    UsageError
        No change of speed, or an acceleration that is not positive.
    """
    change = abs(speed - before)
    if not (acceleration > 0 and change):
        raise UsageError(
            f"change of speed from {before:g} to {speed:g} m/s at {acceleration:g} m/s^2; expected another speed and a positive "
            "acceleration"
        )
    steady = change / acceleration
    return [Leg(steady + min(onset, steady), speed=speed, onset=onset)]


def climb(slope: float, duration: float, rate: float = math.radians(2.0), onset: float = 1.0) -> list[Leg]:
    """A climb (or descent) of `slope` (rad) for a time (s), nose up and down again at `rate` (rad/s).

    Raises
    ------
    UsageError
        A rate that is not positive.
    """
    if not rate > 0:
        raise UsageError(f"climb with the nose at {math.degrees(rate):g} deg/s; expected a positive rate")
    change = abs(slope) / rate + onset
    return [Leg(change, slope=slope, onset=onset), Leg(duration), Leg(change, slope=0.0, onset=onset)]


def wing_rock(
    motion: Motion, start: float, stop: float, amplitude: float, period: float, times: float = 1.0
) -> Disturbed:
    """Rolling of a given amplitude (rad) and period (s) on top of a motion, fading in and out over `times` periods."""
    return Disturbed(motion, roll_tones=(Tone(amplitude, period),), window=(start, stop, times * period))


def length(legs: Sequence[Leg]) -> float:
    """Duration of all, s."""
    return sum(leg.duration for leg in legs)
