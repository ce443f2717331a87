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
from truenorth.core.vectors import each4, load4, minus4, plus4, store4, times4

Array = NDArray[np.float64]
Triple = tuple[Array, Array, Array]
LANES = 4  # columns of times that a register holds: the nodes of the quadrature
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
        table = np.zeros((len(tones) + len(tones) % 2, 3))  # in pairs: the last one may be nothing
        table[: len(tones)] = [(x.amplitude, 2 * np.pi / x.period, x.phase + shift) for x in tones]
        _accumulate(np.ascontiguousarray(rows), table, out, np.empty((4, len(table), LANES)))
    value, rate, acceleration = out.reshape(3, *t.shape)
    return value + mean, rate, acceleration


@compiled
def _accumulate(t: Any, table: Any, out: Any, space: Any) -> None:
    """Add every tone to `out` (3, K, M) at the times `t` (K, M); equal steps down a column go by recurrence."""
    count, columns = t.shape
    steps = np.full(LANES, np.nan)  # of the run before
    for first in range(0, count, RUN):
        last = min(first + RUN, count)
        together = columns == LANES
        for m in range(columns):
            together = together and _step(t, first, last, m)[1]
        if together:
            _begin(t, table, first, last, steps, space)
            _add_pairs(table, first, last, space, out)
        else:
            for m in range(columns):
                _add_one(t, table, first, last, m, out)


@compiled
def _step(t: Any, first: int, last: int, m: int) -> Any:
    """The step of the times of a run down a column, and whether all are as long."""
    if last - first <= 2:
        return 0.0, False
    # From end to end, so that the rounding of the times is not multiplied by their number.
    step = (t[last - 1, m] - t[first, m]) / (last - first - 1)
    for k in range(first, last):
        if not abs(t[k, m] - t[first, m] - (k - first) * step) <= 4e-16 * abs(t[k, m]) + 1e-15:
            return step, False
    return step, True


@compiled
def _add_one(t: Any, table: Any, first: int, last: int, m: int, out: Any) -> None:
    """A run of one column."""
    step, even = _step(t, first, last, m)
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


@compiled
def _begin(t: Any, table: Any, first: int, last: int, steps: Any, space: Any) -> None:
    """Cosines and sines (4, tones, columns) at the first time of a run, and of its step where that is another than before."""
    for m in range(LANES):
        step = _step(t, first, last, m)[0]
        for j in range(len(table)):
            w, phase = table[j, 1], table[j, 2]
            space[0, j, m] = math.cos(w * t[first, m] + phase)
            space[1, j, m] = math.sin(w * t[first, m] + phase)
            if step != steps[m]:
                space[2, j, m], space[3, j, m] = math.cos(w * step), math.sin(w * step)
        steps[m] = step


@compiled
def _add_pairs(table: Any, first: int, last: int, space: Any, out: Any) -> None:
    """A run of four columns, each in a lane of the registers; two tones at once, one waits for itself half the time."""
    for j in range(0, len(table), 2):
        A, w, B, u = table[j, 0], table[j, 1], table[j + 1, 0], table[j + 1, 1]
        c, s, dc, ds = _tone(space, j)
        d, r, dd, dr = _tone(space, j + 1)
        for k in range(first, last):
            value = plus4(plus4(load4(out, (0, k, 0)), times4(A, c)), times4(B, d))
            rate = minus4(minus4(load4(out, (1, k, 0)), times4(A * w, s)), times4(B * u, r))
            acceleration = minus4(minus4(load4(out, (2, k, 0)), times4(A * w * w, c)), times4(B * u * u, d))
            store4(out, (0, k, 0), value)
            store4(out, (1, k, 0), rate)
            store4(out, (2, k, 0), acceleration)
            c, s = minus4(each4(c, dc), each4(s, ds)), plus4(each4(s, dc), each4(c, ds))
            d, r = minus4(each4(d, dd), each4(r, dr)), plus4(each4(r, dd), each4(d, dr))


@compiled
def _tone(space: Any, j: int) -> Any:
    return load4(space, (0, j, 0)), load4(space, (1, j, 0)), load4(space, (2, j, 0)), load4(space, (3, j, 0))
