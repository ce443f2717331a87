"""Rows of a long log, so many at once that what is made of them takes little memory."""

from __future__ import annotations

from collections.abc import Iterator

BLOCK = (
    2**19
)  # rows: 44 min at 200 Hz; six columns of doubles are 24 MiB. A multiple of 64, which the integration takes at once


def row_blocks(rows: int, unit: int = 1) -> Iterator[slice]:
    """Slices of at most `BLOCK` rows that follow each other; each but the last a multiple of `unit` rows (one at least)."""
    length = max(1, BLOCK // unit) * unit
    for first in range(0, rows, length):
        yield slice(first, min(first + length, rows))
