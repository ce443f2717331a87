"""Vibration of the mount: an engine's sinusoids and random vibration from a power spectral density."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.simulation.tones import Tone

COMPONENTS = 64


def sine_vibration(acceleration: float, frequency: float, phase: float = 0.0) -> Tone:
    """Displacement of a sinusoidal acceleration of given peak (m/s^2) and frequency (Hz), its phase in rad.

    Raises
    ------
    UsageError
        A frequency that is not positive.
    """
    if not frequency > 0:
        raise UsageError(f"vibration at {frequency:g} Hz; expected a positive frequency")
    return Tone(-acceleration / (2 * math.pi * frequency) ** 2, 1 / frequency, phase)


def random_vibration(
    spectrum: Sequence[tuple[float, float]], rng: np.random.Generator, components: int = COMPONENTS
) -> tuple[Tone, ...]:
    """Displacement of a random acceleration, as datasheets and test standards give it.

    The band is cut into `components` parts of equal energy; each is a sinusoid at a random frequency inside its part with
    a random phase.

    Parameters
    ----------
    spectrum : sequence of (frequency, density), Hz and (m/s^2)^2/Hz
        Break points of the one-sided power spectral density, straight in between on doubly logarithmic paper.
    rng : numpy.random.Generator

    Raises
    ------
    UsageError
        Fewer than two points, frequencies that do not increase, or a value that is not positive.
    """
    table = np.asarray(spectrum, dtype=np.float64)
    if table.ndim != 2 or table.shape[0] < 2 or table.shape[1] != 2 or not np.all(table > 0):
        raise UsageError(f"vibration spectrum {list(spectrum)}: expected two points or more, all numbers positive")
    if np.any(np.diff(table[:, 0]) <= 0):
        raise UsageError(f"vibration spectrum {list(spectrum)}: expected frequencies that increase")
    f = np.geomspace(table[0, 0], table[-1, 0], 2001)
    density = np.exp(np.interp(np.log(f), *np.log(table.T)))
    energy = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(f))])
    levels = energy[-1] * (np.arange(components) + rng.random(components)) / components
    peak = math.sqrt(2 * energy[-1] / components)
    phases = rng.uniform(0, 2 * math.pi, components)
    frequencies = np.interp(levels, energy, f)
    return tuple(sine_vibration(peak, float(x), float(p)) for x, p in zip(frequencies, phases, strict=True))
