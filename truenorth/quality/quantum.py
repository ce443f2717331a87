"""A quantum that is coarser than the noise: what rounding takes from the mean of a sensor that hardly moves.

Rounding a Gaussian variable of sigma s to steps of q leaves in its mean an error of ``(q / pi) exp(-2 pi^2 s^2 / q^2)`` times
the sine of where it stands between two steps; of a variable that does not move at all ``q / sqrt(12)``, one sigma. A sensor
that counts increments and carries the remainder on loses nothing: what it counts goes to and fro about a line, and sums of
many rows differ by less than those of as many independent ones.

Source: B. Widrow and I. Kollar, *Quantization Noise*, Cambridge 2008, ch. 4 (moments of a quantised Gaussian).
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import levels_of
from truenorth.core.earth import EARTH_RATE, GRAVITY_EQUATOR
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure

Array = NDArray[np.float64]

REPEATS = 0.3  # of the rows that repeat the one before: fewer do where the noise is as large as a step
NEAR = 3.0  # steps from the fullest level, from which on a value is no noise
LATTICE = 1e-3  # of a step, by which values may miss multiples of it
SAME = 1e-9  # of the range: values that are closer are one, but for the last digits
SUMS = (1, 2, 4, 8, 16, 32)  # rows that are summed up to see whether remainders are carried on
FEWEST = 50  # of such sums
SOME = 2000  # rows, of which the gaps between values are looked at first
QUIET = 0.98  # of the rows near the fullest level: where more are not, motion moves the channel over many steps
NEGLIGIBLE = 1e-3  # of a step
CARRIED = 0.6  # of what independent rows would scatter: sums that do less have their remainders carried on


def quantum_evidence(record: ImuRecord, lat: float) -> list[Evidence]:
    """Channels of a base at rest whose mean rounding has moved, and what that does to heading and level.

    Parameters
    ----------
    record : ImuRecord
    lat : float, rad
    """
    scale = 1.0 / record.interval if record.kind == "increments" else 1.0
    found = []
    for channel, name in enumerate(COLUMNS[record.kind]):
        sensor = record.gyro if channel < 3 else record.accel
        step, error = mean_error(sensor[:, channel % 3])
        if error == 0.0:
            continue
        size = error * scale
        effect = Effect(level=size / GRAVITY_EQUATOR)
        if channel < 3:
            effect = Effect(heading=size / max(EARTH_RATE * math.cos(lat), 1e-12))
        figures: dict[str, Figure] = {"name": name, "step": step, "heading": effect.heading, "level": effect.level}
        found.append(Evidence("record.coarse", figures, "known", effect, ("more_digits",)))
    return found


def mean_error(values: Array) -> tuple[float, float]:
    """The step of a channel's values (N,), and one sigma of the error that rounding leaves in their mean; zeros where none.

    How wide the noise is shows in how often it leaves the fullest level to either side; what lies far from it (a push, a spike)
    is none of it.
    """
    if np.count_nonzero(np.diff(values) == 0.0) < REPEATS * len(values):
        return 0.0, 0.0
    step, places = lattice(values)
    if step == 0.0:
        return 0.0, 0.0
    rest = np.clip(places, -NEAR, NEAR)
    if np.mean(np.abs(rest) < NEAR) < QUIET or _carries(rest):
        return step, 0.0
    error = rounded(float(np.mean(rest[np.abs(rest) < NEAR] < 0.0)), float(np.mean(rest[np.abs(rest) < NEAR] > 0.0)))
    return step, step * error if error > NEGLIGIBLE else 0.0


def lattice(values: Array) -> tuple[float, Array]:
    """The step of which a channel's values (N,) are multiples, and how many steps (N,) they are from the fullest level.

    Zero, and no values, where they are not.
    """
    step, fullest = _step_and_fullest(values)
    return step, np.round((values - fullest) / step) if step else np.zeros(0)


def lattice_step(values: Array) -> float:
    """The step of which a channel's values (N,) are multiples, zero where they are not."""
    return _step_and_fullest(values)[0]


def _step_and_fullest(values: Array) -> tuple[float, float]:
    levels, counts = levels_of(values)
    if len(levels) < 2:
        return 0.0, 0.0
    apart, fullest = np.diff(levels), float(levels[np.argmax(counts)])
    step = float(np.min(apart[apart > SAME * np.ptp(levels)]))
    off = (levels - fullest) / step
    place = np.round(off)
    if np.any(np.abs(off - place) > LATTICE * np.maximum(np.abs(place), 1.0)):
        return 0.0, 0.0
    return step, fullest


def largest_step(values: Array) -> float:
    """The largest step that a channel (N,) can have: no gap between values is less than one; those of some rows are looked at."""
    apart = np.diff(np.sort(values[:SOME]))
    return float(np.min(apart[apart > SAME * np.ptp(values)], initial=math.inf))


def _carries(counts: Array) -> bool:
    """Whether what a row leaves is counted in the next: then sums over more rows differ from their neighbours by hardly more.

    Neighbouring sums, because the motion of a base that is shaken is nearly the same in both.
    """
    scatter = []
    for rows in SUMS:
        sums = counts[: len(counts) // rows * rows].reshape(-1, rows).sum(axis=1)
        if len(sums) < FEWEST:
            break
        scatter.append(float(np.mean(np.diff(sums) ** 2)) / rows)
    return bool(min(scatter, default=0.0) < CARRIED * scatter[0]) if scatter and scatter[0] > 0.0 else False


def rounded(below: float, above: float) -> float:
    """One sigma of the error of the mean, in steps, of noise that leaves the fullest level downwards and upwards so often."""
    if (
        min(below, above) == 0.0
    ):  # two levels: how wide the noise is does not show, and a threshold is nearest where both are alike
        return (0.5 - max(below, above)) / math.sqrt(3.0)
    lower, upper = NormalDist().inv_cdf(below), NormalDist().inv_cdf(above)
    noise = -1.0 / (lower + upper)  # of thresholds one step apart
    return min(1.0 / math.sqrt(12.0), math.exp(-2.0 * (math.pi * noise) ** 2) / (math.pi * math.sqrt(2.0)))
