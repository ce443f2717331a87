"""Single rows of an IMU that stand out: knocks, or errors of a transmission? The same log without them, by likelihood ratio.

A row of a smooth motion is what its six neighbours say, ``(15 (x_1 + x_-1) - 6 (x_2 + x_-2) + x_3 + x_-3) / 20``, to the sixth
difference. A row that misses that by far more than others of its time, and behind which the values are what they were before it,
is a spike. A vehicle that is knocked has such rows as well, and theirs are true: with each of them goes a velocity, or a turn, that
the measurements show. So the log is run once more with the rows that their neighbours say. Twice the logarithm of the likelihood
ratio says which of the two it is; in doubt what the answer moves by is in sigma.

Source: the Hampel identifier (R. Pearson, *Mining Imperfect Data*, SIAM 2005, ch. 2) on sixth differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.estimate.rivals import effect_of, last_sizes, likelihood_ratio, rival
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence
from truenorth.state.judge import weight
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

NEIGHBOURS = np.array([1.0, -6.0, 15.0, 0.0, 15.0, -6.0, 1.0]) / 20.0
HALF = 3
STRETCH = 8.0  # s, in which a row is compared with others
MEDIAN = 0.6745  # of the size of Gaussian values, in sigmas
FAR = 8.0  # sigmas: Gaussian noise has one in 10^15
SAME = 0.5  # of the spike, by which the values before and behind it may differ: a step is all of it
MOST = 0.1  # of the rows: more are no single ones


def without_spikes(record: ImuRecord) -> tuple[ImuRecord, int]:
    """The record with spikes replaced by what their neighbours say, and how many there were."""
    rows = max(round(STRETCH / record.interval), 2 * HALF + 1)
    gyro, accel = ([_mended(x, rows) for x in sensor.T] for sensor in (record.gyro, record.accel))
    count = sum(number for _, number in (*gyro, *accel))
    if count == 0:
        return record, 0
    turns, forces = (np.stack([x for x, _ in sensor], axis=1) for sensor in (gyro, accel))
    return replace(record, gyro=turns, accel=forces), count


def _mended(values: Array, rows: int) -> tuple[Array, int]:
    """A channel (N,) without spikes, and their number; as it is where they are no single rows."""
    if len(values) < rows:
        return values, 0
    said = np.convolve(values, NEIGHBOURS, mode="valid")
    off = values[HALF:-HALF] - said
    size = np.abs(off)
    starts = range(0, max(len(off) - rows // 2, 1), rows)
    usual = np.empty(len(off))
    for start in starts:
        part = slice(start, start + rows if start != starts[-1] else len(off))
        usual[part] = np.median(size[part]) / MEDIAN
    largest = np.max([np.roll(size, shift) for shift in range(-HALF, HALF + 1)], axis=0)
    at = np.flatnonzero((size > FAR * usual) & (usual > 0.0) & (size >= largest))
    before = np.median([values[at + HALF - lag] for lag in (1, 2, 3)], axis=0)
    behind = np.median([values[at + HALF + lag] for lag in range(1, HALF + 1)], axis=0)
    at = at[np.abs(behind - before) < SAME * size[at]]
    if not at.size or len(at) > MOST * len(values):
        return values, 0
    mended = values.copy()
    mended[at + HALF] = said[at]
    return mended, len(at)


def spike_evidence(run: Callable[[ImuRecord], Track], first: Track, record: ImuRecord) -> list[Evidence]:
    """Rows that stand out of their neighbours, and that the measurements do not know of.

    Parameters
    ----------
    run : callable
        The same measurements with another record.
    first : track
        Of the record as it is.
    record : ImuRecord
    """
    mended, count = without_spikes(record)
    if count == 0:
        return []
    try:
        other = run(mended)
    except DataError:  # the filter broke down: no explanation
        return []
    ratio, effect = likelihood_ratio(first.residuals, other.residuals), effect_of(first, other)
    if ratio < -limit("rival") or weight(effect, last_sizes(first)) <= limit("negligible"):
        return []  # the measurements show what the rows say, or it does not matter
    return [rival("rival.spikes", {"count": count}, ratio, effect, "source")]
