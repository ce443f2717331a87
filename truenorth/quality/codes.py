"""Values that a converter never gives, and that stand on another one in their place: a missing code, a dead band.

The values of a sensor that moves, or has noise, fill all of a range. A converter that misses codes, or a sensor that takes small
rates for none, leaves a hole in them, and at its edge, or in its middle, one value that has the rows of the hole. Neither motion
nor noise does that: what crosses a range leaves rows in it, and a coarse quantum has holes of one step, all of one width.

Where a row of the hole was is not known. Of a hole of width h on one side of that value a row is off by ``h / sqrt(3)`` (RMS), and
in one direction as long as the motion stays the same.

Source: IEEE Std 1241-2010, *Terminology and Test Methods for Analog-to-Digital Converters*, sec. 4.9 (missing codes by histogram).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import levels_of
from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure

Array = NDArray[np.float64]

LEAST = 30.0  # rows that the hole should have: none by chance in one of 10^13 of independent rows
LEVELS = 10  # different values on either side, within the width of the hole: a hole of as many steps
SPREAD = 6  # tenths of that width in which they lie: counts that were added up lie on few places, and differ in their last digits
PART = 0.5  # of the rows that the hole should have, which must stand on the one value
BINS = 1 << 16  # by the last digits of a value; of noise each gets a row in 65536


class Pile(NamedTuple):
    """One value with the rows of a hole next to it."""

    value: float
    below: float  # width of the hole on its lower side, and on its upper one, in the channel's unit
    above: float
    rows: int


def piled_up(values: Array) -> Pile | None:
    """The value of a channel (N,) that has the rows of the largest hole; None where there is no such hole."""
    least = math.ceil(PART * LEAST)
    if _most_alike(values) < least:
        return None
    ordered = np.sort(values)
    if not np.any(ordered[least - 1 :] == ordered[: len(ordered) - least + 1]):
        return None  # no value has so many rows
    levels, counts = levels_of(ordered)
    if len(levels) < 2 * LEVELS + 1:
        return None
    before = np.append(0, np.cumsum(counts))  # rows below each level
    found: Pile | None = None
    for k in 1 + np.flatnonzero(counts[1:-1] >= PART * LEAST):
        below, above = float(levels[k] - levels[k - 1]), float(levels[k + 1] - levels[k])
        width = below + above
        first = int(np.searchsorted(levels, levels[k - 1] - width))
        last = int(np.searchsorted(levels, levels[k + 1] + width, side="right"))
        if min(_places(levels[first:k], width), _places(levels[k + 1 : last], width)) < SPREAD:
            continue
        missing = float(min(before[k] - before[first], before[last] - before[k + 1]))
        if missing < LEAST or counts[k] < PART * missing:
            continue
        if found is None or width > found.below + found.above:
            found = Pile(float(levels[k]), below, above, int(counts[k]))
    return found


def _most_alike(values: Array) -> int:
    """At least as many as the rows that the most frequent value has: a tenth of the time that sorting takes."""
    bits = (values + 0.0).view(np.int64)  # of one zero, not of two
    return int(np.bincount((bits ^ bits >> 16 ^ bits >> 32) & (BINS - 1), minlength=1).max())


def _places(levels: Array, width: float) -> int:
    """Tenths of a width in which values lie; none of fewer than `LEVELS`."""
    if len(levels) < LEVELS:
        return 0
    return len(np.unique(np.floor((levels - levels[0]) * LEVELS / width)))


def codes_evidence(record: ImuRecord, lat: float | None = None) -> list[Evidence]:
    """Channels that miss codes or have a dead band, and what that does.

    Parameters
    ----------
    record : ImuRecord
    lat : float, rad, optional
        Of a base that stays: a mean rate turns heading. Else the rows add up to a turn, or a velocity, at the end.
    """
    scale = 1.0 / record.interval if record.kind == "increments" else 1.0
    found = []
    for channel, name in enumerate(COLUMNS[record.kind]):
        sensor = record.gyro if channel < 3 else record.accel
        pile = piled_up(sensor[:, channel % 3])
        if pile is None:
            continue
        off = scale * max(pile.below, pile.above) / math.sqrt(3.0)
        size = off * pile.rows / len(record)  # of the mean
        effect = _effect(channel < 3, size, record.duration, lat)
        figures: dict[str, Figure] = {
            "name": name,
            "value": pile.value,
            "rows": pile.rows,
            "from": pile.value - pile.below,
            "to": pile.value + pile.above,
        }
        found.append(Evidence("record.codes", figures, "bounded", effect))
    return found


def _effect(gyro: bool, size: float, duration: float, lat: float | None) -> Effect:
    """Of a mean error (SI): on a base that stays, at a latitude, and on the move."""
    if lat is not None:
        return Effect(size / (EARTH_RATE * max(math.cos(lat), 1e-12))) if gyro else Effect(level=size / GRAVITY_EQUATOR)
    return Effect(size * duration, size * duration) if gyro else Effect(velocity=size * duration)
