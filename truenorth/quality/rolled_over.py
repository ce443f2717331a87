"""Gravity at the end of a counter: counts that may have rolled over.

A counter of b bits holds ``-2^(b-1) .. 2^(b-1) - 1``. What is beyond goes on at the other end: gravity of N counts, a little more
than the half range, is written as ``N - 2^b``. An IMU at rest of which nothing is said then lies upside down with another bias of
its accelerometers, and no other row says so. But the counts do: |N - 2^b| is the half range, less what N was beyond it. An
accelerometer of that range could hold gravity and its bias only just, and is hardly made. Where another row of the sensor is beyond
the half range the counter is no such one. Nor is a log of a text: its steps are powers of ten, in SI or in g.

Source: the arithmetic of two's complement; by how much the force may miss gravity is a limit of the unit's check.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.quality.clipped import largest
from truenorth.quality.quantum import largest_step, lattice_step
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import limit

Array = NDArray[np.float64]

# The common words: a sound counter of any length may have gravity that near to a half range, each by a chance of one in six, and
# each further length is another such warning of a sound log.
BITS = (16, 24)
TEXT = 1e-6  # of a step, by which it may miss a power of ten: digits of a text, no counter
STANDARD_GRAVITY = 9.80665  # m/s^2
WHOLE = 1e-3  # of a count, by which values may miss multiples of the step


def _step_of(sensor: Array) -> float:
    """The step of the channels of a sensor; zero where they have none."""
    return min((step for step in (lattice_step(x) for x in sensor.T) if step > 0.0), default=0.0)


def counts_of(x: Array, step: float) -> Array | None:
    """Counts (N,) of a channel, counted from nothing; None where its values are no multiples of the step."""
    off = x / step
    whole = np.round(off)
    off -= whole
    sound = (np.all(np.abs(off[k]) < WHOLE * np.maximum(np.abs(whole[k]) * 1e-6, 1.0)) for k in row_blocks(len(x)))
    return whole if all(sound) else None


def _is_text(step: float) -> bool:
    """Whether a step is a digit of a text: a power of ten, in SI or in g."""
    digits = (math.log10(step / unit) for unit in (1.0, STANDARD_GRAVITY))
    return any(abs(x - round(x)) < TEXT * math.log10(math.e) for x in digits)


def rolled_over_evidence(record: ImuRecord) -> list[Evidence]:
    """That gravity stands at the end of a counter of the accelerometers."""
    unit = 1.0 / record.interval if record.kind == "increments" else 1.0
    channels = record.accel.T  # one after the other: of a long log all three at once are much memory
    force = [float(np.median(x)) for x in channels]
    channel = int(np.argmax(np.abs(force)))
    if abs(unit * force[channel]) < (1.0 - limit("gravity")) * GRAVITY_EQUATOR:
        return []
    if largest(channels) > 2.0 ** max(BITS) * max(largest_step(x) for x in channels):
        return []  # steps so small are of no such counter
    step = _step_of(record.accel)
    if step == 0.0:
        return []
    most, middle = 0.0, 0.0
    for k, x in enumerate(channels):
        if (counts := counts_of(x, step)) is None:
            return []
        most = max(most, largest([counts]))
        middle = abs(float(np.median(counts))) if k == channel else middle
    if _is_text(largest(channels) / most):
        return []
    for half in (2.0 ** (bits - 1) for bits in BITS):
        if most <= half and middle > (1.0 - limit("gravity")) * half:
            name = COLUMNS[record.kind][3 + channel]
            return [note("record.rolls_over", urgent=True, name=name, count=middle, range=half)]
    return []
