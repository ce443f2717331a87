"""What several looks at a log of an IMU want of all its rows, in one pass: memory gives rows more slowly than they are added up."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.remembered import remembered
from truenorth.core.vectors import each4 as product4
from truenorth.core.vectors import (
    load3,
    load8,
    minus4,
    minus8,
    over8,
    plus4,
    plus8,
    product8,
    spread8,
    store4,
    store8,
    times8,
    zero4,
    zero8,
)
from truenorth.records.imu import ImuRecord

Array = NDArray[np.float64]

CELL = 0.1  # s, the samples are averaged over this first
BLOCKS = 10  # the scatter of this many block means shows how well the mean is known
TIMES = (0.02, 0.1, 0.5, 1.0, 2.0)  # s, over which means are taken that show white noise
QUIET = 20.0  # s, of a group of their differences


class Passed(NamedTuple):
    """What a pass over rows has found; increments as they are.

    Attributes
    ----------
    cells : (6, C) array
        Means of :func:`rows_of_cell` rows each, gyros and accelerometers.
    white_noise : (6,) array, rad/sqrt(s) and m/s/sqrt(s)
        See :func:`truenorth.quality.signals.white_noise`.
    blocks : (B, 7) array
        Of `BLOCKS` parts of the log: time, s, and sums of the gyros' rows and of the accelerometers'.
    gyro : (2, 3) array
        Sums of the gyros' rows, and of their squares.
    force : (float, float)
        The smallest and the largest square of the length of an accelerometers' row.
    """

    cells: Array
    white_noise: Array
    blocks: Array
    gyro: Array
    force: tuple[float, float]


def rows_of_cell(record: ImuRecord) -> int:
    """Rows of `CELL`."""
    return max(1, round(CELL / record.interval))


@remembered
def passed(record: ImuRecord) -> Passed:
    """Pass over a record."""
    count = len(record)
    lengths = [max(1, round(tau / record.interval)) for tau in TIMES]
    cell, every = rows_of_cell(record), math.gcd(*lengths)
    parts = min(BLOCKS, count)
    edges = _edges(count, parts)
    cells, total = np.empty((6, count // cell)), np.empty((count // every + 1, 8))
    blocks, gyro, force = np.empty((parts, 8)), np.empty((2, 4)), np.empty(2)
    _pass_over(record.gyro, record.accel, record.steps, cell, every, edges, cells, total, blocks, gyro, force)
    return Passed(cells, _white_noise(record, lengths, every, total), blocks[:, :7], gyro[:, :3], (force[0], force[1]))


@lru_cache(maxsize=16)
def _edges(count: int, parts: int) -> NDArray[np.int64]:
    """(parts + 1,) rows between parts of so many rows; nobody writes to them."""
    return np.append(np.linspace(0, count, parts + 1).astype(int)[:-1], count)


def _white_noise(record: ImuRecord, lengths: list[int], every: int, total: Array) -> Array:
    """The least random walk (6,) that means of rows of these lengths show, by sums up to each `every`-th row."""
    quiet, used, rows = [], [], len(record)
    for m in lengths:
        count = rows // m
        if count < 4:
            break
        group = min(count - 1, max(3, round(QUIET / (m * record.interval))))
        variance = np.empty(((count - 1) // group, 8))
        _allan_variances(total, m // every, m, group, variance)
        quiet.append(_lower_quartiles(variance[:, :6]))
        used.append([m])
    if not used:
        return np.zeros(6)
    scale = 1.0 if record.kind == "rates" else 1.0 / record.interval
    least = (scale * np.sqrt(np.array(quiet) * used * record.interval)).min(axis=0)
    return np.where(np.isfinite(least), least, 0.0)


@compiled
def _pass_over(
    gyro: Any,
    accel: Any,
    steps: Any,
    cell: int,
    every: int,
    edges: Any,
    cells: Any,
    total: Any,
    blocks: Any,
    moments: Any,
    force: Any,
) -> None:
    """Fill the arrays of :class:`Passed`, and ``total`` (M + 1, 6 and two zeros): sums of all rows up to each `every`-th.

    Those are about the first row, so that gravity eats no digits of them. A row is a vector of four, the last of which is zero.
    """
    none, means = zero4(), np.zeros(8)
    w_0, f_0 = load3(gyro, (0, 0)), load3(accel, (0, 0))
    w_cell, f_cell, w_all, f_all, w_block, f_block, w_sum, w_squares = none, none, none, none, none, none, none, none
    T, b, c, j = 0.0, 0, 0, 1
    end_of_cell, end_of_sum, end_of_block = cell, every, edges[1]
    least, most = np.inf, 0.0
    store4(total, (0, 0), none)
    store4(total, (0, 4), none)
    for k in range(len(gyro)):
        w, f = load3(gyro, (k, 0)), load3(accel, (k, 0))
        w_cell, f_cell = plus4(w_cell, w), plus4(f_cell, f)
        w_all, f_all = plus4(w_all, minus4(w, w_0)), plus4(f_all, minus4(f, f_0))
        w_block, f_block = plus4(w_block, w), plus4(f_block, f)
        w_sum, w_squares = plus4(w_sum, w), plus4(w_squares, product4(w, w))
        T += steps[k]
        square = accel[k, 0] ** 2 + accel[k, 1] ** 2 + accel[k, 2] ** 2
        least, most = min(least, square), max(most, square)
        if k + 1 == end_of_sum:
            store4(total, (j, 0), w_all)
            store4(total, (j, 3), f_all)
            total[j, 7] = 0.0
            j, end_of_sum = j + 1, end_of_sum + every
        if k + 1 == end_of_cell:
            store4(means, (0,), w_cell)
            store4(means, (3,), f_cell)
            for i in range(6):
                cells[i, c] = means[i] / cell
            w_cell, f_cell, c, end_of_cell = none, none, c + 1, end_of_cell + cell
        if k + 1 == end_of_block:
            blocks[b, 0] = T
            store4(blocks, (b, 1), w_block)
            store4(blocks, (b, 4), f_block)
            T, w_block, f_block, b = 0.0, none, none, b + 1
            end_of_block = edges[min(b + 1, len(edges) - 1)]
    store4(moments, (0, 0), w_sum)
    store4(moments, (1, 0), w_squares)
    force[0], force[1] = least, most


def _lower_quartiles(values: Array) -> Array:
    """Of each column, between the two nearest in proportion: those of :func:`numpy.quantile`, which takes longer to begin."""
    place = 0.25 * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    ordered = values.copy()
    ordered.partition((below, above), axis=0)
    return np.asarray(ordered[below] + (place - below) * (ordered[above] - ordered[below]))


@compiled
def _allan_variances(total: Any, step: int, m: int, group: int, variance: Any) -> None:
    """Half the mean square of differences of means of `m` rows one behind the other, by groups (G, 8) of differences.

    From one sum to the next that is used there are `step`.
    """
    for g in range(variance.shape[0]):
        squares = zero8()
        for k in range(g * group * step, (g + 1) * group * step, step):
            twice = times8(2.0, load8(total, (k + step, 0)))
            change = plus8(minus8(load8(total, (k + 2 * step, 0)), twice), load8(total, (k, 0)))
            squares = plus8(squares, product8(change, change))
        store8(variance, (g, 0), over8(squares, spread8(2.0 * group * m * m)))
