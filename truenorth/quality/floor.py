"""White noise of sensors that an engine shakes: the floor of the spectrum between the lines.

Sixth differences (:mod:`truenorth.quality.density`) see white noise under a smooth motion, but an engine's lines at 10 to 50 Hz are
louder than the noise there, and the channel looks white no more. A line is narrow: between the lines, above the sway, the mean
periodogram of many windows is that of the white noise, and its lower quartile over frequency is little less. What shakes in a broad
band raises it: the floor is an upper bound, within a fifth, of what is white.

Source: P. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio Electroacoust. 15
(1967); the window is F. Harris' of four terms (Proc. IEEE 66, 1978), whose side lobes lie 92 dB below a line.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.records import ImuRecord

Array = NDArray[np.float64]

WINDOW = 5.12  # s: its main lobe is .8 Hz wide to each side
SLOWEST = 2.0  # Hz: no base sways as fast, and what sways more slowly is four main lobes away
FASTEST = 0.5  # of the highest frequency: above it filters and the mean over a row take noise away
FEWEST = 12  # windows of which the mean is taken, and frequencies in the band
QUARTER = 0.25
HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)


def white_floor(record: ImuRecord, fastest: float = FASTEST) -> Array:
    """(6,) random walk of each channel, rad/sqrt(s) and m/s/sqrt(s), by the floor of its spectrum; NaN of too short a record.

    Parameters
    ----------
    record : ImuRecord
    fastest : float
        Of its highest frequency: where the band ends.
    """
    rows = round(WINDOW / record.interval)
    count = len(record) // rows
    if count < FEWEST or record.gaps.size:  # of rows that are nanoseconds apart a window would fill the memory
        return np.full(6, np.nan)
    frequency = np.arange(rows // 2 + 1) / (rows * record.interval)
    band = (frequency >= SLOWEST) & (frequency <= fastest * frequency[-1])
    if np.count_nonzero(band) < FEWEST:
        return np.full(6, np.nan)
    phase = 2.0 * math.pi * (np.arange(rows) + 0.5) / rows
    window = np.cos(np.outer(phase, np.arange(len(HARRIS)))) @ np.array(HARRIS)
    rates = np.hstack([record.gyro, record.accel]) / (record.interval if record.kind == "increments" else 1.0)
    power = np.zeros((np.count_nonzero(band), 6))
    for part in rates[: count * rows].reshape(count, rows, 6):
        power += np.abs(np.fft.rfft(part * window[:, None], axis=0)[band]) ** 2
    # Of white noise of density N a row has the variance N^2 / dt.
    density = np.sqrt(power * record.interval / (count * np.sum(np.square(window))))
    return np.asarray(np.quantile(density, QUARTER, axis=0))
