"""The resolution of an encoder: the step of which its angles are whole numbers.

An axis that rests stands somewhere within a step, and each of its rows says the same: rounding is no noise there, and no mean takes
it away. Its one-sigma is a step by the root of twelve, another one in each position.

The angles of an axis that turns are anywhere. Gaps between them, in order of size, that are all whole numbers of one step are none
by chance: a gap is so to a tenth of a step once in five.

An axis that turns evenly is not anywhere, and has such gaps as well, without steps: its angles go on as the gyros do. Steps are
noise of their size in the rows of an axis that turns, but of one that turns by nearly a whole number of them from row to row. Then
whole numbers of the smallest gap, to the last digits, by some of which the axis goes on in a row, show them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.quantum import SAME

Array = NDArray[np.float64]

CHANCE = 1e-6  # of angles that are anywhere
NEARLY = 0.1  # of a step, by which a gap may miss a whole number of them: few digits are written
EXACTLY = 1e-5  # the same, to the last digits
PARTS = range(1, 51)  # of the smallest gap, that may be a step
NEAR = 10  # rows in which an axis that turns goes on by a step
SHOWN = 0.2  # of the noise of rounding, which is less where an axis turns by nearly a whole number of steps a row
ORDERS = range(2, 9)  # of differences, which leave noise of what is smooth
ROUNDED = 1.0 / math.sqrt(12.0)  # one sigma of an error that is anywhere in a step


def resolution(angles: Array, turned: Array) -> Array:
    """(A,) steps of an encoder's angles, rad; zero where they show none.

    Parameters
    ----------
    angles : (N, A) array, rad
        Turns counted.
    turned : (N, A) array, rad
        By which they turn more than the gyros about each axis.
    """
    return np.array([_step(*column) for column in zip(angles.T, turned.T, strict=True)])


def _step(angle: Array, turned: Array) -> float:
    gaps = np.diff(np.unique(angle))
    gaps = np.sort(gaps[gaps > SAME * float(np.ptp(angle))])
    if not gaps.size or len(angle) <= NEAR + max(ORDERS):
        return 0.0
    step, exactly = _whole(gaps)
    if not step:
        return 0.0
    goes = np.abs(np.diff(angle))
    many = exactly and float(np.median(goes[goes > 0.5 * step])) > 1.5 * step
    return step if many or _scatter(angle, turned, step) > SHOWN * ROUNDED * step else 0.0


def _whole(gaps: Array) -> tuple[float, bool]:
    """The largest step of which all gaps are whole numbers, zero if they may be so by chance; whether to the last digits."""
    different = gaps[np.diff(gaps, prepend=0.0) > EXACTLY * gaps[0]]
    for part in PARTS:
        step, total, steps, most = float(gaps[0]) / part, 0.0, 0, 0.0
        for gap in different.tolist():
            count = round(gap / step)
            most = max(most, abs(gap / step - count))
            if most > NEARLY:
                break
            total, steps = total + gap, steps + count
            step = total / steps
        else:
            by_chance = math.log(part) + (gaps.size - 1) * math.log(2.0 * NEARLY)
            if by_chance < math.log(CHANCE):
                return step, part == 1 and most < EXACTLY
    return 0.0, False


def _scatter(angle: Array, turned: Array, step: float) -> float:
    """White noise in the rows in which an axis turns, by the differences that leave the least; none where it turns in few."""
    turns = np.abs(angle[NEAR:] - angle[:-NEAR]) > 0.5 * step
    found = []
    for order in ORDERS:
        inside = np.convolve(turns, np.ones(order + 1), "valid") == order + 1.0
        if np.count_nonzero(inside) > order:
            left = np.diff(turned, order)[: len(inside)][inside]
            found.append(math.sqrt(float(np.mean(left**2)) / math.comb(2 * order, order)))
    return min(found, default=0.0)
