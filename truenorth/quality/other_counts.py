"""Rows in turn whose counts are not those of the rows between them: two counters, or one and what was worked out of it.

All rows of one counter are multiples of one step, from one value on. Of two counters in turn each has its own step and its own
zero, and what a calibration makes of them: where all rows of one are multiples of a step, those of the other miss them. Noise,
motion and rounding leave that as it is, so that a log shows it however coarse its steps are; by how much the two are turned against
each other their means say.

Rows that somebody has put between the rows of a log miss its steps as well. Their means are the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import levels_of
from truenorth.quality.quantum import lattice_step
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

LEVELS = 0.05  # of the rows, in which a counter has as many values at the most
FEWEST = 3  # values that show a step twice
FILLED = 0.3  # of all places between the least and the largest value: a counter leaves out few
OFF = 0.01  # of a step, by which a value misses it: more than digits that were left out
MOST = 0.5  # of the rows, that miss the steps of the others


def counts_in_turn(record: ImuRecord, period: int) -> bool:
    """Whether of the accelerometers' rows in turn, so many, some have the steps of a counter that most of the others miss."""
    return any(_in_turn(x, period) for x in record.accel.T)


def _in_turn(values: Array, period: int) -> bool:
    turns = [values[k::period] for k in range(period)]
    for k, own in enumerate(turns):
        if has_many_levels(own, LEVELS):
            continue
        levels, _ = levels_of(own)
        if not FEWEST <= len(levels) <= LEVELS * len(own):
            continue
        step = lattice_step(own)
        if step == 0.0 or len(levels) < FILLED * (np.ptp(levels) / step + 1.0):
            continue
        others = (turns[j] for j in range(period) if j != k)
        if any(np.mean(np.abs(_beyond((x - levels[0]) / step)) > OFF) > MOST for x in others):
            return True
    return False


def has_many_levels(values: Array, share: float) -> bool:
    """Whether the first rows of a channel (N,) show that it has more levels than this share of its rows: those of most do."""
    some = np.sort(values[: int(share * len(values)) + 1])
    return len(some) > 0 and bool(np.all(some[1:] > some[:-1]))


def _beyond(counts: Array) -> Array:
    """By how much values miss whole numbers."""
    return np.asarray(counts - np.round(counts))
