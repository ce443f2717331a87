"""Spectrum of the base's motion, from the newest minutes of a log."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.live.log import Log

SPAN = 120.0  # s
RATE = 4.0  # Hz, of the means whose spectrum is taken: sway lies below 1 Hz
POINTS = 120


def motion_spectrum(log: Log) -> dict[str, Any]:
    """Amplitude spectral density of the turning rate, all axes together.

    Returns
    -------
    dict
        ``frequency_hz`` and ``rate_deg_s_sqrt_hz``; empty lists for a log below 16 s. ``span_s``: of the rows.
    """
    rows = log.rows[np.searchsorted(log.rows[:, 0], log.end - SPAN) :]
    empty: dict[str, Any] = {"frequency_hz": [], "rate_deg_s_sqrt_hz": [], "span_s": 0.0}
    if len(rows) < 3 or rows[-1, 0] - rows[0, 0] < 16.0:
        return empty
    interval = float(np.median(np.diff(rows[:, 0])))
    width = max(1, round(1.0 / (RATE * interval)))
    rates = rows[:, 1:4] / (1.0 if log.kind == "rates" else interval)
    means = _means(rates, width)
    step = width * interval
    window = np.hanning(len(means))[:, None]
    spectrum = np.abs(np.fft.rfft((means - means.mean(axis=0)) * window, axis=0)) ** 2
    density = 2.0 * step * spectrum.sum(axis=1) / np.sum(window**2)
    frequency = np.fft.rfftfreq(len(means), step)
    keep = np.unique(np.linspace(1, len(frequency) - 1, POINTS).astype(int))
    return {
        "frequency_hz": frequency[keep].tolist(),
        "rate_deg_s_sqrt_hz": np.degrees(np.sqrt(density[keep])).tolist(),
        "span_s": float(rows[-1, 0] - rows[0, 0]),
    }


def _means(values: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    whole = len(values) // width * width
    return values[len(values) - whole :].reshape(-1, width, values.shape[1]).mean(axis=1)
