"""Steps of stamps that are not the sampling's: of a computer that read several rows at once, of few digits, over lost rows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

JUMP = 5.0  # times the longest usual step, from which a step is no wait for the next bunch
CHANGES = 0.02  # by which such steps change how many rows a second come in all
WHOLE = 0.15  # of the pace, within which steps over lost rows are whole multiples of it
MOST_WHOLE, MOST_SINGLE = 0.95, 0.5  # shares of the steps
LONG = 10  # rows lost at once, from which that is a gap of its own
WANDERS = 1.5  # steps, by which stamps over lost rows leave those of even rows; those of a coarse clock do not


def even_but_for_digits(raw: Array, mean: float) -> bool:
    """Whether stamps repeat for want of digits: there are no finer ones about them than half an interval, and the pace is one."""
    spans = raw[10:] - raw[:-10]
    if float(np.mean(np.abs(spans - 10.0 * mean) <= 1.01 * mean)) < 0.95:
        return False
    digits = max(0, math.floor(-math.log10(0.5 * mean)))  # of stamps that are as coarse as that
    about = (raw[max(k - 10, 0) : k + 11] for k in np.flatnonzero(np.diff(raw) == 0.0))
    coarse = [np.all(np.abs(stamps - np.round(stamps, digits)) < 1e-9 + 1e-6 * mean) for stamps in about]
    return float(np.mean(coarse)) > 0.9  # digits may become fewer just there


def rows_are_lost(raw: Array) -> bool:
    """Whether uneven steps are those over rows that a logger lost: most are of one pace, the others whole multiples of it.

    Bunches have steps of zero, or waits that are all alike; of losses two steps in one are the most common. The stamps of a clock
    whose ticks are longer than the rows' interval are whole multiples, too, and stay near even ones.
    """
    steps = np.diff(raw)
    pace = float(np.quantile(steps, 0.25))
    if not pace > 0.0 or steps.min() < (1.0 - WHOLE) * pace:
        return False
    multiples = np.round(steps / pace)
    near = np.abs(steps / pace - multiples) < WHOLE
    few = multiples < LONG
    single, double = float(np.mean(multiples == 1.0)), float(np.mean(multiples == 2.0))
    if np.mean(near[few]) < MOST_WHOLE or single < MOST_SINGLE or double < 0.5 * np.mean(few & (multiples > 1.0)):
        return False
    inside = np.concatenate([[0.0], np.cumsum(np.where(few, steps, pace))])
    away = inside - np.linspace(0.0, inside[-1], len(inside))
    return float(np.ptp(away)) > WANDERS * pace


def jump_of(raw: Array) -> tuple[int, float] | None:
    """The row before the largest jump of stamps, and the mean step without jumps; None where they leave the mean as it is."""
    steps = np.diff(raw)
    usual = max(float(np.quantile(steps, 0.99)), float(np.median(steps)))
    jumps = steps > JUMP * usual
    if not usual > 0.0 or not jumps.any():
        return None
    rest = float(np.mean(steps[~jumps]))
    return (int(np.argmax(steps)), rest) if rest > 0.0 and np.mean(steps) / rest - 1.0 > CHANGES else None
