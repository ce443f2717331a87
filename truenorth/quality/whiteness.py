"""Whether innovations are as large as sigma says, and white.

Where the model is right, innovations are white and as large as their sigma. Where they are ``f`` times as large, so are the
errors. Where they are correlated over many rows, of correlations ``r_1, r_2, ...``, so many rows carry the information of fewer,
and a mean of them errs by ``g = sqrt(1 + 2 sum r_k)`` times as much as it says. Both together are by how much sigma must grow:
that of velocity and position. Attitude shows in changes of velocity over a manoeuvre, of a period ``T``, and what is slower
cancels: there ``g = sqrt(1 + 2 sum r_k cos(2 pi t_k / T))``, the density of the innovations at that period.

Source: R. Mehra, "On the identification of variances and adaptive Kalman filtering", IEEE Trans. Autom. Control 15 (1970); the
sum ends at the first correlation that chance explains, as in C. Geyer, "Practical Markov chain Monte Carlo" (1992).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.chi_square import chi_square_limit
from truenorth.state.limits import limit

Array = NDArray[np.float64]

FEWEST = 60  # components, from which size and colour are judged
LAGS, MOST_LAGS = 5, 60
FEWEST_BLOCKS = 12  # whose means are compared
MANOEUVRE = 20.0  # s, the period of turns and changes of speed
CHANCE = math.erfc(limit("chance") / math.sqrt(2.0))


class Whiteness(NamedTuple):
    """Size and colour of normalised innovations."""

    size: float  # RMS; 1 where sigma is right
    colour: float  # ``sqrt(1 + 2 sum r_k)``; 1 where they are white
    turning: float  # the same at the period of manoeuvres
    sure: bool  # whether chance does not explain it

    @property
    def growth(self) -> float:
        """By how much the sigma of velocity and position must grow."""
        return max(1.0, self.size * self.colour) if self.sure else 1.0

    @property
    def of_attitude(self) -> float:
        """By how much the sigma of heading and level must grow."""
        return max(1.0, self.size * self.turning) if self.sure else 1.0


def whiteness(normalised: Array, interval: float = 1.0) -> Whiteness:
    """Size and colour of innovations (M, m), each divided by its sigma, so many seconds apart."""
    e = normalised
    count = e.size
    if count < FEWEST or len(e) < 4 * LAGS:
        return Whiteness(1.0, 1.0, 1.0, False)
    total = float(np.sum(e**2))
    most = min(len(e) // 4, MOST_LAGS)
    few = 2.0 / math.sqrt(count)
    found: list[float] = []
    for k in range(1, most + 1):  # as far as the first that chance explains
        found.append(np.sum(e[k:] * e[:-k]) / max(total, 1e-300))
        if k >= LAGS and min(found) < few:
            break
    r = np.array(found)
    chance = r < few
    last = int(np.argmax(chance)) if chance.any() else most
    colour = math.sqrt(1.0 + 2.0 * float(r[:last].sum()))
    turns = np.cos(2.0 * np.pi * interval * np.arange(1, last + 1) / MANOEUVRE)
    turning = math.sqrt(max(1.0 + 2.0 * float(r[:last] @ turns), 0.0))
    scatter = scatter_of_means(e)
    colour = max(colour, scatter)
    size = math.sqrt(total / count)
    spread = math.sqrt(2.0 * (1.0 + 2.0 * float(np.sum(r[:last] ** 2))) / count)
    mean = float(r[:LAGS].mean())
    coloured = mean > max(limit("colour"), limit("chance") / math.sqrt(LAGS * count)) or scatter > 1.0
    return Whiteness(size, colour, turning, coloured or size**2 - 1.0 > limit("chance") * spread)


def scatter_of_means(e: Array) -> float:
    """By how much means over blocks of innovations (M, m) scatter more than of white ones, at the length where most; 1 by chance.

    Correlations that are too small to be seen at any one lag are seen in their sum: a slow error of a tenth of the noise's power
    makes means over a hundred rows err three times as much.
    """
    power, most = float(np.mean(e**2)), 1.0
    lengths = [4 * 2**k for k in range(len(e).bit_length()) if len(e) >= FEWEST_BLOCKS * 4 * 2**k]
    for length in lengths if power > 0.0 else ():
        means = e[: len(e) // length * length].reshape(-1, length, e.shape[1]).mean(axis=1)
        larger = length * float(np.mean(means**2)) / power
        if larger > chi_square_limit(CHANCE / len(lengths), means.size) / means.size:
            most = max(most, larger)
    return math.sqrt(most)
