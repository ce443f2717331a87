"""Packets of rows that have changed places: a log that is smooth again with two neighbours exchanged.

Some loggers write packets as they arrive and stamp the rows evenly. Where two packets of `L` rows have changed places the log jumps
at three edges, `L` rows from each other, and exchanged back it does not. A jump is what lies between the rows of an edge beyond the
mean of the slopes on either side; it counts by the median of its square over the log, of each channel. Shocks, steps and
vibration jump as well, but no exchange of rows makes them smooth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import row_blocks

Array = NDArray[np.float64]

LONGEST = 20  # rows of a packet
ORDINARY, JUMP = 50.0, 200.0  # six squares over their medians: white noise exceeds the first once in 1,000 edges
FEWEST = 3  # exchanges of one length
MOST = 50_000  # edges that are looked at closely


class Exchanged(NamedTuple):
    """Packets that have changed places."""

    length: int  # rows of a packet
    rows: NDArray[np.intp]  # first row of each pair


def exchanged_packets(data: Sequence[Array]) -> Exchanged | None:
    """Pairs of packets of one length that have changed places, or None.

    Parameters
    ----------
    data : six arrays (N,)
        Gyros and accelerometers.
    """
    count = len(data[0])
    if count < 2 * LONGEST + 6:
        return None
    jumps = np.zeros(count + 1, dtype=np.bool_)  # between row k - 1 and row k
    beyond, usual = np.zeros(count - 3), np.zeros(len(data))
    for i, x in enumerate(data):  # one after the other: of a long log all six at once are much memory
        squares = np.empty(count - 3)
        for part, jump in _in_blocks(x):
            squares[part] = jump
        usual[i] = np.median(squares, overwrite_input=True)
        if usual[i] > 0.0:
            for part, jump in _in_blocks(x):
                beyond[part] += jump / usual[i]
    known = usual > 0.0
    if not known.any():
        return None
    data, usual = [x for x, there in zip(data, known, strict=True) if there], usual[known]
    jumps[2 : count - 1] = beyond > JUMP
    best: Exchanged | None = None
    for length in range(1, LONGEST + 1):
        edges = jumps[: -2 * length] & jumps[length:-length] & jumps[2 * length :]
        first = np.flatnonzero(edges[: count - 2 * length - 1])[:MOST]
        first = _apart(first[_smooth_exchanged(data, usual, first, length)], 2 * length)
        if len(first) >= FEWEST and (best is None or len(first) > len(best.rows)):
            best = Exchanged(length, first)
    return best


def _smooth_exchanged(data: Sequence[Array], usual: Array, first: NDArray[np.intp], length: int) -> NDArray[np.bool_]:
    """Whether all three edges are ordinary, with the packets from these rows on exchanged back."""
    offset = np.arange(-2, 2 * length + 2)
    inside = (offset >= 0) & (offset < 2 * length)
    offset[inside] = (offset[inside] + length) % (2 * length)
    smooth = np.ones(len(first), dtype=np.bool_)
    for edge in (2, 2 + length, 2 + 2 * length):
        a, b, c, d = (np.array([x[first + offset[edge + k]] for x in data]) for k in (-2, -1, 0, 1))
        smooth &= np.einsum("ik,i->k", _beyond(a, b, c, d), 1.0 / usual) < ORDINARY
    return smooth


def _in_blocks(x: Array) -> Iterator[tuple[slice, Array]]:
    """Squares of the jumps of a channel, of few rows at once."""
    for part in row_blocks(len(x) - 3):
        near = x[part.start : part.stop + 3]
        yield part, _beyond(near[:-3], near[1:-2], near[2:-1], near[3:])


def _beyond(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Squares of the jumps from `b` to `c` beyond the mean of the slopes from `a` to `b` and from `c` to `d`."""
    return np.asarray((c - b - 0.5 * (b - a + d - c)) ** 2)


def _apart(rows: NDArray[np.intp], least: int) -> NDArray[np.intp]:
    """Of ascending rows those that follow the one kept before by so many at least."""
    kept: list[int] = []
    for row in rows.tolist():
        if not kept or row >= kept[-1] + least:
            kept.append(row)
    return np.array(kept, dtype=np.intp)
