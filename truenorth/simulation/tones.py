"""Sums of sinusoids with their first and second derivatives: what sway, swell and vibration are made of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]
Triple = tuple[Array, Array, Array]
RUN = 64  # samples between two exact evaluations: the recurrence in between loses 1e-14


@dataclass(frozen=True)
class Tone:
    """One sinusoid, ``amplitude * cos(2 pi t / period + phase)``.

    Attributes
    ----------
    amplitude : float, rad or m
    period : float, s
    phase : float, rad

    Raises
    ------
    UsageError
        A period that is not positive, or a number that is not finite.
    """

    amplitude: float
    period: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not (self.period > 0 and math.isfinite(self.period + self.amplitude + self.phase)):
            raise UsageError(
                f"tone of amplitude {self.amplitude:g}, period {self.period:g} s, phase {self.phase:g}; expected "
                "finite numbers and a positive period"
            )


def shortest(*tones: Sequence[Tone]) -> float:
    """The shortest period of all, s; infinite without any."""
    return min((tone.period for group in tones for tone in group), default=math.inf)


def cosines(tones: Sequence[Tone], t: Array, mean: float = 0.0) -> Triple:
    """``mean + sum A cos(w t + phase)`` and its two derivatives, each of the shape of `t`."""
    return _sum(tones, t, mean, 0.0)


def sines(tones: Sequence[Tone], t: Array) -> Triple:
    """``sum A sin(w t + phase)`` and its two derivatives."""
    return _sum(tones, t, 0.0, -0.5 * math.pi)


def _sum(tones: Sequence[Tone], t: Array, mean: float, shift: float) -> Triple:
    rows = t.reshape(len(t), -1) if t.ndim > 1 else t.reshape(-1, 1)  # successive times stand in a column
    out = np.zeros((3, *rows.shape))
    if tones:
        table = np.array([(x.amplitude, 2 * np.pi / x.period, x.phase + shift) for x in tones])
        _accumulate(np.ascontiguousarray(rows), table, out)
    value, rate, acceleration = out.reshape(3, *t.shape)
    return value + mean, rate, acceleration


@compiled
def _accumulate(t: Any, table: Any, out: Any) -> None:
    """Add every tone to `out` (3, K, M) at the times `t` (K, M); equal steps down a column go by recurrence."""
    count, columns = t.shape
    for m in range(columns):
        for first in range(0, count, RUN):
            last = min(first + RUN, count)
            n = last - first
            step = 0.0
            even = n > 2
            if even:
                # From end to end, so that the rounding of the times is not multiplied by their number.
                step = (t[last - 1, m] - t[first, m]) / (n - 1)
                for k in range(first, last):
                    even = even and abs(t[k, m] - t[first, m] - (k - first) * step) <= 4e-16 * abs(t[k, m]) + 1e-15
            for j in range(len(table)):
                A, w, phase = table[j, 0], table[j, 1], table[j, 2]
                c = math.cos(w * t[first, m] + phase)
                s = math.sin(w * t[first, m] + phase)
                dc, ds = math.cos(w * step), math.sin(w * step)
                for k in range(first, last):
                    if not even:
                        c = math.cos(w * t[k, m] + phase)
                        s = math.sin(w * t[k, m] + phase)
                    out[0, k, m] += A * c
                    out[1, k, m] -= A * w * s
                    out[2, k, m] -= A * w * w * c
                    c, s = c * dc - s * ds, s * dc + c * ds
