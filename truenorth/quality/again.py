"""Rows that come again: a stretch of a log that was written twice, with other stamps.

A real sensor has noise, and never gives a second's rows again, to the bit. How long a stretch must be says the log itself. Two rows
at random have the same step from the row before with a probability `q` (that of coarse counters at rest is large, that of a dead
log one); taken for independent, B rows come again by chance anywhere in a log of N with a probability of less than ``N^2 q^B / 2``.
Steps of a coarse counter go together, so that a stretch is `SAFE` times as long as that asks for at a probability of 1e-9.

Stretches are compared by a hash of their rows; of a long log those are looked at whose hash is one of a few, the same ones
wherever they stand (the winnowing of S. Schleimer, D. Wilkerson, A. Aiken, SIGMOD 2003, in its simplest form).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.records import ImuRecord
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Hashes = NDArray[np.uint64]

SHORTEST, SAFE = 50, 3.0  # rows of a stretch at least, and what its length is multiplied by
ASKED = 200_000  # rows by which the probability is found, and stretches that are looked at
CHUNK = 1 << 20  # rows that are hashed at a time
MIXED = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93, 0xA0761D6478BD642F,
                  0xE7037ED1A0B428DB], dtype=np.uint64)  # fmt: skip


class Again(NamedTuple):
    """Rows, from zero: where a stretch stands first, where it comes again, and how long it is."""

    first: int
    again: int
    length: int


def rows_again(record: ImuRecord) -> Again | None:
    """The first stretch that comes again, as long as it is; None where none does."""
    count = len(record)
    length = _long_enough(record)
    if 2 * length > count:
        return None
    hashes, at = _stretches(record, length)
    ordered = np.sort(hashes)  # without their places: less than half of the time, and hardly a log has two of one
    if not (ordered[1:] == ordered[:-1]).any():
        return None
    order = np.argsort(hashes, kind="stable")
    same = np.flatnonzero(hashes[order[1:]] == hashes[order[:-1]])
    before, after = at[order[same]], at[order[same + 1]]
    apart = after - before >= length
    for k in np.argsort(before[apart], kind="stable")[:1]:
        i, j = int(before[apart][k]), int(after[apart][k])
        stretch = _equal(record, i, j)
        if stretch >= length:  # and no two stretches of one hash
            back = _equal(record, i, j, backward=True)
            return Again(i - back, j - back, min(stretch + back, j - i))
    return None


def _long_enough(record: ImuRecord) -> int:
    """Rows of a stretch that chance does not write twice."""
    some = record[: min(len(record), ASKED)]
    steps = np.diff(np.column_stack([some.gyro, some.accel]), axis=0)
    kinds, number = np.unique(_hashed(np.ascontiguousarray(steps)), return_counts=True)
    count = len(steps)
    if count < 2:
        return len(record)
    # A row that comes again once in a log that is written twice is no probability of its own.
    q = max(float(np.sum(number * (number - 1.0))) / (count * (count - 1.0)) - 1.0 / count, 0.0)
    if q == 0.0:
        return SHORTEST
    if len(kinds) < SHORTEST or q > 0.99:  # hardly anything happens in it
        return len(record)
    pairs = 2.0 * math.log(len(record)) - math.log(2.0 * limit("written twice"))
    return max(SHORTEST, math.ceil(SAFE * pairs / -math.log(q)))


def _hashed(rows: Array) -> Hashes:
    """(N,) of (N, 6)."""
    bits = rows.view(np.uint64)
    mixed = np.zeros(len(rows), dtype=np.uint64)
    for column, factor in zip(bits.T, MIXED, strict=True):
        mixed += column * factor
        mixed ^= mixed >> np.uint64(29)
    return mixed


def _stretches(record: ImuRecord, length: int) -> tuple[Hashes, NDArray[np.intp]]:
    """Hashes of the stretches that are looked at, and their first rows."""
    share = np.uint64(max(1, len(record) // ASKED))
    hashes, at = [], []
    for start in range(0, len(record) - length + 1, CHUNK):
        rows = slice(start, min(start + CHUNK + length - 1, len(record)))
        of_rows = _hashed(np.ascontiguousarray(np.column_stack([record.gyro[rows], record.accel[rows]])))
        whole = _of_windows(of_rows, length)
        looked = np.flatnonzero(whole % share == 0)
        hashes.append(whole[looked])
        at.append(start + looked)
    return np.concatenate(hashes), np.concatenate(at)


def _of_windows(rows: Hashes, length: int) -> Hashes:
    """(N - length + 1,) hashes of so many rows each: those of powers of two, doubled, and put together."""
    total, done, power, span, factor = np.zeros(len(rows), dtype=np.uint64), 0, rows.copy(), 1, MIXED[0] | np.uint64(1)
    while True:
        if length & span:
            total = total[: len(power) - done] * factor + power[done:]
            done += span
        if 2 * span > length:
            return total[: len(rows) - length + 1]
        power = power[:-span] * factor + power[span:]
        factor = np.uint64(int(factor) ** 2 % 2**64)
        span *= 2


def _equal(record: ImuRecord, i: int, j: int, *, backward: bool = False) -> int:
    """How many rows from i and j on, or before them, are equal to the bit."""
    most = min(i, j) if backward else len(record) - j
    length = 0
    while length < most:
        step = min(CHUNK, most - length)
        a, b = (k - length - step if backward else k + length for k in (i, j))
        same = np.ones(step, dtype=np.bool_)
        for values in (record.gyro, record.accel):
            same &= (values[a : a + step] == values[b : b + step]).all(axis=1)
        if backward:
            same = same[::-1]
        if not same.all():
            return length + int(np.argmin(same))
        length += step
    return length
