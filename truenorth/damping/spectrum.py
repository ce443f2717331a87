"""Lines of an INS's oscillations in its errors: Schuler's pair, split by Foucault, and the 24 h line.

East and north velocity error taken as one complex number ``dv_E + i dv_N`` turn with ``exp(i (w_s - W) t)`` and
``exp(-i (w_s + W) t)``, ``W = w_ie sin L``: of the two lines one stands at positive and one at negative frequency, and a
window's side lobes do not mix them. Two days hold two cycles of the 24 h line: it is found by fitting a sinusoid.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError

Array = NDArray[np.float64]

PADDING = 8  # of the transform, so that a peak's place is finer than a bin
SCHULER_BAND = (60.0 * 60.0, 120.0 * 60.0)  # s
EARTH_BAND = (18.0 * 3600.0, 30.0 * 3600.0)  # s
LEAST_CYCLES = 1.5  # of a line that can be separated from a trend


class Spectrum(NamedTuple):
    """Amplitude over frequency.

    Attributes
    ----------
    frequency : (F,) array, Hz
        Positive and negative where the signal is complex.
    amplitude : (F,) array
        Of a sinusoid that stands there.
    """

    frequency: Array
    amplitude: Array


def spectrum(values: Array | NDArray[np.complex128], interval: float) -> Spectrum:
    """Amplitude spectrum of evenly spaced values (K,), their mean and trend taken off, Hann window.

    A value that is absent (NaN) is bridged by a straight line.
    """
    x = np.asarray(values)
    k = np.arange(len(x))
    there = np.isfinite(x)
    if there.sum() < 8:
        raise UsageError(f"a spectrum of {int(there.sum())} values; expected eight at least")
    x = np.interp(k, k[there], x[there].real) + 1j * np.interp(k, k[there], x[there].imag)
    trend = np.stack([np.ones(len(x)), k / len(x)], axis=1)
    x = x - trend @ np.linalg.lstsq(trend, x, rcond=None)[0]
    window = np.hanning(len(x))
    count = PADDING * len(x)
    whole = np.fft.fftshift(np.fft.fft(x * window, count)) / window.sum()
    frequency = np.fft.fftshift(np.fft.fftfreq(count, interval))
    if np.iscomplexobj(values):
        return Spectrum(frequency, np.abs(whole))
    half = frequency >= 0.0
    return Spectrum(frequency[half], 2.0 * np.abs(whole[half]))


def schuler_lines(dv: Array, interval: float) -> tuple[float, float]:
    """Periods (s) of the two strongest Schuler lines of a velocity error east, north (K, 2), the faster first.

    NaN where the record is too short for one.
    """
    if len(dv) * interval < LEAST_CYCLES * SCHULER_BAND[1]:
        return np.nan, np.nan
    found = spectrum(dv[:, 0] + 1j * dv[:, 1], interval)
    periods = []
    for sign in (1.0, -1.0):
        f = sign * found.frequency
        band = np.flatnonzero((f > 1.0 / SCHULER_BAND[1]) & (f < 1.0 / SCHULER_BAND[0]))
        periods.append(1.0 / f[band[np.argmax(found.amplitude[band])]])
    first, second = sorted(periods)
    return float(first), float(second)


def earth_line(values: Array, interval: float) -> tuple[float, float]:
    """Period (s) and amplitude of the sinusoid near 24 h that, with a constant and a trend, fits values (K,) best.

    NaN where the record holds less than one cycle and a half.
    """
    stride = max(1, int(300.0 / interval))
    x = np.asarray(values)[::stride]
    t = interval * stride * np.arange(len(x))
    t, x = t[np.isfinite(x)], x[np.isfinite(x)]
    if len(x) < 8 or t[-1] - t[0] < LEAST_CYCLES * 86164.0:
        return np.nan, np.nan
    periods = np.linspace(*EARTH_BAND, 241)
    best = (np.inf, np.nan, np.nan)
    for period in periods:
        w = 2.0 * np.pi / period
        A = np.stack([np.ones_like(t), t / t[-1], np.cos(w * t), np.sin(w * t)], axis=1)
        parameters, *_ = np.linalg.lstsq(A, x, rcond=None)
        left = float(np.sum((x - A @ parameters) ** 2))
        if left < best[0]:
            best = (left, float(period), float(np.hypot(*parameters[2:])))
    return best[1], best[2]
