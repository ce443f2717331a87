"""Gaps in the rows of a run: how long they may be, and what the vehicle may have done in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.estimate.gaps import LONGEST_BRIDGE
from truenorth.live.log import Log
from truenorth.records.base import GAP_FACTOR

Array = NDArray[np.float64]
Gap = tuple[float, float]  # s: the row before it, its length

UNREST = 60.0  # s before a gap, whose motion says what may have happened in it


def bridges(time: Array, before: float, interval: float, log: Log, *, begins: bool) -> tuple[list[Aiding], list[Gap]]:
    """What the vehicle may have done in gaps among rows, and the gaps.

    Parameters
    ----------
    time : (K,) array, s
        Of the rows.
    before : float, s
        The row before them, or where the run begins.
    interval : float, s
    log : Log
    begins : bool
        The run begins there, and its first row may come later.

    Raises
    ------
    DataError
        A gap that is too long.
    """
    steps = np.diff(time, prepend=before)
    rows = np.flatnonzero(steps > GAP_FACTOR * interval)
    if not rows.size or (begins and rows.tolist() == [0]):
        return [], []
    missing = steps[rows] - interval
    if missing.max() > LONGEST_BRIDGE:
        raise DataError(
            f"a gap of {steps[rows].max():.3f} s in the rows of the IMU; expected {LONGEST_BRIDGE:g} s at most: what the "
            "vehicle did in it is not known; align again"
        )
    gaps = [(float(time[row] - steps[row]), float(steps[row])) for row in rows]
    last = log.record(log.end - UNREST)
    scale = 1.0 if last.kind == "rates" else 1.0 / last.interval
    turn, push = (missing[:, None] * float(np.std(values * scale, axis=0).max()) for values in (last.gyro, last.accel))
    return [Aiding.disturbance("gap", time[rows], push, turn)], gaps
