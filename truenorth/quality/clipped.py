"""A sensor's range that is exceeded: an extreme value at which rows pile up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import levels_of, row_blocks
from truenorth.state.limits import limit

Array = NDArray[np.float64]

ROUNDING = 1e-10  # of a sensor's largest value: what varies by less has no noise
RUN = 3  # rows at the extreme, one after the other ...
RANGE_SLACK = 1.05  # by which the other side may exceed the end of a range, for a bias taken off, ...
TAIL, TAIL_LEVELS = 0.25, 20  # ... and more where a tail of so many levels, in this part of the spread, is cut off
# Counts of a period of a pulse train, where both edges of two signals are counted: the four are not alike, so that of a sensor
# at rest every fourth value may be full and those between empty. Values are compared over whole periods.
PERIOD = 4
OFF = 0.01  # of a step, by which an extreme misses what all other values are multiples of
LATTICE = 1e-4  # of a step, by which those may
FEWEST_LEVELS = 3  # values that show a step twice


class Extreme(NamedTuple):
    """A value at which a channel is clipped, its rows, and the most rows of the next values inside."""

    value: float
    rows: int
    inside: int


def clipped_at(x: Array) -> Iterator[Extreme]:
    """The ends of a channel's range, of those at which rows are piled up.

    Clipping breaks the fall of the tail, a coarse quantum does not.
    """
    values = _rounded(x, ROUNDING * largest([x]))  # of sums and products: counts that are alike may differ by it
    rough = float(np.median(roughness(values), overwrite_input=True)) if len(values) > 2 else 0.0
    noise = rough / (0.6745 * math.sqrt(6.0))
    for sign in (1.0, -1.0):
        signed = values if sign > 0.0 else np.negative(values, out=values)
        if (piled := _piled(signed, noise)) is not None:
            yield Extreme(sign * piled.value, piled.rows, piled.inside)


def _piled(signed: Array, noise: float) -> Extreme | None:
    """The largest value, where rows are piled up at it."""
    top = float(signed.max())
    at_top = signed == top
    count = int(np.count_nonzero(at_top))
    if count < 2 * RUN or count == signed.size:
        return None
    levels, counts = levels_of(signed)
    levels, counts = levels[:-1], counts[:-1]  # inside
    spread = top - float(np.median(signed))
    tail = counts[levels > top - TAIL * spread]
    most = limit("piled")
    cut = len(tail) > TAIL_LEVELS and count > most * max(int(tail.max()), 2)  # of many levels, each with few rows
    off = _off(top, levels[1:])  # what clips may have two sides
    two_sided = -float(levels[0]) <= RANGE_SLACK * abs(top)
    if not (cut or off or two_sided):  # a range has two sides alike: not its end
        return None
    second = float(levels[-1])
    inside = int(counts[levels >= second - (PERIOD - 0.5) * finest(levels)].max())
    rows_at = np.flatnonzero(at_top)
    consecutive = bool(np.any(rows_at[RUN - 1 :] - rows_at[: 1 - RUN] == RUN - 1))
    # Noise of less than a quantum takes a row one further down; half a quantum is for rounding.
    lowest = second - (1.5 if noise <= top - second else 0.5) * (top - second)
    crests = _crests(signed, rows_at, lowest, inside)
    if not off and noise <= top - second and inside > most * max(int(counts[-4:-1].max(initial=0)), 2):
        return None  # steady between two counts: what clips does not stand at the second as well
    often = count > most * max(inside, 2)
    piled = count > 2 * inside and (consecutive or often) and not crests
    # Values that have many digits are never alike by chance, wherever the next ones stand.
    piled = piled and (spread > 5.0 * (top - second) or (often and top - second > most * finest(levels)))
    return Extreme(top, count, inside) if piled or off else None


def _off(top: float, levels: Array) -> bool:
    """Whether all values but the extreme are multiples of one step: something behind the sensor has clipped it."""
    if len(levels) < FEWEST_LEVELS:
        return False
    step = finest(levels)
    places = (levels - levels[0]) / step
    if np.abs(places - np.round(places)).max() > LATTICE:
        return False
    place = (top - levels[0]) / step
    return bool(abs(place - round(place)) > OFF)


def _crests(signed: Array, rows_at: NDArray[np.intp], lowest: float, inside: int) -> bool:
    """Whether the rows at the largest value are crests of a smooth motion, seen through a coarse quantum.

    Around a crest ``x = x_0 - a t^2 / 2`` the uppermost quantum has up to ``1 / (sqrt(2) - 1)`` times as many rows as the next,
    each side of either to a row; and the rows before and after are of the next one, `lowest` at least. What is clipped falls
    from its range faster.
    """
    breaks = np.flatnonzero(np.diff(rows_at) > 1)
    first, last = rows_at[np.append(0, breaks + 1)], rows_at[np.append(breaks, len(rows_at) - 1)]
    before, after = signed[np.maximum(first - 1, 0)], signed[np.minimum(last + 1, len(signed) - 1)]
    smooth = bool(np.all(before >= lowest) and np.all(after >= lowest))
    return smooth and len(rows_at) <= (inside + 2 * len(first)) / (math.sqrt(2.0) - 1.0) + len(first)


def finest(values: Array) -> float:
    """The smallest step between two values, but for rounding of the arithmetic; infinite where all are alike."""
    steps = np.diff(np.unique(values))
    rounding = ROUNDING * float(np.abs(values).max(initial=0.0))
    return float(np.min(steps, initial=np.inf, where=steps > rounding))


def largest(sensor: Iterable[Array]) -> float:
    """The largest size of any value of some channels."""
    return max(max(float(x.max()), -float(x.min())) for x in sensor)


def _rounded(x: Array, quantum: float) -> Array:
    """A copy of a channel, in multiples of a quantum. Of a long log each further array is much memory."""
    if not quantum:
        return x.copy()
    values = x / quantum
    np.round(values, out=values)
    values *= quantum
    return values


def roughness(x: Array) -> Array:
    """Size of the second differences of a channel."""
    found = np.empty(max(len(x) - 2, 0))
    for rows in row_blocks(len(found)):
        found[rows] = np.abs(np.diff(x[rows.start : rows.stop + 2], n=2))
    return found
