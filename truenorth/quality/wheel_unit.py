"""Does a wheel count in the unit that it is said to? Against the receiver's speed, and against what the IMU feels of it.

A speed in km/h that is read as m/s is found by the receiver at once, by the ratio of the two. The IMU shows it, too: the forward
force is ``dv/dt`` and that to the left ``w v``, w the rate about the vertical. With means over a second

    f = a dv/dt + b w v + rest,     a = s forward, b = s left

and a wheel that counts ``k`` times as far has ``|a| = |b| = 1/k``; one that counts the other way has `a` backward. Both must say
so, and explain what is felt: of a road that is steeper where the car is slower they do not.

A wheel aside in circles, a body that leans with what it feels, and a receiver on another clock make ratios of 0.6 to 1.6. So a
ratio must be that of a unit and 1.8 times off; and where both receiver and IMU show one they must agree.

The rule is ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.core.units import FOOT
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord
from truenorth.state.mounting import Mounting
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

SPAN = 1.0  # s, of which means are taken
LONGEST = 7200.0  # s of a log that are looked at
SLOW = 2.0  # m/s of the receiver, below which noise is a part of the ratio
FASTER = 0.5  # of the speed that the wheel reaches: such seconds are compared, chosen by the wheel alone
LEAST = 30  # seconds that show it
STILL = 1e-9  # m/s^2
ASIDE = 2.0  # m, of a wheel or an antenna of which nothing is said
TURNS = 0.15  # of the speed that the arm may make of a turn
WRONG, SURELY = (
    math.log(1.4),
    math.log(1.8),
)  # a wheel that counts so far off is of another unit: by both, by one of them
SIGMAS = 5.0  # of a scale that is said to be rough
SPREAD = 0.15  # of the ratios, about their median: half of them must lie closer
EXPLAINED = 0.7  # of what the IMU feels along and across the way: a wheel whose rows are late has gains of 0.84 at the least then
SQUARE = 0.7  # cosine of what the two gains may be off from a right angle, and of the forward axis from the IMU's
ROUGH = 0.5  # rad, one sigma of a mounting that is open: it shows no sign
ALIKE = 1.5  # times one another, the two gains
AGREE = math.log(1.25)  # ratios of receiver and IMU
CLOSE = 0.1  # of a unit's factor: what the IMU or a poor wheel leaves open
FACTORS = {
    "km/h": 3.6,
    "mph": 3600.0 / 1609.344,
    "knots": 3600.0 / 1852.0,
    "ft/s": 1.0 / FOOT,
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
        Of the wheel, with what is unsure of its scale and axes.

    Raises
    ------
    DataError
        With the ratio that was found, and the unit that it looks like.
    """
    record = record[: max(2, int(np.searchsorted(record.time, record.time[0] + LONGEST)))]
    by_receiver, forward = _by_receiver(record, odometer, gnss, wheel), _by_imu(record, odometer)
    by_imu = None if forward is None else 1.0 / float(np.linalg.norm(forward))
    column = odometer.groups()["values"][0]
    ratio = by_receiver or by_imu
    if ratio is not None and _is_wrong(ratio, by_receiver, by_imu, odometer, wheel):
        said = "the receiver's speed" if by_receiver is not None else "what the IMU feels"
        raise DataError(
            f"{odometer.source}: column {column}: counts {ratio:.3g} times as far as {said} says; expected 1, to some per cent: "
            f"{_meant(odometer, ratio) or 'check its unit'}"
        )
    if forward is None or not odometer.signed or wheel.angle_sigma > ROUGH:
        return
    if forward @ wheel.C_mb[1] < -SQUARE * float(np.linalg.norm(forward)):
        raise DataError(
            f"{odometer.source}: column {column}: when it grows the IMU feels the vehicle brake; expected forward to be positive: "
            "turn its sign, or say how the IMU is mounted"
        )


def _is_wrong(
    ratio: float, by_receiver: float | None, by_imu: float | None, odometer: OdometerRecord, wheel: Mounting
) -> bool:
    """Whether a ratio is that of another unit: both say so, or one does and it is that of a unit, or far off."""
    off = abs(math.log(ratio))
    if off < max(WRONG, SIGMAS * wheel.scale_sigma):
        return False
    if by_receiver is not None and by_imu is not None:
        return abs(math.log(by_receiver / by_imu)) < AGREE
    return off > SURELY and _meant(odometer, ratio) is not None


