"""An encoder that is late or early, and what that does to the attitude of the body where the log ends in a slew.

The body is the IMU, turned back by the angles at the epoch: it is off by the delay times the rate of the axes there. A delay that
shows is taken off the stamps of the encoder (:mod:`truenorth.alignment.rotary`), and what is left of it is in sigma.
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
from truenorth.state.evidence import Effect, Evidence, Figure, note
from truenorth.state.judge import weight
from truenorth.state.limits import limit

Array = NDArray[np.float64]

NOT_LATE = Delay()
NO_RATE = 4.0  # times the encoder's noise, by which its angle changes within `SLEW` where an axis rests


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
    if taken.size:
        return taken.sigma
    return given if rest is None else min(given, math.hypot(rest.size, rest.sigma))


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
    figures: dict[str, Figure] = {"late": taken.size + late.size, "sigma": late.sigma}
    found = [Evidence("encoder.late", figures, "bounded" if sure else "hint", off, ("encoder",))]
    return found, Delay(taken.size + late.size, late.sigma, late.beyond) if sure else None
