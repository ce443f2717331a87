"""The unit of gyros by the step of their numbers: a maker's full scale over 2^15 counts is a standard size in one unit only.

MEMS gyros count: 2000 deg/s over 32,768 counts, or the rounded sensitivity of a data sheet (16.4 counts, 70 mdps). A log that was
scaled and not smoothed holds multiples of that step, if in other digits, and the step is known to some millionths. Of steps of any
size, as calibration and other makers leave them, few are as near to a standard one as such a step is: how few is the evidence.

Decimals of a text are steps as well (0.01, 0.005); in no unit are they near to one of these.

Source: data sheets of InvenSense MPU-6050, ICM-20948, ITG-3200; Bosch BMI160, BMI270; ST L3GD20, LSM6DS3, LSM6DSO; NXP FXAS21002.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.formats.behaviour import DEG, Reading, size
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

# deg/s of one count, and how it is written
STANDARD = {
    **{range_ / 2.0**15: f"{range_} deg/s / 2^15" for range_ in (125, 250, 500, 1000, 2000, 4000)},
    **{range_ / 32000.0: f"{range_} deg/s / 32000" for range_ in (250, 500, 1000, 2000)},
    **{1.0 / counts: f"1 deg/s / {counts:g}" for counts in (262.0, 131.0, 65.5, 65.6, 32.8, 16.4, 14.375, 8.2)},
    **{mdps / 1000.0: f"{mdps:g} mdps" for mdps in (4.375, 8.75, 17.5, 35.0, 70.0, 140.0)},
}
ROWS = 20000  # that are looked at
FEWEST = 8  # levels
APART = 1e-7  # of the range: values that are closer are one, but for the last digits
NEAR = 0.2  # of a step, by which levels miss the multiples of it, at most
SCATTER = 0.05  # of a step, RMS: digits that were left out
SINGLE = 0.2  # of the levels that are one step from the next
FINE, COARSE = 1e-6, 5e-5  # relative: of a scale with all its digits, and of one that was rounded
FINELY = 0.6  # of the logs with such a step
SHARE = 0.3  # of all logs have one
DECADES = 3.0  # over which other steps lie


def by_step(readings: list[Reading], gyro: Array, kind: Kind) -> list[Reading]:
    """Units of gyros (N, 3), most likely first, weighed by the step of the numbers where they are rates."""
    step, unsure = step_of(gyro) if kind == "rates" else (0.0, 0.0)
    if not step or not readings:
        return readings
    weighed = []
    for reading in readings:
        ratio, name = likelihood(step * size(reading.unit) / DEG, unsure)
        why = f"{reading.why}; one step of the numbers is {name}" if name else reading.why
        weighed.append(replace(reading, probability=reading.probability * ratio, why=why))
    total = sum(reading.probability for reading in weighed)
    return sorted(
        (replace(reading, probability=reading.probability / total) for reading in weighed),
        key=lambda reading: -reading.probability,
    )


def likelihood(step: float, unsure: float) -> tuple[float, str]:
    """How much likelier a step, deg/s, of some relative sigma is with standard ones than without, and which of them it is."""
    away, standard = min((abs(step / size_ - 1.0), size_) for size_ in STANDARD)
    others = len(STANDARD) / (DECADES * np.log(10.0))  # standard steps in a unit of the logarithm
    fine, coarse = max(FINE, 3.0 * unsure), COARSE + 3.0 * unsure
    density = FINELY / (2.0 * fine) * (away < fine) + (1.0 - FINELY) / (2.0 * coarse) * (away < coarse)
    ratio = float(1.0 - SHARE + SHARE * density / others)
    return ratio, STANDARD[standard] if away < coarse else ""


def step_of(gyro: Array) -> tuple[float, float]:
    """The step of which the numbers of at least two of three columns (N, 3) are multiples, and its relative sigma; zero: none."""
    found = [step for column in gyro[:ROWS].T if (step := _step(column))[0]]
    if len(found) < 2:
        return 0.0, 0.0
    sizes, sigmas = map(np.array, zip(*found))
    middle = float(sizes[np.argmin(sigmas)])
    if np.any(np.abs(sizes / middle - 1.0) > COARSE + 3.0 * sigmas):
        return 0.0, 0.0
    return middle, float(sigmas.min())


def _step(values: Array) -> tuple[float, float]:
    """The step of one column, and its relative sigma: from neighbouring levels outwards, so that no multiple is mistaken."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    gaps = gaps[gaps > APART * np.ptp(levels)]
    if len(gaps) < FEWEST:
        return 0.0, 0.0
    step = float(np.min(gaps))
    if np.mean(gaps < (1.0 + NEAR) * step) < SINGLE:
        return 0.0, 0.0
    away = levels - float(np.median(values))
    reach, sigma = 8.0 * step, 0.0
    while True:
        near = away[np.abs(away) <= reach]
        if len(near) >= FEWEST:
            place = np.round((near - near[0]) / step)
            place, near = place - place.mean(), near - near.mean()
            step = float(place @ near / (place @ place))
            missed = near - place * step
            if not step > 0.0 or np.abs(missed).max() > NEAR * step:
                return 0.0, 0.0
            scatter = float(np.sqrt(np.mean(missed**2)))
            sigma = scatter / float(np.sqrt(place @ place)) / step
            if scatter > SCATTER * step:
                return 0.0, 0.0
        if reach > np.abs(away).max():
            return (step, sigma) if 3.0 * sigma < COARSE else (0.0, 0.0)
        reach *= 2.0
