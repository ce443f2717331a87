"""Clocks that start anew: counters of 16, 24 or 32 bits, the time of a day and of a week.

``micros()`` of a microcontroller and the clock of an Xsens DOT start at zero again after 2^32 us, 71.6 min; a receiver's time of
week does on Sunday. Such a clock goes on where that is unmistakable: each step back leads from the end of the period to its
beginning, and is the usual step but for the period. A gap of whole periods cannot be seen: periods of few steps are left alone.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.records.base import first_disorder

Array = NDArray[np.float64]

BITS = (16, 24, 32)
SCALES = (1.0, 1e-3, 1e-6, 1e-9)  # of what a logger makes of the counts: ``micros() / 1e6``
OF_TIME = {"day": 86400.0, "week": 604800.0}  # s
TICKS = (1.0, 1e3, 1e6, 1e9)  # a second
FEWEST_STEPS = 16  # of a period
NEAR = 2.0  # usual steps, within which the clock stands at the end of the period before, and at its beginning after
LARGEST_ROUND = 1e-3  # of a step: digits


def periods() -> dict[float, str]:
    """After how much a clock may start anew, in whatever unit, and what it is then."""
    found = {2.0**bits * scale: f"a counter of {bits} bits" for scale in SCALES for bits in BITS}
    return found | {size * ticks: f"the time of the {name}" for name, size in OF_TIME.items() for ticks in TICKS}


def unwrapped(time: Array) -> tuple[Array, str | None]:
    """A clock that goes on where it started anew, and what it is; as it is, and None, where it did not or that is not sure.

    Parameters
    ----------
    time : (N,) array, in any unit
    """
    if len(time) < 3 or not np.all(np.isfinite(time)) or first_disorder(time) is None:
        return time, None
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if not back.size or not np.any(steps > 0.0):
        return time, None
    usual = float(np.median(steps[steps > 0.0]))
    end, start = float(np.min(time[back])), float(np.max(time[back + 1]))
    for period, what in periods().items():
        near = NEAR * usual
        if not (period >= FEWEST_STEPS * usual and start <= near and end >= period - near and time.max() <= period):
            continue
        over = steps[back] + period
        if time.min() < 0.0 or not np.all((over > 0.0) & (over <= near)):
            continue
        turns = np.concatenate([[0.0], np.cumsum(steps < 0.0)])
        times = "once" if back.size == 1 else f"{back.size} times"
        return np.asarray(time + period * turns), f"{what}, which starts anew {times}"
    return time, None
