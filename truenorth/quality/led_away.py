"""Whether a receiver is led away: a spoofer that moves position and velocity alike, which nothing but the INS contradicts.

Its velocity steps as it begins. The filter follows within some rows, and innovations keep ``s e^{-k / m}`` of the step, ``k`` rows
after the first. The likelihood ratio of a step at each row, for fast and for slow filters, is ``|T|^2 / W`` with
``T = sum e^{-k/m} z_k`` and ``W = sum e^{-2k/m}`` over the normalised innovations ``z``: a chi-square of two degrees of freedom
where nothing steps, of which ``2 ln(N / p)`` is exceeded by one of N with probability p at most. Of a receiver that
is off in every turn many ratios are large, and a step counts by how far it stands out.

The exponential is an approximation: where it leaves a ratio below chance that few sound logs have, the filter itself says how it
would follow a step from there (`truenorth/estimate/led_by.py`).

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); the memory of the filter by a few exponentials is ours.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.quality.whiteness import FEWEST, whiteness
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

if TYPE_CHECKING:
    from truenorth.state.track import Residuals

Array = NDArray[np.float64]

LED = ("GNSS velocity",)
MEMORIES = (3.0, 10.0, 30.0)  # rows, within which filters follow a step

BEGINS = 10  # rows, of which a step is the filter's own start
MOST_LOOKS = 4
# Parts of the rows: what ratios and squares there are larger than of white innovations, any step's is.
USUAL, LARGE = 0.9, 0.975


def led_away_evidence(source: Residuals) -> list[Evidence]:
    """The step of a receiver's level velocity that is likelier than chance, and where it has led the answer by the end."""
    found = _screened(source)
    if found is None:
        return []
    z, time, sigma = found
    chance = 2.0 * math.log(len(MEMORIES) * len(z) / limit("step"))
    ratio, row, step = max((_largest_step(z, memory) for memory in MEMORIES), key=lambda found: found[0])
    if ratio <= chance:
        return []
    return [led_by(source.name, step * sigma[row], float(time[row]), float(time[-1]), ratio, chance)]


def led_by(name: str, step: Array, onset: float, end: float, ratio: float, chance: float) -> Evidence:
    """What a step of velocity (2,) from a moment on does to the answer at the end."""
    size = float(np.linalg.norm(step))
    away = size * (end - onset)
    figures: dict[str, Figure] = {
        "name": name,
        "size": size,
        "onset": onset,
        "ratio": ratio,
        "chance": chance,
        "distance": away,
    }
    return Evidence("innovations.step", figures, "bounded", Effect(velocity=size, position=away), ("source",))


def doubtful_onsets(source: Residuals) -> list[float]:
    """Times (s) from which a step is likelier than in most sound logs, the likeliest first."""
    found = _screened(source)
    if found is None:
        return []
    z, time, _ = found
    ratio = np.max([_ratios(z, math.exp(-1.0 / memory))[0] for memory in MEMORIES], axis=0)
    ratio[:BEGINS] = 0.0
    onsets: list[float] = []
    while len(onsets) < MOST_LOOKS and ratio.max() > 2.0 * math.log(len(MEMORIES) * len(z) / limit("another look")):
        row = int(np.argmax(ratio))
        onsets.append(float(time[row]))
        ratio[max(row - 1, 0) : row + 2] = 0.0
    return onsets


def _screened(source: Residuals) -> tuple[Array, Array, Array] | None:
    """Normalised innovations of level velocity (K, 2), their times and sigmas; None where there is nothing to look at."""
    if source.name not in LED:
        return None
    rows = (source.rows > 0) & np.isfinite(source.innovation[:, :2]).all(axis=1)
    sigma = source.sigma[rows, :2]
    z = no_outlier(source.innovation[rows, :2] / sigma)
    return None if z.size < FEWEST else (z, source.time[rows], sigma)


def no_outlier(z: Array) -> Array:
    """Normalised innovations (K, m), none of them larger than an outlier counts.

    The gate may have taken the first rows of a step for outliers, and one outlier is no step.
    """
    return z / np.maximum(1.0, np.linalg.norm(z, axis=1, keepdims=True) / limit("counts at most"))


def _largest_step(z: Array, memory: float) -> tuple[float, int, Array]:
    """Likelihood ratio, row, and size in sigmas (2,) of the likeliest step that a filter of this memory follows.

    The ratio counts as far as what the step leaves is white, and no larger than it should be.
    """
    keep = math.exp(-1.0 / memory)
    ratio, steps = _ratios(z, keep)
    row = BEGINS + int(np.argmax(ratio[BEGINS:]))
    left = z.copy()
    left[row:] -= np.outer(keep ** np.arange(len(z) - row), steps[row])
    over = max(larger_than_chance(_ratios(left, keep)[0], USUAL), larger_than_chance(np.sum(left**2, axis=1), LARGE))
    return float(ratio[row]) / (max(1.0, over) * whiteness(left).growth ** 2), row, steps[row]


def _ratios(z: Array, keep: float) -> tuple[Array, Array]:
    """Of a step at each row: its likelihood ratio (K,) and its size (K, 2)."""
    T, W = np.empty((len(z), 2)), np.empty(len(z))
    _sum_up(np.ascontiguousarray(z), keep, T, W)
    return np.sum(T**2, axis=1) / W, T / W[:, None]


def larger_than_chance(squares: Array, part: float) -> float:
    """By how much a quantile of squares is larger than that of a chi-square of two degrees of freedom."""
    return float(np.quantile(squares, part)) / (-2.0 * math.log(1.0 - part))


@compiled
def _sum_up(z: Any, keep: Any, T: Any, W: Any) -> None:
    """``T`` (K, 2) and ``W`` (K,) from each row to the last."""
    east, north, weight = 0.0, 0.0, 0.0
    for k in range(len(z) - 1, -1, -1):
        east, north = z[k, 0] + keep * east, z[k, 1] + keep * north
        weight = 1.0 + keep * keep * weight
        T[k, 0], T[k, 1], W[k] = east, north, weight
