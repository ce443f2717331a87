"""Stretches of a log whose rows come at a steady pace: a device or a logger may change its rate while it runs.

Medians of the steps over blocks of `BLOCK` rows show the pace: a lost row or a late stamp does not move them. A stretch is a run of
blocks of one pace. Where a run is short, or where its mean step is not its median, the stamps have no pace at all, such as those of
a computer that reads in bunches: such a log is one stretch.

The rule is ours.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 25  # steps, an odd number: the median is one of them
FEWEST = 4  # blocks of a stretch
ALIKE = 1.2  # ratio of paces that are one, with the scatter of stamps
EVEN = 1.1  # mean over median step, from which there is no pace


class Stretch(NamedTuple):
    """Rows of one pace.

    Attributes
    ----------
    first : int
        Its first row.
    pace : float
        From row to row, in the unit of the stamps.
    """

    first: int
    pace: float


def stretches(time: Array) -> tuple[Stretch, ...]:
    """The stretches of a log, one where its pace does not change.

    Parameters
    ----------
    time : (N,) array
        Stamps of the rows, in any unit.

    Returns
    -------
    tuple of Stretch
        The first begins with row 0. Of two neighbours, each has a pace of its own.
    """
    steps = np.diff(time)
    count = len(steps) // BLOCK
    if count < 2 * FEWEST:
        return (Stretch(0, float(np.median(steps))),)
    medians = np.median(steps[: count * BLOCK].reshape(count, BLOCK), axis=1)
    whole = Stretch(0, float(np.median(medians)))
    if medians.min() <= 0.0 or medians.max() < ALIKE * medians.min():
        return (whole,)
    starts = np.append(np.flatnonzero(_other(medians[1:], medians[:-1])) + 1, count)
    starts = np.concatenate([[0], starts])
    if np.diff(starts).min() < FEWEST:
        return (whole,)
    paces = [float(np.median(medians[a:b])) for a, b in pairwise(starts)]
    firsts = [0]
    for block, before, behind in zip(starts[1:-1], paces[:-1], paces[1:], strict=True):
        firsts.append(_change(steps, int(block) * BLOCK, before, behind))
    found = []
    for first, end, pace in zip(firsts, [*firsts[1:], len(time)], paces, strict=True):
        of_rows = steps[first : end - 1]
        if np.mean(of_rows) > EVEN * pace or np.any(_other(medians[first // BLOCK + 1 : end // BLOCK - 1], pace)):
            return (whole,)
        found.append(Stretch(first, float(np.mean(of_rows[of_rows < 1.5 * pace]))))
    means = np.array([stretch.pace for stretch in found])
    # Stamps of fewer digits from some time on have another median step, and the same mean.
    return tuple(found) if np.all(_other(means[1:], means[:-1])) else (whole,)


def _other(pace: Array, than: Array | float) -> NDArray[np.bool_]:
    """Whether paces are not alike."""
    return np.asarray(np.abs(np.log(pace / than)) > math.log(ALIKE))


def _change(steps: Array, about: int, before: float, behind: float) -> int:
    """The first row of the later of two paces: fewest steps are on the wrong side of it."""
    near = slice(max(about - BLOCK, 0), min(about + 2 * BLOCK, len(steps)))
    later = (steps[near] > math.sqrt(before * behind)) == (behind > before)
    wrong = np.concatenate([[0], np.cumsum(later)]) + np.concatenate([np.cumsum(~later[::-1])[::-1], [0]])
    return near.start + int(np.argmin(wrong)) + 1