def _by_receiver(record: ImuRecord, odometer: OdometerRecord, gnss: GnssRecord | None, wheel: Mounting) -> float | None:
    """How many times as far as the receiver's speed the wheel counts, straight on; None: that is not shown."""
    if gnss is None or gnss.v_n is None or not gnss.has_velocity.any():
        return None
    time, v_n = gnss.time[gnss.has_velocity], gnss.v_n[gnss.has_velocity, :2]
    begin, end = max(time[0], odometer.time[0], record.time[0]), min(time[-1], odometer.time[-1], record.time[-1])
    inside = (time >= begin) & (time < end)
    _, which, many = np.unique(np.floor((time[inside] - begin) / SPAN), return_inverse=True, return_counts=True)
    if len(many) < LEAST:
        return None
    at, east, north = (np.bincount(which, a) / many for a in (time[inside], *v_n[inside].T))
    speed, counted = np.hypot(east, north), np.abs(_mean_speed(odometer, at))
    arm = ASIDE + float(np.linalg.norm(wheel.lever_arm)) + wheel.lever_arm_sigma
    turned = np.linalg.norm(_means(record, np.concatenate([at - 0.5 * SPAN, at + 0.5 * SPAN]))[:, :3], axis=1)
    fast = (counted > FASTER * np.quantile(counted, 0.9)) & (turned * arm < TURNS * np.maximum(speed, SLOW))
    if fast.sum() < LEAST or np.median(speed[fast]) < SLOW or counted[fast].min() <= 0.0:
        return None
    logs = np.log(counted[fast] / np.maximum(speed[fast], 1e-3))
    middle = float(np.median(logs))
    return math.exp(middle) if np.median(np.abs(logs - middle)) < SPREAD else None


def _by_imu(record: ImuRecord, odometer: OdometerRecord) -> Array | None:
    """(3,) gain from the wheel's accelerations forward to those that the IMU feels; None: not shown."""
    begin, end = max(record.time[0], odometer.time[0]), min(record.time[-1], odometer.time[-1])
    if end - begin < LEAST * SPAN:
        return None
    at = begin + SPAN * np.arange(int((end - begin) / SPAN) + 1)
    w, f = np.split(_means(record, np.concatenate([at[:-1], at[1:]])), 2, axis=1)
    up = f.mean(axis=0) / np.linalg.norm(f.mean(axis=0))
    v = _mean_speed(odometer, at[:-1] + 0.5 * SPAN)
    felt = f - f.mean(axis=0)
    felt = felt - np.outer(felt @ up, up)
    A = np.column_stack([np.gradient(v, SPAN), (w @ up) * v, np.ones(len(v))])
    if np.any(np.std(A[:, :2], axis=0) < STILL):
        return None
    forward, left, _ = np.linalg.lstsq(A, felt, rcond=None)[0]
    a, b = float(np.linalg.norm(forward)), float(np.linalg.norm(left))
    rest = np.sum((felt - A[:, :2] @ [forward, left]) ** 2)
    alike = 0.0 < max(a, b) < ALIKE * min(a, b) and rest < (1.0 - EXPLAINED) * np.sum(felt**2)
    # Left is forward turned by a quarter.
    if not alike or np.cross(up, forward) @ left < SQUARE * a * b:
        return None
    return np.asarray(forward * math.sqrt(b / a))


def _means(record: ImuRecord, at: Array) -> Array:
    """(n, 6) mean rate and force over n spans, `at` their beginnings and then their ends."""
    sums = np.cumsum(np.hstack(increments(record)), axis=0)
    begin, end = np.split(np.column_stack([np.interp(at, record.time, column) for column in sums.T]), 2)
    return np.asarray((end - begin) / SPAN)


def _mean_speed(odometer: OdometerRecord, middle: Array) -> Array:
    """Mean speeds over the spans about these times, m/s."""
    way = np.cumsum(odometer.distance)
    begin, end = (np.interp(middle + half * SPAN, odometer.time, way) for half in (-0.5, 0.5))
    return np.asarray((end - begin) / SPAN)


def _meant(odometer: OdometerRecord, ratio: float) -> str | None:
    """What it looks like; None: no unit that we know."""
    if odometer.kind == "pulses":
        return f"give a pulse size of {(odometer.pulse_size or 1.0) / ratio:.4g} m"
    if odometer.kind == "distance":
        speeds = abs(ratio * odometer.interval - 1.0) < CLOSE
        return "these values seem to be speeds, in m/s: call the column speed" if speeds else None
    tried = [(unit, factor**sign, sign) for unit, factor in FACTORS.items() for sign in (1, -1)]
    unit, factor, sign = min(tried, key=lambda item: abs(math.log(ratio / item[1])))
    if abs(ratio / factor - 1.0) > CLOSE:
        return None
    if sign > 0:
        return f"these values seem to be {unit}: write the unit into the heading, as speed [{unit}]"
    return f"these values seem to be m/s, and the heading says {unit}: write speed [m/s]"
