"""Gaps in an IMU's log: which may be bridged, and what a bridge costs."""

from __future__ import annotations

import numpy as np

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import across_gaps

LONGEST_BRIDGE = 1.0  # s: of a gap that the rates around it may bridge


def bridge_gaps(record: ImuRecord) -> tuple[ImuRecord, tuple[tuple[float, float], ...], list[Aiding]]:
    """Gaps bridged by rates that change evenly, and what they add to the uncertainty.

    What the base did in a gap is as different from that as its rates differ over the log.
    """
    record.check_rate()
    rows = record.gaps[record.gaps > 0]
    if rows.size == 0:
        return record, (), []
    lengths = record.steps[rows]
    missing = lengths - record.interval
    if missing.max() > LONGEST_BRIDGE:
        worst = int(np.argmax(missing))
        raise DataError(
            f"{record.source}: row {rows[worst] + 1}, column time: a gap of {lengths[worst]:.3f} s after "
            f"{record.time[rows[worst] - 1]:.3f} s; expected gaps of {LONGEST_BRIDGE:g} s at most: what the vehicle did in it is "
            "not known; navigate the parts, each from an alignment of its own"
        )
    scale = 1.0 if record.kind == "rates" else 1.0 / record.interval
    unrest = [np.std(values * scale, axis=0).max() for values in (record.gyro, record.accel)]
    gaps = tuple((float(record.time[row - 1]), float(length)) for row, length in zip(rows, lengths))
    turn, push = (missing[:, None] * rate for rate in unrest)
    return across_gaps(record), gaps, [Aiding.disturbance("gap", record.time[rows], push, turn)]
