"""Times that are written as a clock shows them, ``101259.98`` or ``101259980``: hours, minutes and seconds in one number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEWEST = 50  # rows, from which a log shows by itself what its numbers are
DAY = 86400.0
FACES = {"HHMMSS": 1.0, "HHMMSSmmm": 1e3, "HHMMSScc": 1e2, "HHMMSSuuuuuu": 1e6}  # and how many parts a second has


def clock_face(raw: Array) -> tuple[str, float] | None:
    """How numbers are written that are times of a clock, and how many parts a second has in them; None of others."""
    return next(((written, parts) for written, parts in FACES.items() if is_clock_face(raw / parts)), None)


def is_clock_face(raw: Array) -> bool:
    """Whether numbers are hours, minutes and seconds as ``101259.98``: no second reaches 60, and each minute begins with a jump."""
    if len(raw) < FEWEST or not (raw.min() >= 0.0 and raw.max() < 240000.0) or raw.min() // 100.0 == raw.max() // 100.0:
        return False  # no minute begins
    if not np.all(raw % 100.0 < 60.0):
        return False
    steps, minutes = np.diff(raw), np.diff(raw // 100.0)
    inside = steps[(minutes == 0.0) & (steps > 0.0)]  # a computer that reads in bunches stamps several rows alike
    step = float(np.median(inside)) if inside.size else 0.0
    jumps = steps[(minutes == 1.0) & (raw[1:] % 100.0 < 2.0) & (raw[:-1] % 100.0 > 58.0)]
    whole = np.any(minutes > 0.0) and np.all(raw % 10000.0 < 6000.0)
    return bool(
        whole and 0.0 < step <= 1.0 and jumps.size and np.all(np.abs(jumps - 40.0 - step) < max(0.5 * step, 1e-3))
    )


def of_clock_face(raw: Array) -> Array:
    """Seconds of the day of numbers such as ``101259.98``; they go on after midnight. NaN of a number that is infinite."""
    with np.errstate(invalid="ignore"):
        return _seconds(raw)


def _seconds(raw: Array) -> Array:
    time = raw // 10000.0 * 3600.0 + raw // 100.0 % 100.0 * 60.0 + raw % 100.0
    return np.asarray(time + DAY * np.concatenate([[0.0], np.cumsum(np.diff(time) < -DAY / 2)]))
