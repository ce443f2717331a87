"""Gaps in the rows of a run: how long they may be, and what the vehicle may have done in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.estimate.gaps import LONGEST_BRIDGE
from truenorth.live.log import Log
from truenorth.records.base import GAP_FACTOR
from truenorth.strapdown.increments import ImuRows

Array = NDArray[np.float64]
Gap = tuple[float, float]  # s: the row before it, its length

UNREST = 60.0  # s before a gap, whose motion says what may have happened in it


def bridged(
    rows: Array, last: Array, interval: float, log: Log, *, begins: bool
) -> tuple[ImuRows, list[Aiding], list[Gap]]:
    """Rows of which those after a gap hold the whole of it, what the vehicle may have done in gaps, and the gaps.

    As :func:`truenorth.estimate.gaps.bridge_gaps` has it of a whole log: increments that are lost are velocity and angle that are
    lost, gravity's above all.

    Parameters
    ----------
    rows : (K, 7) array
        ``time, gyro (3), accel (3)``, ascending, as they came.
    last : (7,) array
        The row before them as it came; of a run that begins its time alone counts.
    interval : float, s
    log : Log
        With these rows.
    begins : bool
        The run begins there, and its first row may come later.

    Raises
    ------
    DataError
        A gap that is too long.
    """
    time = rows[:, 0]
    steps = np.diff(time, prepend=last[0])
    if begins:
        steps[0] = interval
    at = np.flatnonzero(steps > GAP_FACTOR * interval)
    if not at.size:
        return _samples(rows, log), [], []
    missing = steps[at] - interval
    if missing.max() > LONGEST_BRIDGE:
        raise DataError(
            f"a gap of {steps[at].max():.3f} s in the rows of the IMU; expected {LONGEST_BRIDGE:g} s at most: what the "
            "vehicle did in it is not known; align again"
        )
    gaps = [(float(time[row] - steps[row]), float(steps[row])) for row in at]
    turn, push = np.array([_unrest(log, float(time[row])) for row in at]).T * missing
    if log.source_kind == "increments":
        before = np.vstack([last[None], rows[:-1]])[at]
        lost = (steps[at] / interval - 1.0)[:, None]
        found = rows.copy()
        found[at, 1:] += 0.5 * lost * (rows[at, 1:] + before[:, 1:])
        rows = found
    return _samples(rows, log), [Aiding.disturbance("gap", time[at], push[:, None], turn[:, None])], gaps


def _samples(rows: Array, log: Log) -> ImuRows:
    """Rows for the loop."""
    return ImuRows(rows[:, 0], rows[:, 1:4], rows[:, 4:], log.source_kind, "live")


def _unrest(log: Log, until: float) -> tuple[float, float]:
    """How much turn rate and specific force differ from their even course in a gap that ends then, of the worst axis.

    As much as in the last minute of rows; and as a step between the rows next to the gap, which may have come at any time in it:
    its integral is off by ``step / sqrt(12)`` of the gap. A vehicle that stood for a minute may drive off in a gap.
    """
    part = log.record(until - UNREST, until)
    scale = 1.0 if part.kind == "rates" else 1.0 / part.interval
    turn, push = (
        float(scale * np.sqrt(np.var(values, axis=0) + (values[-1] - values[-2]) ** 2 / 12.0).max())
        for values in (part.gyro, part.accel)
    )
    return turn, push
