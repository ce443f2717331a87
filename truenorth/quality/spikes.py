"""Single rows to one side on a base that stays: errors of a transmission add up to a bias, knocks and pulses do not.

A row of a smooth motion is what its six neighbours say, ``(15 (x_1 + x_-1) - 6 (x_2 + x_-2) + x_3 + x_-3) / 20``, to the sixth
difference. A row that misses that by far more than others of its time, and behind which the values are what they were before it,
is a spike. Spikes to one side add ``H = sum s`` to the sum of all rows, and ``H / N`` to their mean. Three things look alike:

- a knock. The base comes back to rest: of its force nothing is left a second later, nor of its turn. The sum of all that the
  rows around its spikes are beyond their usual value is then nothing, and not H;
- the pulse of a coarse counter, which is true. It carries its remainders on: with its pulses, sums over many rows scatter by
  less than without them. Independent errors make them scatter by more;
- a step of a counter: as large as what rounding makes of any row.

Of a knock a mended log lacks H in the rows around: their sums, held against the six sums next to them as a row is against its
neighbours, are off by -H, of errors by what they are off at other places of the log.

What is none of these is an error of a row, and H is one of the mean. Rows that stand out by less, of which noise has some, are
errors where their signs are not those of noise: ``H^2`` is then far more than ``sum s^2``.

Source: the Hampel identifier (R. Pearson, *Mining Imperfect Data*, SIAM 2005, ch. 2) on sixth differences. The rest is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.quality.quantum import lattice
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

NEIGHBOURS = np.array([1.0, -6.0, 15.0, 0.0, 15.0, -6.0, 1.0]) / 20.0
HALF = 3
STRETCH = 8.0  # s, in which a row is compared with others
MEDIAN = 0.6745  # of the size of Gaussian values, in sigmas
FAR = 8.0  # sigmas: Gaussian noise has one in 10^15
SAME = 0.5  # of the spike, by which the values before and behind it may differ, but for a slope: a step is all of it
MOST = 0.1  # of the rows: more are no single ones
AFTER = (1.0, 0.3, 0.1)  # s, in which a base that was knocked comes back to rest: on springs, on tyres, a hull
PLACES = 64  # of a log, at which the same windows are looked at
NEAR = 4.0  # sigmas, from which on rows are asked for their signs: one in 16,000 by chance
FEWEST = 3  # spikes
SUMS = (8, 32, 128, 512)  # rows, of which sums show whether remainders are carried on
BLOCKS = 8  # such sums at least
CARRIED = 0.6  # of their scatter without spikes, that pulses of a counter leave at the most


class Spikes(NamedTuple):
    """Of a channel: rows that stand out, and what their neighbours say of them."""

    rows: Rows
    said: Array


def spikes_of(values: Array, interval: float, far: float = FAR) -> Spikes:
    """Spikes of a channel (N,) whose rows are so many seconds apart; none where they are no single rows.

    Parameters
    ----------
    values : (N,) array
    interval : float, s
    far : float
        Sigmas by which they stand out.
    """
    none = Spikes(np.empty(0, dtype=np.intp), np.empty(0))
    rows = max(round(STRETCH / interval), 2 * HALF + 1)
    if len(values) < rows:
        return none
    said = np.convolve(values, NEIGHBOURS, mode="valid")
    size = np.abs(values[HALF:-HALF] - said)
    usual = np.empty(len(size))
    for part in _stretches(len(size), rows):
        usual[part] = np.median(size[part]) / MEDIAN
    largest = np.max([np.roll(size, shift) for shift in range(-HALF, HALF + 1)], axis=0)
    at = np.flatnonzero((size > far * usual) & (usual > 0.0) & (size >= largest))
    at = HALF + at[(at > 0) & (at < len(size) - 1)]
    near, far_off = (
        0.5 * sum(values[at + lag] - values[at - lag] for lag in lags) for lags in ((1, 2), (HALF, HALF + 1))
    )
    step = (
        7.0 * near - 3.0 * far_off
    ) / 4.0  # of means 3 and 7 rows from each other, in which a slope has 3 and 7 times
    at = at[np.abs(step) < SAME * size[at - HALF]]
    return none if len(at) > MOST * len(values) else Spikes(at, said[at - HALF])


def _stretches(count: int, rows: int) -> list[slice]:
    """So many rows each, the last with what is left."""
    starts = range(0, max(count - rows // 2, 1), rows)
    return [slice(start, start + rows if start != starts[-1] else count) for start in starts]


def spikes_evidence(record: ImuRecord, lat: float) -> list[Evidence]:
    """Channels of a base at rest whose single rows to one side are errors, and what that does to heading and level.

    Parameters
    ----------
    record : ImuRecord
    lat : float, rad
    """
    unit = 1.0 / record.interval if record.kind == "increments" else 1.0
    found = []
    for channel, name in enumerate(COLUMNS[record.kind]):
        sensor = record.gyro if channel < 3 else record.accel
        count, mean = one_sided(sensor[:, channel % 3], record.interval)
        if mean == 0.0:
            continue
        size = abs(mean) * unit
        effect = Effect(level=size / GRAVITY_EQUATOR)
        if channel < 3:
            effect = Effect(heading=size / max(EARTH_RATE * math.cos(lat), 1e-12))
        figures: dict[str, Figure] = {"name": name, "count": count, "heading": effect.heading, "level": effect.level}
        found.append(Evidence("record.spikes", figures, "known", effect, ("source",)))
    return found


def one_sided(values: Array, interval: float) -> tuple[int, float]:
    """Spikes of a channel (N,) that are errors to one side, and the error of its mean; zeros where chance or a base makes them."""
    step, _ = lattice(values)
    for far in (NEAR, FAR):
        at, said = spikes_of(values, interval, far)
        alone = np.abs(values[at] - said) > far * step
        at, said = at[alone], said[alone]
        size = values[at] - said
        total = float(size.sum())
        by_chance = math.sqrt(float(np.sum(size**2))) if far < FAR else 0.0
        if len(at) >= FEWEST and abs(total) > limit("one-sided spikes") * by_chance:
            return (len(at), total / len(values)) if _are_errors(values, at, said, interval) else (0, 0.0)
    return 0, 0.0


def _are_errors(values: Array, at: Rows, said: Array, interval: float) -> bool:
    """Whether rows at which a channel is not as its neighbours say are neither knocks nor pulses of a counter.

    By the longest time after a knock in which the motion of the base leaves their sum to be seen.
    """
    mended = values.copy()
    mended[at] = said
    for time in AFTER:
        total, left, scatter = _balance(values, mended, at, max(round(time / interval), 1))
        enough = limit("one-sided spikes") * scatter
        if abs(total) > enough:
            return abs(left) < min(enough, 0.5 * abs(total)) and not _are_pulses(values, mended)
    return False


def _balance(values: Array, mended: Array, at: Rows, side: int) -> tuple[float, float, float]:
    """Sum of spikes in windows of so many rows to either side of each, what the rest of these is off, and one sigma of that.

    The rest of a window is held against the six next to it, and sigma is what it is off at other places of the log.
    """
    width = 2 * side + 1
    windows, spikes = (_sums(x, width) for x in (mended - mended.mean(), values - mended))
    if len(windows) < (2 * HALF + 1) * width + PLACES:
        return 0.0, 0.0, math.inf
    reach = HALF * width
    off = windows[reach:-reach].copy()
    for k, weight in enumerate(NEIGHBOURS):
        off -= weight * windows[k * width : k * width + len(off)]
    first = at - side  # row of each window, and then where it stands among those that have neighbours
    first = first[(first >= reach) & (first < reach + len(off))] - reach
    places = np.arange(1, PLACES) * len(off) // PLACES
    elsewhere = np.array([off[(first + place) % len(off)].sum() for place in places])
    return float(spikes[first + reach].sum()), float(off[first].sum()), math.sqrt(float(np.mean(elsewhere**2)))


def _sums(x: Array, width: int) -> Array:
    """(N - width + 1,) sums of so many neighbours."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(total[width:] - total[:-width])


def _are_pulses(values: Array, mended: Array) -> bool:
    """Whether sums over many rows of values (N,) scatter by less than those without their spikes."""
    shares = [1.0]
    for rows in SUMS:
        if len(values) < BLOCKS * rows:
            break
        own, without = (x[: len(x) // rows * rows].reshape(-1, rows).sum(axis=1) for x in (values, mended))
        shares.append(float(np.sum(np.diff(own) ** 2) / max(np.sum(np.diff(without) ** 2), 1e-300)))
    return min(shares) < CARRIED
