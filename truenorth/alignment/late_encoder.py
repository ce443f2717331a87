"""An encoder that is late or early, and what that does to the attitude of the body where the log ends in a slew.

The body is the IMU, turned back by the angles at the epoch: it is off by the delay times the rate of the axes there. A delay that
shows is taken off the stamps of the encoder (:mod:`truenorth.alignment.rotary`), and what is left of it is in sigma.

What it does is linear in a delay that is short against a start of a slew, some tenths of a second. A longer one is found first, as
that by which the gyros' own turns about the axes go best with the angles; of -.5 s the linear one found .1 s, 52 sigmas of level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.encoder_angles import CarriedAngles
from truenorth.alignment.encoder_turns import SLEW, rates_at
from truenorth.core.indexing import DIRECTIONS, chained
from truenorth.quality.encoder_delay import Delay
from truenorth.quality.encoder_steps import ROUNDED
from truenorth.state.evidence import Effect, Evidence, Figure, note
from truenorth.state.judge import weight
from truenorth.state.limits import limit

Array = NDArray[np.float64]

NOT_LATE = Delay()
LONGEST = 2.0  # s, of a delay that is looked for by the gyros' turns
TRIED = 0.02  # s, from delay to delay
WINDOW = 1.0  # s, over which turns are compared: the body's own are slower
SHORT = 0.05  # s: a shorter one is linear
EXPLAINED = 0.25  # of the squares, that a delay leaves at the most
SEEN = 1.3  # times what steps of the resolution leave
NO_RATE = 4.0  # times the encoder's noise, by which its angle changes within `SLEW` where an axis rests


def coarse_delay(carried: CarriedAngles) -> Delay:
    """By which an encoder is late, to some hundredths of a second, where the gyros' turns say that it is by more; else none."""
    span = carried.time[-1] - carried.time[0] if len(carried.time) else 0.0
    if span < 4.0 * LONGEST:
        return NOT_LATE
    fine = np.arange(carried.time[0], carried.time[-1], TRIED)
    turns = np.stack([np.interp(fine, carried.time, column) for column in carried.by_gyros.T])
    angles = turns + np.stack([np.interp(fine, carried.time, column) for column in carried.turned.T])
    most, lag = round(LONGEST / TRIED), round(WINDOW / TRIED)
    inside = slice(most, len(fine) - most)
    left = []
    for shift in range(-most, most + 1):  # what is late shows an earlier turn
        off = angles[:, inside] - turns[:, most - shift : len(fine) - most - shift]
        moved = off[:, lag:] - off[:, :-lag]
        left.append(float(np.sum((moved - np.median(moved, axis=1, keepdims=True)) ** 2)))
    best = int(np.argmin(left))
    size = TRIED * (best - most)
    # What steps of its resolution leave, whatever the delay.
    steps = 2.0 * (len(fine) - 2 * most - lag) * float(np.sum((ROUNDED * carried.steps) ** 2))
    if abs(size) <= SHORT or left[most] < SEEN * steps or left[best] - steps > EXPLAINED * (left[most] - steps):
        return NOT_LATE
    return Delay(size, TRIED)


def late_effect(carried: CarriedAngles, axes: Sequence[str], time: float, C_nb: Array) -> Effect:
    """What a delay turns the body by at a time (s), by the second.

    Parameters
    ----------
    carried : CarriedAngles
    axes : sequence of {"x", "y", "z"}
        The outermost first.
    time : float, s
    C_nb : (3, 3) array
        Attitude of the body there.
    """
    edges = carried.record.time
    angles = np.unwrap(carried.record.angles.reshape(len(edges), -1), axis=0)
    at = np.array([np.interp(time, edges, column) for column in angles.T])
    directions = [np.array(DIRECTIONS[axis]) for axis in axes]
    rates = rates_at(edges, angles, np.array([time]))[0]
    rates = np.where(np.abs(rates) > NO_RATE * carried.noise / SLEW, rates, 0.0)
    turn = sum((rate * chained(directions[:i], at[:i]) @ directions[i] for i, rate in enumerate(rates)), np.zeros(3))
    turn = C_nb @ turn
    return Effect(heading=abs(float(turn[2])), level=math.hypot(float(turn[0]), float(turn[1])))


def left_of(taken: Delay, rest: Delay | None, given: float) -> float:
    """One sigma of the delay that is left, s, where `given` was said of it: no more than what shows of it, if it does."""
    said = taken.sigma if taken.size else given
    return said if rest is None else min(said, math.hypot(rest.size, rest.sigma))


def late_evidence(
    late: Delay | None, effect: Effect, sigma: Effect, taken: Delay
) -> tuple[list[Evidence], Delay | None]:
    """What a delay that shows makes of the answer, and the one to take off instead, if any.

    Parameters
    ----------
    late : Delay or None
        What is left of it.
    effect : Effect
        Of a second of it.
    sigma : Effect
        Of the answer.
    taken : Delay
        What has been taken off.
    """
    found = [note("encoder.late_taken", late=taken.size, sigma=taken.sigma)] if taken.size else []
    if late is None or late.beyond < limit("hint of an encoder's error"):
        return found, None
    off = effect.times(abs(late.size))
    if weight(off, sigma) <= limit("negligible"):
        return found, None
    sure = late.beyond > limit("indexer")
    whole = Delay(taken.size + late.size, late.sigma, late.beyond)
    # Of a delay of which a part is taken off, what is left turns the body.
    figures: dict[str, Figure] = {"late": late.size, "sigma": late.sigma}
    found.append(Evidence("encoder.late", figures, "bounded" if sure else "hint", off, ("encoder",)))
    return found, whole if sure else None
