"""Rows of a long log: so many at once that what is made of them takes little memory, and their means."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = (
    2**19
)  # rows: 44 min at 200 Hz; six columns of doubles are 24 MiB. A multiple of 64, which the integration takes at once

# Rows of a mean up to which whole columns are added up: NumPy takes a row's few channels at a time, three times as long.
FEW = 256


def row_blocks(rows: int, unit: int = 1) -> Iterator[slice]:
    """Slices of at most `BLOCK` rows that follow each other; each but the last a multiple of `unit` rows (one at least)."""
    length = max(1, BLOCK // unit) * unit
    for first in range(0, rows, length):
        yield slice(first, min(first + length, rows))


def means_of(cells: Array) -> Array:
    """(..., c) means of cells (..., m, c) over their m rows, to the bit as NumPy has them."""
    m = cells.shape[-2]
    if not 0 < m <= FEW:
        return np.asarray(cells.mean(axis=-2))
    total = cells[..., 0, :].copy()
    for row in range(1, m):
        total += cells[..., row, :]
    return np.asarray(total / m)


def levels_of(x: Array) -> tuple[Array, NDArray[np.int64]]:
    """The levels of a channel (N,), rising, and the rows of each: as `numpy.unique`, in less memory where they are few."""
    if len(x) <= BLOCK:
        return np.unique(x, return_counts=True)
    parts = [np.unique(x[rows], return_counts=True) for rows in row_blocks(len(x))]
    levels, which = np.unique(np.concatenate([part[0] for part in parts]), return_inverse=True)
    counts = np.zeros(len(levels), dtype=np.int64)
    np.add.at(counts, which, np.concatenate([part[1] for part in parts]))
    return levels, counts
