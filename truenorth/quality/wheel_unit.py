"""Does a wheel or a log of speed count as it is said to? Against the receiver's speed, or against what the IMU feels of it.

A speed in km/h that is read as m/s is found by the receiver at once, by the ratio of the two. Without a receiver the IMU shows it:
the forward force is ``dv/dt`` and that to the left ``w v``, w the rate about the vertical. With means over a second

    f = a dv/dt + b w v + rest,     a = s forward, b = s left

and a wheel that counts ``k`` times as far has ``|a| = |b| = 1/k``; one that counts the other way has `a` backward. Both must say
so, and explain what is felt: of a road that is steeper where the car is slower they do not.

The rule is ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]

SPAN = 1.0  # s, of which means are taken
SLOW = 2.0  # m/s of the receiver, below which noise is a part of the ratio
LEAST = 30  # seconds that show it
WRONG = math.log(1.4)  # a wheel that counts so far off is of another unit
SIGMAS = 5.0  # of a scale that is said to be rough
SPREAD = 0.15  # of the ratios, about their median: half of them must lie closer
EXPLAINED = 0.7  # of what the IMU feels along and across the way: a wheel whose rows are late has gains of 0.84 at the least then
SQUARE = 0.7  # cosine of what the two gains may be off from a right angle
ALIKE = 1.5  # times one another, the two gains
CLOSE = 0.1  # of a unit's factor: what the IMU or a poor wheel leaves open
FACTORS = {
    "km/h": 3.6,
    "mph": 3600.0 / 1609.344,
    "knots": 3600.0 / 1852.0,
    "ft/s": 1.0 / 0.3048,
    "cm/s": 100.0,
    "mm/s": 1000.0,
}


def check_unit(record: ImuRecord, odometer: OdometerRecord, gnss: GnssRecord | None, wheel: Mounting) -> None:
    """Refuse a wheel that counts in another unit, or the other way.

    Parameters
    ----------
    record : ImuRecord
        Body axes, about.
    odometer : OdometerRecord
    gnss : GnssRecord or None
    wheel : Mounting
        Of the wheel, with what is unsure of its scale.

    Raises
    ------
    DataError
        With the ratio that was found, and the unit that it looks like.
    """
    ratio = _by_receiver(odometer, gnss)
    forward = _by_imu(record, odometer, wheel)
    by = "the receiver's speed" if ratio is not None else "what the IMU feels"
    if ratio is None:
        if forward is None:
            return
        ratio = 1.0 / abs(forward)
    limit = max(WRONG, SIGMAS * wheel.scale_sigma)
    column = odometer.groups()["values"][0]
    if abs(math.log(ratio)) > limit:
        raise DataError(
            f"{odometer.source}: column {column}: counts {ratio:.3g} times as far as {by} says; expected 1, to some per cent: "
            f"{_meant(odometer, ratio)}"
        )
    if forward is not None and forward < 0.0 and odometer.signed:
        raise DataError(
            f"{odometer.source}: column {column}: when it grows the IMU feels the vehicle brake; expected forward to be positive: "
            "turn its sign, or say how the IMU is mounted"
        )


def _by_receiver(odometer: OdometerRecord, gnss: GnssRecord | None) -> float | None:
    """How many times as far as the receiver's speed the wheel counts; None: that is not shown."""
    if gnss is None or gnss.v_n is None or not gnss.has_velocity.any():
        return None
    speed = np.linalg.norm(gnss.v_n[:, :2], axis=1)
    at = np.flatnonzero(gnss.has_velocity & (speed > SLOW))
    inside = (gnss.time[at] > odometer.time[0]) & (gnss.time[at] <= odometer.time[-1])
    at = at[inside]
    if len(at) < 2 or gnss.time[at[-1]] - gnss.time[at[0]] < LEAST * SPAN:
        return None
    counted = np.abs(_mean_speed(odometer, gnss.time[at] - 0.5 * SPAN))
    logs = np.log(np.maximum(counted, 1e-9) / speed[at])
    middle = float(np.median(logs))
    return math.exp(middle) if np.median(np.abs(logs - middle)) < SPREAD else None


def _by_imu(record: ImuRecord, odometer: OdometerRecord, wheel: Mounting) -> float | None:
    """The gain from the wheel's accelerations to those that the IMU feels, negative where they are opposite; None: not shown."""
    begin, end = max(record.time[0], odometer.time[0]), min(record.time[-1], odometer.time[-1])
    if end - begin < LEAST * SPAN:
        return None
    at = begin + SPAN * np.arange(int((end - begin) / SPAN) + 1)
    steps = record.steps[:, None] if record.kind == "rates" else 1.0
    way = [
        np.interp(at, record.time, a)
        for a in np.cumsum(np.hstack([record.gyro * steps, record.accel * steps]), axis=0).T
    ]
    w, f = np.split(np.diff(np.array(way).T, axis=0) / SPAN, 2, axis=1)
    up = f.mean(axis=0) / np.linalg.norm(f.mean(axis=0))
    v = _mean_speed(odometer, at[:-1])
    changes = np.gradient(v, SPAN)
    felt = f - f.mean(axis=0)
    felt = felt - np.outer(felt @ up, up)
    A = np.column_stack([changes, (w @ up) * v, np.ones(len(v))])
    quick = np.std(A[:, :2], axis=0)
    if np.any(quick < 1e-9):
        return None
    gains = np.linalg.lstsq(A, felt, rcond=None)[0]
    left = felt - A @ gains
    a, b = (float(np.linalg.norm(gain)) for gain in gains[:2])
    shown = min(a, b) > 0.0 and max(a, b) < ALIKE * min(a, b) and np.sum(left**2) < (1.0 - EXPLAINED) * np.sum(felt**2)
    # Turned by a quarter from one another, and as the vehicle's axes are.
    across = np.cross(up, gains[0])
    if not shown or across @ gains[1] < SQUARE * a * b:
        return None
    sign = math.copysign(1.0, float(gains[0] @ wheel.C_mb[1]))
    return sign * math.sqrt(a * b)


def _mean_speed(odometer: OdometerRecord, begin: Array) -> Array:
    """Mean speeds over the span that begins at each time, m/s."""
    way = np.cumsum(odometer.distance)
    return np.asarray((np.interp(begin + SPAN, odometer.time, way) - np.interp(begin, odometer.time, way)) / SPAN)


def _meant(odometer: OdometerRecord, ratio: float) -> str:
    """What it looks like."""
    if odometer.kind == "pulses":
        return f"give a pulse size of {(odometer.pulse_size or 1.0) / ratio:.4g} m"
    if odometer.kind == "distance" and abs(ratio * odometer.interval - 1.0) < CLOSE:
        return "these values seem to be speeds, in m/s: call the column speed"
    tried = [(unit, factor**sign, sign) for unit, factor in FACTORS.items() for sign in (1, -1)]
    unit, factor, sign = min(tried, key=lambda item: abs(math.log(ratio / item[1])))
    if odometer.kind != "speed" or abs(ratio / factor - 1.0) > CLOSE:
        return "check its unit"
    if sign > 0:
        return f"these values seem to be {unit}: write the unit into the heading, as speed [{unit}]"
    return f"these values seem to be m/s, and the heading says {unit}: write speed [m/s]"
