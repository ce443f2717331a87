"""Rows that repeat the one before in all six channels: more of them than coarse steps make by chance.

A coarse sensor repeats a value with a probability `p` of its own, each channel by itself: all six at once by the product. Of rows
of which a share `d` is written again, a channel repeats in ``m = d + (1 - d) p`` of them, and all at once in

    M = d + (1 - d) prod(p),    p = (m - d) / (1 - d)

``m`` and ``M`` are counted, `d` follows, for each thousand rows by themselves: a log is quiet in parts. Where all six hardly
change, as at rest with steps far larger than the noise, this says nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.state.limits import limit

Array = NDArray[np.float64]

FEWEST_RUNS, EVENLY = 200, 0.5  # runs of such rows, and of the variance that chance gives their lengths
BLOCK = 1000  # rows over which the chance of a repeat is counted
BY_CHANCE = 0.3  # of the rows, that chance may repeat where a share that is written again is looked for
QUARTER = 0.25  # of the blocks: in three of four there is as large a share
HALVINGS = 40  # of the interval in which it lies


class Repeats(NamedTuple):
    """Rows that repeat the one before in all channels: how many, and what share of the log where that is more than chance gives."""

    rows: int
    beyond: float


def repeats_of(same: NDArray[np.bool_]) -> Repeats:
    """What repeats, of whether each value of six channels (6, N) is equal to the one before."""
    count = int(np.count_nonzero(same.all(axis=0)))
    share, least = count / same.shape[1], float(same.mean(axis=1).min())
    chance = float(np.prod(chance_of_repeat(same)))
    # Samples that are held repeat in all channels at once; quiet ones of a coarse quantum repeat each by itself.
    held = share > limit("held rows") and (share > 0.98 * least or _evenly(same)) and chance < 0.9 * share
    if held or share > 3.0 / same.shape[1] + 5.0 * chance + limit("repeated rows"):
        return Repeats(count, share)
    again = float(np.quantile(_written_again(same), QUARTER)) if count and chance < BY_CHANCE else 0.0
    return Repeats(count, again if again > limit("rows written again") else 0.0)


def chance_of_repeat(same: NDArray[np.bool_]) -> Array:
    """(6,) probability that a value equals the one before: that of the steadiest tenth of the record.

    The steadiest, because a quantised sensor repeats most at rest, and a record may be at rest only in part.
    """
    return np.asarray(np.quantile(_in_blocks(same).mean(axis=2), 0.9, axis=1))


def _in_blocks(same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(6, B, rows)."""
    blocks = max(1, same.shape[1] // BLOCK)
    length = same.shape[1] // blocks
    return same[:, : blocks * length].reshape(6, blocks, length)


def _written_again(same: NDArray[np.bool_]) -> Array:
    """(B,) the share `d` of each block, by halving the interval in which it lies."""
    blocks = _in_blocks(same)
    one, all_six = blocks.mean(axis=2), blocks.all(axis=0).mean(axis=1)
    low, high = np.zeros(len(all_six)), np.minimum(one.min(axis=0), all_six)
    for _ in range(HALVINGS):
        d = 0.5 * (low + high)
        more = np.maximum(1.0 - d, 1e-12)
        too_small = d + more * np.prod((one - d) / more, axis=0) < all_six
        low, high = np.where(too_small, d, low), np.where(too_small, high, d)
    return low


def _evenly(same: NDArray[np.bool_]) -> bool:
    """Whether rows that repeat come in runs of one length: chance makes runs of all lengths, geometrically distributed."""
    repeats = same.all(axis=0)
    runs = np.diff(np.flatnonzero(~repeats)) - 1.0
    share = float(repeats.mean())
    return len(runs) > FEWEST_RUNS and float(np.var(runs)) < EVENLY * share / (1.0 - share) ** 2
