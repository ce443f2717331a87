"""An encoder that slips: from one row to the next an angle jumps, and the gyros of the IMU on the axis see no turn.

What the encoder turns more than the gyros about its axes is the turn of the base, which is smooth: differences of a high order
leave noise of it. A jump stands out there by its own pattern. Where the axis starts or stops, an encoder that is a little late
makes one as well, and takes it back later.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.encoder import USUAL_ZERO
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ORDERS = range(2, 9)  # of differences: each leaves less of the base's motion, and more noise
LEAST = 4  # a cubic goes on across the rows of a jump
FEWEST = 50  # rows that show what their noise is
GAP = 1.5  # steps of its rows
BRIDGED = 0.2  # s: in less a base that sways goes on as it did
TURNS = 0.05  # of its largest rate: an axis that turns counts the steps of its resolution, one at rest none
LONGEST = 4  # times the rows that a step is fitted to: what lasts for longer is no jump
LATE = 0.05  # s: an encoder that is late by less looks so where its axis starts or stops
NEAR = 10  # rows about a jump in which that may be
ONE_COUNT = 1.2  # steps of a resolution, as a fit to noisy rows may read one
SELDOM = 0.02  # of the rows: what is more frequent is noise
BEYOND = 2.326  # sigmas, that a normal variable exceeds as seldom


def jump_evidence(time: Array, by_gyros: Array, turned: Array, steps: Array | None = None) -> list[Evidence]:
    """Jumps of an encoder's angles.

    Parameters
    ----------
    time : (N,) array, s
        Of the encoder's rows.
    by_gyros, turned : (N, A) arrays, rad
        By which the gyros turn about each axis, and its angle more than these.
    steps : (A,) array, rad, optional
        Of its resolution. As an axis begins to turn, or goes on by a step in some rows, a count of one is no slip: a part of it is
        in sigma.
    """
    if len(time) < FEWEST:
        return []
    step = float(np.median(np.diff(time)))
    cuts = [0, *(np.flatnonzero(np.diff(time) > max(BRIDGED, GAP * step)) + 1), len(time)]
    found = []
    for part in (slice(a, b) for a, b in pairwise(cuts) if b - a >= FEWEST):  # across a gap the base goes on unseen
        even, own = _evenly(time[part], by_gyros[part], step)
        _, more = _evenly(time[part], turned[part], step)
        for axis in range(turned.shape[1]):
            rate = np.diff(own[:, axis], append=own[-1, axis]) / step
            for row, size in _jumps(more[:, axis], np.abs(rate) > TURNS * float(np.max(np.abs(rate)))):
                near = rate[max(row - NEAR, 0) : row + NEAR]
                if abs(size) < max(
                    LATE * float(np.ptp(near)), 0.0 if steps is None else ONE_COUNT * float(steps[axis])
                ):
                    continue
                figures: dict[str, Figure] = {"axis": str(axis + 1), "size": size, "time": float(even[row])}
                kind: Kind = "bounded" if abs(size) > USUAL_ZERO else "known"
                found.append(Evidence("encoder.jumps", figures, kind, Effect(abs(size), abs(size)), ("encoder",)))
    return found


def _evenly(time: Array, x: Array, step: float) -> tuple[Array, Array]:
    """Times a step apart and the columns of `x` there: rows that were lost by a spline through those about them."""
    if float(np.max(np.diff(time))) <= GAP * step:
        return time, x
    from scipy.interpolate import CubicSpline

    even = np.arange(time[0], time[-1] + 0.5 * step, step)
    return even, np.asarray(CubicSpline(time, x)(np.minimum(even, time[-1])))


def _jumps(x: Array, turns: Mask) -> list[tuple[int, float]]:
    """Rows from which on an angle is another, and by how much, rad: what comes back within some rows is left out.

    `turns`: (N,) whether the axis turns there. Rows in which it does, and those in which it rests, have noise of their own.
    """
    order = min(ORDERS, key=lambda n: _scale(_steps(x, n)))
    size = _steps(x, order)
    sigma = np.full(len(x), _scale(size))
    sigma[turns] = max(sigma[0], _scale(size[turns]) if turns.any() else 0.0)
    rows = np.flatnonzero((np.abs(size) > limit("jump of an encoder") * sigma) & (sigma > 0.0))
    if not rows.size:
        return []
    cuts = [0, *(np.flatnonzero(np.diff(rows) > order) + 1), rows.size]
    found = []
    for part in (rows[a:b] for a, b in pairwise(cuts)):
        net, its_sigma = _stays(x, int(part[0]), int(part[-1]), order)
        if abs(net) > limit("jump of an encoder") * max(float(sigma[part].max()), its_sigma):
            found.append((int(part[np.argmax(np.abs(size[part]))]), net))
    return found


def _stays(x: Array, first: int, last: int, order: int) -> tuple[float, float]:
    """By how much `x` has jumped from before a row to behind another, and its sigma: a step of a polynomial on both sides."""
    order = max(order, LEAST)
    side = order + 2
    if last - first > LONGEST * side:
        return 0.0, math.inf
    rows = np.r_[max(first - side, 0) : first, last : min(last + side, len(x))]
    behind = rows >= last
    if behind.all() or not behind.any():
        return 0.0, math.inf
    where = (rows - rows[0]) / (rows[-1] - rows[0]) * 2.0 - 1.0
    A = np.column_stack([behind, np.polynomial.legendre.legvander(where, order - 1)])
    fitted, *_ = np.linalg.lstsq(A, x[rows])
    left = float(np.sum((x[rows] - A @ fitted) ** 2)) / max(len(rows) - A.shape[1], 1)
    return float(fitted[0]), math.sqrt(left * float(np.linalg.inv(A.T @ A)[0, 0]))


def _steps(x: Array, order: int) -> Array:
    """(N,) by how much `x` jumps at each row, by least squares on its differences of an order; zero near its ends."""
    pattern = np.array([(-1.0) ** i * math.comb(order - 1, i) for i in range(order)])
    fitted = np.convolve(np.diff(x, order), pattern[::-1], "valid") / float(pattern @ pattern)
    size = np.zeros(len(x))
    size[order : order + len(fitted)] = fitted
    return size


def _scale(size: Array) -> float:
    """One sigma of normal noise, by the size that one row in fifty exceeds: steps of a coarse resolution count, a jump does not."""
    return float(np.quantile(np.abs(size), 1.0 - SELDOM)) / BEYOND
