"""How much more a sum of innovations scatters than a filter says, where they are not white.

A test of innovations ``nu`` (white, of one unit, if the filter is right) against a signature ``y`` looks at ``m = sum y nu``. Of
white ones ``m`` has the variance ``sum y^2``. Of innovations with the density ``S(f)``, which is 1 where the filter is right,

    var m = sum_f Y(f)' S(f) Y(f)

of the transform Y of the signature: of a slow one, ``S(0)`` times as much. A filter whose model of a sea holds two oscillators
leaves the rest of the waves in its innovations, and one that takes the motion of its base for white leaves all of them.

The density is read from what is left of the innovations when the signature is taken off: else a fault would hide itself. Cosines
are the eigenvectors of a stationary process, if it is long: their coefficients are independent, and averaged over K neighbours
they are chi-square variables of K degrees of freedom. ``s = var m / sum y^2`` is a sum of such ones, with the freedom that
Satterthwaite gives, and ``m`` over its estimated sigma is a Student's t. Innovations that may be white are taken for white: the
filter knows more than they.

Sources: E. Lazarus, D. Lewis, J. Stock, M. Watson, HAR inference: recommendations for practice, J. Business & Economic
Statistics 36, 2018 (cosines of equal weight, and how many); F. Satterthwaite, An approximate distribution of estimates of variance
components, Biometrics Bulletin 2, 1946.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.chi_square import chi_square_limit
from truenorth.analysis.student import as_normal

Array = NDArray[np.float64]

NEIGHBOURS = 0.4  # times N^(2/3): coefficients over which the density is averaged
CHANCE = 0.05  # that white innovations are taken for coloured


class Colour(NamedTuple):
    """Of innovations, as a signature sees it.

    Attributes
    ----------
    growth : float
        Variance of the match over what white innovations give; 1 of those that may be white.
    dof : float
        Degrees of freedom with which that is known; infinite of those that may be white.
    """

    growth: float
    dof: float

    def ratio(self, ratio: float) -> float:
        """The chi-square of one degree of freedom that is as rare as a match whose square is `ratio` in white innovations."""
        t = math.sqrt(ratio / self.growth)
        return min(as_normal(t, self.dof) ** 2, t * t)  # of the first nothing is left where it is too rare for a number


def colour_of(left: Array, signature: Array) -> Colour:
    """The colour of innovations as a signature sees it.

    Parameters
    ----------
    left : (K, m) array
        Innovations of one unit, the signature taken off.
    signature : (K, m) array
        What it makes of them, of any size.
    """
    X, Y = cosines(left), cosines(signature)
    weight = averaged(Y[:, :, None] * Y[:, None, :])
    weight /= np.einsum("kaa->", weight)
    growth = float(np.einsum("ka,kab,kb->", X, weight, X))
    dof = 1.0 / float(np.sum(weight**2))
    coloured = growth > chi_square_limit(CHANCE, round(dof)) / round(dof)
    return Colour(growth, dof) if coloured else Colour(1.0, math.inf)


def cosines(x: Array) -> Array:
    """(K, m) coefficients of series (K, m) by orthonormal cosines (the discrete cosine transform II)."""
    count = len(x)
    there_and_back = np.fft.rfft(np.concatenate([x, x[::-1]]), axis=0)[:count]
    half = np.exp(-0.5j * np.pi * np.arange(count) / count)
    found = (there_and_back * half[:, None]).real / math.sqrt(2.0 * count)
    found[0] *= math.sqrt(0.5)
    return np.asarray(found)


def averaged(x: Array) -> Array:
    """Means (K, ...) over neighbours; beyond both ends coefficients of cosines stand mirrored."""
    count = len(x)
    side = min(max(1, round(NEIGHBOURS * count ** (2.0 / 3.0))), (count - 1) // 2)
    mirrored = np.concatenate([x[side:0:-1], x, x[-2 : -side - 2 : -1]])
    sums = np.cumsum(np.concatenate([np.zeros_like(x[:1]), mirrored]), axis=0)
    return np.asarray((sums[2 * side + 1 :] - sums[: -2 * side - 1]) / (2 * side + 1))
