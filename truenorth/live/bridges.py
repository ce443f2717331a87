"""Gaps in the rows of a run: how long they may be, and what the vehicle may have done in them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.estimate.gaps import LONGEST_BRIDGE
from truenorth.live.log import Log
from truenorth.records.lost_rows import BACK, GAP_FACTOR, lack_rows, pace_of
from truenorth.strapdown.increments import ImuRows, lost_between

Array = NDArray[np.float64]
Gap = tuple[float, float]  # s: the row before it, its length

UNREST = 60.0  # s before a gap, whose motion says what may have happened in it


def bridged(
    rows: Array, last: Array, coming: Array, interval: float, log: Log, *, begins: bool
) -> tuple[ImuRows, list[Aiding], list[Gap]]:
    """Rows of which those after a gap hold the whole of it, what the vehicle may have done in gaps, and the gaps.

    As :func:`truenorth.estimate.gaps.bridge_gaps` has it of a whole log: increments that are lost are velocity and angle that are
    lost, gravity's above all. A row that is stamped late is no gap: the clock comes back with the next rows.

    Parameters
    ----------
    rows : (K, 7) array
        ``time, gyro (3), accel (3)``, ascending, as they came.
    last : (7,) array
        The row before them as it came; of a run that begins its time alone counts.
    coming : (M,) array
        Times of rows that came after these, ascending.
    interval : float, s
    log : Log
        With these rows.
    begins : bool
        The run begins there: its first row is the next one after the start, and may be stamped late.

    Raises
    ------
    DataError
        A gap that is too long.
    """
    time = rows[:, 0]
    steps = np.diff(time, prepend=last[0])
    if begins:
        steps[0] = interval
    long = np.flatnonzero(steps > GAP_FACTOR * interval)
    pace = np.array([_pace(log, float(time[row] - steps[row]), interval) for row in long])
    lacks = lack_rows(np.concatenate([time, coming]), long, steps[long], pace)
    at, pace = long[lacks], pace[lacks]
    if not at.size:
        return _samples(rows, log), [], []
    missing = steps[at] - pace
    if (steps[at] - interval).max() > LONGEST_BRIDGE:  # as in :func:`unbroken`
        raise DataError(
            f"a gap of {steps[at].max():.3f} s in the rows of the IMU; expected {LONGEST_BRIDGE:g} s at most: what the "
            "vehicle did in it is not known; align again"
        )
    gaps = [(float(time[row] - steps[row]), float(steps[row])) for row in at]
    before = np.vstack([last[None], rows[:-1]])[at, 1:]
    across = rows[at, 1:] - before
    if log.source_kind == "increments":
        rows = rows.copy()
        rows[at, 1:] += lost_between(before, rows[at, 1:], steps[at] / pace - 1.0)
        across /= pace[:, None]
    unrest = np.array([_unrest(log, float(time[row]), step) for row, step in zip(at, across)])
    turn, push = missing * unrest.T
    return _samples(rows, log), [Aiding.disturbance("gap", time[at], push[:, None], turn[:, None])], gaps


def unbroken(rows: Array, last: Array, interval: float, *, begins: bool) -> Array:
    """Rows (K, 7) up to the first gap that is too long to bridge; `last` and `begins` as above."""
    too_long = np.diff(rows[:, 0], prepend=last[0]) - interval > LONGEST_BRIDGE
    if begins and len(rows):
        too_long[0] = False
    return rows[: np.argmax(too_long)] if too_long.any() else rows


def _pace(log: Log, until: float, interval: float) -> float:
    """The interval of the rows up to a time, s."""
    time = log.rows[:, 0]
    last = int(np.searchsorted(time, until, side="right"))
    return pace_of(time[max(0, last - BACK) : last], interval, log.merged)


def _samples(rows: Array, log: Log) -> ImuRows:
    """Rows for the loop."""
    return ImuRows(rows[:, 0], rows[:, 1:4], rows[:, 4:], log.source_kind, "live")


def _unrest(log: Log, until: float, across: Array) -> tuple[float, float]:
    """How much turn rate and specific force differ from their even course in a gap that ends then, of the worst axis.

    As much as in the last minute of rows; and as a step between the rows next to the gap (6,), which may have come at any time in
    it: its integral is off by ``step / sqrt(12)`` of the gap. A vehicle that stood for a minute may drive off in a gap.
    """
    part = log.record(until - UNREST, until, before=log.earlier)
    values = np.hstack([part.gyro, part.accel])
    steps = np.diff(part.time)
    whole = steps <= GAP_FACTOR * part.interval if len(part) > 1 else np.empty(0, dtype=bool)
    if part.kind == "increments":  # also of rates that are added up
        values = values[1:][whole] / steps[whole, None]
    spread = np.sqrt(np.var(values, axis=0) + across**2 / 12.0) if len(values) else np.abs(across)
    return float(spread[:3].max()), float(spread[3:].max())
