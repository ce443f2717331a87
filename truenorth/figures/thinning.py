"""Long traces thinned to what the eye can tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

POINTS = 4000  # that a long trace is thinned to; more than any screen shows


def thin(time: ArrayLike, values: ArrayLike, points: int = POINTS) -> NDArray[np.intp]:
    """Rows (M,) of a trace (N,) to draw, M <= about `points`.

    Of each of ``points / 2`` equal stretches the least and the greatest value are kept, and both ends of the trace: no peak is
    lost. A NaN stays, so that a gap is drawn as one.

    Parameters
    ----------
    time, values : (N,) arrays
        `time` gives the length only.
    """
    v = np.asarray(values, dtype=np.float64)
    if v.size <= points:
        return np.arange(v.size)
    stretches = max(1, points // 2 - 1)
    width = -(-v.size // stretches)
    rows = np.arange(stretches * width).reshape(stretches, width)
    rows = rows[rows[:, 0] < v.size]
    inside = np.minimum(rows, v.size - 1)
    there = v[inside]
    missing = np.isnan(there)
    first = np.arange(len(inside))
    low = inside[first, np.argmin(np.where(missing, np.inf, there), axis=1)]
    high = inside[first, np.argmax(np.where(missing, -np.inf, there), axis=1)]
    holed = missing.any(axis=1)
    gap = inside[holed, np.argmax(missing[holed], axis=1)]
    return np.unique(np.concatenate([[0], low, high, gap, [v.size - 1]]))


def evenly(count: int, points: int = POINTS) -> NDArray[np.intp]:
    """Rows evenly spread over `count`, both ends included."""
    return np.unique(np.linspace(0, count - 1, min(count, points)).astype(np.intp))
