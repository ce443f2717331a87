"""Single rows to one side on a base that stays: errors of a transmission add up to a bias, knocks and pulses do not.

A row of a smooth motion is what its six neighbours say, ``(15 (x_1 + x_-1) - 6 (x_2 + x_-2) + x_3 + x_-3) / 20``, to the sixth
difference. A row that misses that by far more than others of its time, and behind which the values are what they were before it,
is a spike. Spikes to one side add ``H = sum s`` to the sum of all rows, and ``H / N`` to their mean. Three things look alike:

- a knock. The base comes back to rest: what follows its spikes is their opposite, on the mean (:mod:`truenorth.quality.knocks`);
- the pulse of a coarse counter, which is true. It carries its remainders on: with its pulses, sums over many rows scatter by
  less than without them. Independent errors make them scatter by more;
- a step of a counter: as large as what rounding makes of any row.

What is none of these is an error of a row, and H is one of the mean; where the log does not show whether it is a knock, H / N is in
sigma. Rows that stand out by less, of which noise has some, are errors where their signs are not those of noise: ``H^2`` is then
far more than ``sum s^2``.

Source: the Hampel identifier (R. Pearson, *Mining Imperfect Data*, SIAM 2005, ch. 2) on sixth differences. The rest is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.quality.knocks import sums_of_answer
from truenorth.quality.quantum import largest_step, lattice_step
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit
from truenorth.strapdown.increments import of_own_intervals

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

NEIGHBOURS = np.array([1.0, -6.0, 15.0, 0.0, 15.0, -6.0, 1.0]) / 20.0
HALF = 3
STRETCH = 8.0  # s, in which a row is compared with others
MEDIAN = 0.6745  # of the size of Gaussian values, in sigmas
FAR = 8.0  # sigmas: Gaussian noise has one in 10^15
SAME = 0.5  # of the spike, by which the values before and behind it may differ, but for a slope: a step is all of it
MOST = 0.1  # of the rows: more are no single ones
NEAR = 4.0  # sigmas, from which on rows are asked for their signs: one in 16,000 by chance
FEWEST = 3  # spikes
SUMS = (8, 32, 128, 512)  # rows, of which sums show whether remainders are carried on
BLOCKS = 8  # such sums at least
CARRIED = 0.6  # of their scatter without spikes, that pulses of a counter leave at the most


class OneSided(NamedTuple):
    """Spikes of a channel to one side."""

    kind: Kind  # known: they are errors; hint: they may be
    rows: int
    mean: float  # by which they move the mean of the channel


class Spikes(NamedTuple):
    """Of a channel: rows that stand out, and what their neighbours say of them."""

    rows: Rows
    said: Array


class Sizes(NamedTuple):
    """Of a channel: by how much its rows, but for three at either end, miss what their neighbours say."""

    size: Array
    usual: Array  # one sigma of that, in each stretch
    stretch: int  # rows

    def beyond(self, far: float) -> Rows:
        """Which are more than so many sigmas."""
        found = [np.empty(0, dtype=np.intp)]
        for rows in row_blocks(len(self.size)):
            usual = self.usual[np.minimum(np.arange(rows.start, rows.stop) // self.stretch, len(self.usual) - 1)]
            found.append(rows.start + np.flatnonzero((self.size[rows] > far * usual) & (usual > 0.0)))
        return np.concatenate(found)


def sizes_of(values: Array, interval: float) -> Sizes | None:
    """By how much rows of a channel (N,) miss what their neighbours say; None of fewer rows than are compared."""
    rows = max(round(STRETCH / interval), 2 * HALF + 1)
    if len(values) < rows:
        return None
    size = np.empty(len(values) - 2 * HALF)
    for part in row_blocks(len(size)):
        size[part] = np.abs(_missed(values[part.start : part.stop + 2 * HALF]))
    last = _last_stretch(len(size), rows)
    stretches = [np.median(size[part].reshape(-1, rows), axis=1) for part in row_blocks(last, rows)]
    usual = np.concatenate([*stretches, [np.median(size[last:])]]) / MEDIAN
    return Sizes(size, usual, rows)


def _missed(values: Array) -> Array:
    """By what values miss what their neighbours say, but for those at either end."""
    return np.asarray(values[HALF:-HALF] - np.convolve(values, NEIGHBOURS, mode="valid"))


def spikes_of(values: Array, interval: float, far: float = FAR, sizes: Sizes | None = None) -> Spikes:
    """Spikes of a channel (N,) whose rows are so many seconds apart; none where they are no single rows.

    Parameters
    ----------
    values : (N,) array
    interval : float, s
    far : float
        Sigmas by which they stand out.
    sizes : Sizes, optional
        Of the channel, where they are known already.
    """
    none = Spikes(np.empty(0, dtype=np.intp), np.empty(0))
    if sizes is None:
        sizes = sizes_of(values, interval)
    if sizes is None:
        return none
    size, at = sizes.size, sizes.beyond(far)
    at = at[(at > 0) & (at < len(size) - 1)]
    for lag in (*range(-HALF, 0), *range(1, HALF + 1)):  # one after the other: of a counter most rows may stand out
        at = at[size[at] >= size[(at + lag) % len(size)]]
    at = HALF + at
    near, far_off = (
        0.5 * sum(values[at + lag] - values[at - lag] for lag in lags) for lags in ((1, 2), (HALF, HALF + 1))
    )
    # Of means 3 and 7 rows from each other, in which a slope has 3 and 7 times.
    step = (7.0 * near - 3.0 * far_off) / 4.0
    at = at[np.abs(step) < SAME * size[at - HALF]]
    if len(at) > MOST * len(values):
        return none
    return Spikes(
        at, np.asarray(sum(w * values[at + k] for k, w in zip(range(-HALF, HALF + 1), NEIGHBOURS, strict=True)))
    )


def _last_stretch(count: int, rows: int) -> int:
    """Where the last of stretches of so many rows begins, which has what is left, too."""
    return max((count - rows // 2 - 1) // rows, 0) * rows


def spikes_evidence(record: ImuRecord, lat: float) -> list[Evidence]:
    """Channels of a base at rest whose single rows to one side are errors, and what that does to heading and level.

    Parameters
    ----------
    record : ImuRecord
    lat : float, rad
    """
    counted = record.kind == "increments"
    unit = 1.0 / record.interval if counted else 1.0
    gyro, accel = of_own_intervals(record)  # what a gap holds is no spike, and has a part of one in the row before it
    found = []
    for channel, name in enumerate(COLUMNS[record.kind]):
        spikes = one_sided((gyro if channel < 3 else accel)[:, channel % 3], record.interval)
        if spikes is None:
            continue
        size = abs(spikes.mean) * unit
        effect = Effect(level=size / GRAVITY_EQUATOR)
        if channel < 3:
            effect = Effect(heading=size / max(EARTH_RATE * math.cos(lat), 1e-12))
        figures: dict[str, Figure] = {
            "name": name,
            "count": spikes.rows,
            "heading": effect.heading,
            "level": effect.level,
        }
        key = "record.spikes" if spikes.kind == "known" else "record.spikes_or_knocks"
        found.append(Evidence(key, figures, spikes.kind, effect, ("source",)))
    return found


def one_sided(values: Array, interval: float) -> OneSided | None:
    """Spikes of a channel (N,) to one side that are errors, or may be; None where chance, a base or a counter makes them."""
    sizes = sizes_of(values, interval)
    for far in (NEAR, FAR):
        at, said = spikes_of(values, interval, far, sizes)
        if len(at) < FEWEST:
            continue
        alone = np.abs(values[at] - said)
        bound = largest_step(values)
        alone = alone > far * (bound if far * bound < alone.min() else lattice_step(values))
        at, said = at[alone], said[alone]
        size = values[at] - said
        total = float(size.sum())
        by_chance = math.sqrt(float(np.sum(size**2))) if far < FAR else 0.0
        if len(at) >= FEWEST and abs(total) > limit("one-sided spikes") * by_chance:
            kind = _kind(values, at, said, interval)
            return None if kind is None else OneSided(kind, len(at), total / len(values))
    return None


def _kind(values: Array, at: Rows, said: Array, interval: float) -> Kind | None:
    """What rows are at which a channel is not as its neighbours say: None where they are knocks, or pulses of a counter.

    Known where they are errors, a hint where the log does not show which of both they are, and they are more than noise is.
    """
    mended = values.copy()
    mended[at] = said
    answers, enough = sums_of_answer(mended, values - mended, interval), limit("one-sided spikes")
    if all(answer.is_knock(enough) for answer in answers) or _are_pulses(values, mended):
        return None
    if all(answer.is_error(enough) for answer in answers):
        return "known"
    return "hint" if abs(float(np.sum(values - mended))) > _of_noise(values) else None


def _of_noise(values: Array) -> float:
    """One sigma of what white noise adds to the sum of all rows."""
    white = float(np.median(np.abs(_missed(values)))) / MEDIAN / math.sqrt(1.0 + float(NEIGHBOURS @ NEIGHBOURS))
    return white * math.sqrt(len(values))


def _are_pulses(values: Array, mended: Array) -> bool:
    """Whether sums over many rows of values (N,) scatter by less than those without their spikes."""
    shares = [1.0]
    for rows in SUMS:
        if len(values) < BLOCKS * rows:
            break
        own, without = (x[: len(x) // rows * rows].reshape(-1, rows).sum(axis=1) for x in (values, mended))
        shares.append(float(np.sum(np.diff(own) ** 2) / max(np.sum(np.diff(without) ** 2), 1e-300)))
    return min(shares) < CARRIED
