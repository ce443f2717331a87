"""Stops: while a vehicle stands, its velocity is zero, and while it stands still, its rotation too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import UsageError
from truenorth.increments import increments
from truenorth.navigation.aiding import Aiding
from truenorth.quality.regimes import DISTURBED, STILL, motion_summary
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

STILL_VELOCITY = 0.01  # m/s, one sigma of a base on which nothing is seen to move
DISTURBED_VELOCITY = 0.03  # m/s, of one that people, wind or an engine shake
STILL_RATE = 1e-6  # rad/s, of its rotation, beside what the gyros show of themselves


def stops_in(record: ImuRecord) -> tuple[Array, Array]:
    """Seconds at rest, found from the IMU alone.

    Constant velocity looks like rest to an IMU, but a vehicle that drives shakes. Seconds without any motion above the
    sensor's noise count anywhere; seconds of small disturbances only before the vehicle first moves.

    Returns
    -------
    still, disturbed : (m,) arrays, s
        Middles of the seconds, on the record's clock.
    """
    motion = motion_summary(record)
    if motion.time.size == 0:
        return np.empty(0), np.empty(0)
    moved = np.flatnonzero(motion.kind > DISTURBED)
    before = np.arange(len(motion.kind)) < (moved[0] if moved.size else len(motion.kind))
    middle = motion.time - 0.5
    return middle[motion.kind == STILL], middle[(motion.kind == DISTURBED) & before]


def rate_scatter(record: ImuRecord, interval: float, seconds: Array) -> float:
    """RMS scatter of the mean rate over an interval, rad/s, in the seconds around these times: noise, quantum, vibration."""
    angle = np.cumsum(increments(record)[0], axis=0)
    edges = (seconds - 0.5)[:, None] + interval * np.arange(max(3, int(1.0 / interval) + 1))
    means = np.diff([np.interp(edges, record.time, angle[:, i]) for i in range(3)], axis=2) / interval
    return float(np.sqrt(0.5 * np.mean(np.diff(means, axis=2) ** 2)))


def zero_updates(record: ImuRecord, stops: str | Sequence[tuple[float, float]], interval: float) -> list[Aiding]:
    """Zero velocities, and zero rotations of seconds without any motion.

    Parameters
    ----------
    record : ImuRecord
    stops : "auto" or sequence of (start, stop)
        Found from the IMU, or given, s on the record's clock.
    interval : float, s
        Of the filter: a mean rate is taken over it.

    Raises
    ------
    UsageError
        A stop that ends before it begins.
    """
    if isinstance(stops, str):
        if stops != "auto":
            raise UsageError(f"zupt={stops!r}; expected 'auto' or pairs of seconds (start, stop)")
        still, disturbed = stops_in(record)
    else:
        seconds = []
        for start, stop in stops:
            if not stop > start:
                raise UsageError(f"stop from {start:g} s to {stop:g} s; expected its end after its beginning")
            seconds.append(np.arange(start, stop, 1.0) + 0.5)
        still, disturbed = np.empty(0), np.concatenate(seconds) if seconds else np.empty(0)
    return updates_at(record, still, disturbed, interval)


def updates_at(record: ImuRecord, still: Array, disturbed: Array, interval: float) -> list[Aiding]:
    """Zero velocities in the seconds around these times, and zero rotations where nothing moves at all."""
    time = np.concatenate([still, disturbed])
    if time.size == 0:
        return []
    sigma = np.concatenate([np.full(still.size, STILL_VELOCITY), np.full(disturbed.size, DISTURBED_VELOCITY)])
    zero = np.zeros((time.size, 3))
    found = [Aiding("zero velocity", "velocity", time, zero, np.tile(sigma[:, None], 3))]
    if still.size:
        scatter = np.full((still.size, 3), np.hypot(STILL_RATE, rate_scatter(record, interval, still)))
        found.append(Aiding("zero rotation", "rotation", still, np.zeros((still.size, 3)), scatter))
    return found
