"""Rows that alternate: two sensors, or two converters of one, in turn.

What keeps its phase at half the rate of rows over a whole log is no motion: a vibration there is off by some hundredths of a
hertz, and turns over in the log. The alternating part of each channel is looked at in stretches, with motion taken off by fourth
differences (gain one at half the rate, ``sin^4`` below). Of forces of which one in two is turned, it is half of what the turn makes
of gravity, and so much is the mean of both turned against either sensor.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure

Array = NDArray[np.float64]

STRETCHES = 32  # of the log
SHORTEST = 32  # rows of one
SURE = (
    8.0  # sigmas of the mean of all stretches: Student's t of 31 degrees of freedom is as large once in 10^8 channels
)
PARTS, STEADY = 8, 0.5  # parts of the log that must all agree, and how far they may scatter, of their mean
COUNTS = 1.0  # steps of a coarse counter: it alternates by half of one by itself


@remembered
def alternation(record: ImuRecord) -> Array:
    """(6,) half of what every second row of each channel has more than the others; zero where chance, a counter or motion says it."""
    length = (len(record) - 4) // STRETCHES // 2 * 2
    found = np.zeros(6)
    if length < SHORTEST:
        return found
    for channel in range(6):
        x = (record.gyro if channel < 3 else record.accel)[:, channel % 3]
        quick = (x[:-4] - 4.0 * x[1:-3] + 6.0 * x[2:-2] - 4.0 * x[3:-1] + x[4:]) / 16.0
        pairs = quick[: STRETCHES * length].reshape(STRETCHES, length // 2, 2)
        means = 0.5 * (pairs[:, :, 0] - pairs[:, :, 1]).mean(axis=1)
        size, spread = float(means.mean()), float(means.std(ddof=1))
        parts = means.reshape(PARTS, -1).mean(axis=1)
        steady = float(parts.std()) < STEADY * abs(size) and bool(np.all(parts * size > 0.0))
        if steady and abs(size) > SURE * spread / math.sqrt(STRETCHES) and abs(size) > COUNTS * _step(x):
            found[channel] = size
    return found


def alternation_evidence(record: ImuRecord) -> list[Evidence]:
    """That the rows of the accelerometers alternate, and by how much the mean of two sensors is turned against either."""
    size = np.abs(alternation(record)[3:])
    turned = float(np.linalg.norm(size)) / GRAVITY_EQUATOR / (record.interval if record.kind == "increments" else 1.0)
    if turned == 0.0:
        return []
    axis = int(np.argmax(size))
    figures: dict[str, Figure] = {
        "name": COLUMNS[record.kind][3 + axis],
        "size": 2.0 * float(size[axis]),
        "level": turned,
    }
    return [Evidence("record.alternates", figures, "known", Effect(heading=turned, level=turned), ("rows_of_one",))]


def _step(values: Array) -> float:
    """The smallest step between two values of a channel that is written in few levels; zero of one that has as many as rows."""
    levels = np.unique(values)
    return float(np.diff(levels).min()) if 1 < len(levels) < len(values) // 4 else 0.0
