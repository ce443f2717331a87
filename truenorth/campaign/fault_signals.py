"""Faults of what a sensor puts into its values: a disturbance of one tone, a response to force, a counter that rolls over."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.fault import Fault, Rng, of_log, over_decades
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

PER_G = math.radians(1.0) / 3600.0 / 9.80665  # deg/h a g
HALF_RANGE = 2**15  # counts of 16 bits


def _hum(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """A tone of .1 to .48 of the rate of rows on all axes of a sensor, each of its own size and phase: no motion."""
    sensor, share = ("gyro", "accel")[int(rng.integers(2))], rng.uniform(0.1, 0.48)
    values = getattr(record, sensor)
    usual = float(np.median(np.abs(np.diff(values, axis=0)))) + 1e-12
    k = over_decades(rng, 3.0, 3000.0)
    size, phase = k * usual * rng.uniform(0.3, 1.0, 3), rng.uniform(0.0, 2.0 * math.pi, 3)
    tone = np.sin(2.0 * math.pi * share * np.arange(len(record))[:, None] + phase)
    size_said = f"{sensor} {k:.3g} times the noise at {share:.3f} of the rate"
    return replace(record, **{sensor: values + size * tone}), size_said


def _g_sensitive(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Gyros that respond to specific force, by .3 to 100 deg/h a g."""
    size = over_decades(rng, 0.3, 100.0)
    G = size * PER_G * rng.uniform(-1.0, 1.0, (3, 3))
    return replace(record, gyro=record.gyro + record.accel @ G.T), f"{size:.3g} deg/h a g"


def _wrapped(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """16-bit counts of a sensor that roll over beyond .4 to 1 of its largest value."""
    sensor, share = ("gyro", "accel")[int(rng.integers(2))], rng.uniform(0.4, 1.0)
    values = getattr(record, sensor)
    end = share * float(np.max(np.abs(values)))
    counts = (np.round(values * HALF_RANGE / end) + HALF_RANGE) % (2 * HALF_RANGE) - HALF_RANGE
    return replace(record, **{sensor: counts * (end / HALF_RANGE)}), f"{sensor} beyond {end:.4g}"


def _clipped_between(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """An accelerometer in counts of .5 to 5 times its noise, cut off on one side between two of them."""
    axis, share, k = int(rng.integers(3)), rng.uniform(0.3, 0.9), over_decades(rng, 0.5, 5.0)
    values = record.accel.copy()
    step = k * (float(np.median(np.abs(np.diff(values[:, axis])))) + 1e-12)
    sign = float(rng.choice([-1.0, 1.0]))
    x = sign * values[:, axis]
    end = float(np.median(x)) + share * float(np.max(x) - np.median(x))
    values[:, axis] = sign * np.minimum(step * np.round(x / step), end)
    size_said = f"{'xyz'[axis]} at {share:.2f} of its largest, counts of {k:.2f} times the noise"
    return replace(record, accel=values), size_said


SIGNAL_FAULTS: tuple[Fault, ...] = (
    of_log("hum", "record", _hum),
    of_log("gyros feel force", "record", _g_sensitive),
    of_log("counter rolls over", "record", _wrapped),
    of_log("clipped between counts", "record", _clipped_between),
)
