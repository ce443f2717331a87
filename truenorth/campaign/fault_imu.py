"""Faults of an IMU's log: axes, units, clock, rows, values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.fault import Fault, Inputs, Rng, clock_rate, either, of_log, over_decades
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.indexing import C_bs_from_angles
from truenorth.core.position import METRES_PER_RADIAN
from truenorth.records import ImuRecord
from truenorth.records.interpolation import gyros_behind

Array = NDArray[np.float64]


def of_imu(name: str, spoil: Callable[[ImuRecord, Rng], tuple[ImuRecord, str]]) -> Fault:
    """A fault of the IMU's log."""
    return of_log(name, "record", spoil)


def _axis(rng: Rng) -> int:
    return int(rng.integers(3))


# ------------------------------------------------------------------------------------------------------ axes of the IMU


def _exchanged(sensor: str) -> Fault:
    def spoil(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        order = list(permutations(range(3)))[1 + int(rng.integers(5))]
        return replace(record, **{sensor: getattr(record, sensor)[:, order]}), "".join("xyz"[i] for i in order)

    return of_imu(f"{sensor} axes exchanged", spoil)


def _scaled(name: str, sensor: str, factor: Callable[[Rng], float]) -> Fault:
    def spoil(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        axis, k = _axis(rng), factor(rng)
        values = getattr(record, sensor).copy()
        values[:, axis] *= k
        return replace(record, **{sensor: values}), f"{'xyz'[axis]} {k:+.3f}"

    return of_imu(name, spoil)


def _unit(sensor: str, units: Mapping[str, float]) -> Fault:
    def spoil(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        unit = str(rng.choice(list(units)))
        return replace(record, **{sensor: units[unit] * getattr(record, sensor)}), unit

    return of_imu(f"{sensor} in another unit", spoil)


def _half_turned(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """One sensor's x and y look the other way: axes of another drawing, z alike."""
    turn = np.array([-1.0, -1.0, 1.0])
    if rng.integers(2):
        return replace(record, accel=record.accel * turn), "accel x and y"
    return replace(record, gyro=record.gyro * turn), "gyro x and y"


def _askew(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """One gyro that sits askew by .3 to 3 deg: it sees a part of the turns about another axis."""
    (axis, other), angle = rng.permutation(3)[:2].tolist(), either(rng, 0.3, 3.0)
    gyro = record.gyro.copy()
    gyro[:, axis] += math.radians(angle) * record.gyro[:, other]
    return replace(record, gyro=gyro), f"{'xyz'[axis]} by {angle:+.2f} deg towards {'xyz'[other]}"


def _turned_axes(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Gyros whose block is turned against the accelerometers' by .3 to 3 deg about any axis."""
    angle, way = over_decades(rng, 0.3, 3.0), rng.standard_normal(3)
    way /= np.linalg.norm(way)
    turned = record.gyro @ dcm_from_rotation_vector(math.radians(angle) * way).T
    return replace(record, gyro=turned), f"{angle:.2f} deg about {way[0]:+.2f} {way[1]:+.2f} {way[2]:+.2f}"


# -------------------------------------------------------------------------------------------------------- clock and rows


def _clock_jump(record: Any, rng: Rng) -> tuple[Any, str]:
    row, jump = int(rng.uniform(0.2, 0.8) * len(record)), rng.uniform(0.2, 0.9)
    time = record.time.copy()
    time[row:] += jump
    return replace(record, time=time), f"{jump:.2f} s"


def _jitter(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.1, 0.4)
    time = record.time + share * record.interval * rng.uniform(-1.0, 1.0, len(record))
    return replace(record, time=time), f"{share:.2f} of the interval"


def _late_gyros(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    rows = max(1, round(10 ** rng.uniform(-1.3, -0.3) / record.interval))
    return (
        ImuRecord(record.time[rows:], record.gyro[:-rows], record.accel[rows:], record.kind, record.source),
        f"{rows * record.interval:.3f} s",
    )


def _filtered(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Gyros that their own filter delays, by less than a logger does."""
    late = over_decades(rng, 0.002, 0.05)
    return gyros_behind(record, late), f"{late:.4f} s"


def _held(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    count = int(rng.integers(3, 16))
    rows = count * (np.arange(len(record)) // count)
    return replace(record, gyro=record.gyro[rows], accel=record.accel[rows]), f"{count} rows"


def _reversed(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    return replace(record, gyro=record.gyro[::-1], accel=record.accel[::-1]), "all"


def _interleaved(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Every second row of another IMU, which is turned against the first."""
    axis = rng.standard_normal(3)
    angle = over_decades(rng, math.radians(0.02), math.radians(2.0))
    C = dcm_from_rotation_vector(angle * axis / np.linalg.norm(axis))
    gyro, accel = record.gyro.copy(), record.accel.copy()
    gyro[1::2], accel[1::2] = gyro[1::2] @ C.T, accel[1::2] @ C.T
    return replace(record, gyro=gyro, accel=accel), f"{math.degrees(angle):.3f} deg"


def _dropped(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.002, 0.03)
    keep = rng.random(len(record)) > share
    keep[[0, -1]] = True
    rows = np.flatnonzero(keep)
    return ImuRecord(
        record.time[rows], record.gyro[rows], record.accel[rows], record.kind, record.source
    ), f"{share:.1%}"


def _reordered(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Packets of some rows that change places, stamped as they arrive."""
    length, share = int(rng.integers(1, 11)), rng.uniform(0.01, 0.2)
    order = np.arange(len(record))
    for first in range(0, len(record) - 2 * length, 2 * length):
        if rng.random() < share:
            order[first : first + 2 * length] = np.roll(order[first : first + 2 * length], length)
    return replace(record, gyro=record.gyro[order], accel=record.accel[order]), f"{share:.0%} of packets of {length}"


def _doubled(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.02, 0.2)
    again = np.flatnonzero(rng.random(len(record)) < share)
    rows = np.sort(np.concatenate([np.arange(len(record)), again]))
    time = record.time[0] + record.interval * np.arange(len(rows))
    return ImuRecord(time, record.gyro[rows], record.accel[rows], record.kind, record.source), f"{share:.1%}"


# ---------------------------------------------------------------------------------------------------------- sensor values


def _clipped(sensor: str) -> Fault:
    def spoil(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        axis, share = _axis(rng), rng.uniform(0.4, 0.9)
        values = getattr(record, sensor).copy()
        middle = float(np.median(values[:, axis]))
        top = share * float(np.max(np.abs(values[:, axis] - middle)))
        values[:, axis] = np.clip(values[:, axis], middle - top, middle + top)
        return replace(record, **{sensor: values}), f"{'xyz'[axis]} at {share:.2f} of its largest"

    return of_imu(f"clipped {sensor}", spoil)


def _quantised(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    k = 10 ** rng.uniform(0.0, 2.0)
    gyro, accel = (
        q * np.round(v / q)
        for v, q in ((record.gyro, k * _noise(record.gyro)), (record.accel, k * _noise(record.accel)))
    )
    return replace(record, gyro=gyro, accel=accel), f"{k:.1f} times the noise"


def _noise(values: Array) -> float:
    return float(np.median(np.abs(np.diff(values, axis=0)))) + 1e-12


def _bias(record: ImuRecord, sensor: str, axes: Any, size: float, shape: Array) -> ImuRecord:
    """The record with a bias of that course."""
    values = getattr(record, sensor).copy()
    values[:, axes] += size * (shape * (record.interval if record.kind == "increments" else 1.0)).reshape(
        -1, *[1] * (values[:, axes].ndim - 1)
    )
    return replace(record, **{sensor: values})


def _changed(name: str, sensor: str, low: float, high: float) -> tuple[Fault, Fault, Fault]:
    """A step, a ramp to the end, and a drift as sensors warm up, of all axes."""

    def step(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        axis, size, at = _axis(rng), over_decades(rng, low, high), rng.uniform(0.25, 0.75)
        shape = (np.arange(len(record)) > at * len(record)).astype(float)
        return _bias(record, sensor, axis, size, shape), f"{'xyz'[axis]} {size:.3g} SI from {at:.2f} of the log on"

    def ramp(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        axis, size, at = _axis(rng), over_decades(rng, low, high), rng.uniform(0.0, 0.75)
        shape = np.maximum(np.arange(len(record)) / len(record) - at, 0.0) / (1.0 - at)
        return _bias(record, sensor, axis, size, shape), f"{'xyz'[axis]} to {size:.3g} SI from {at:.2f} of the log on"

    def warming(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
        size, tau = over_decades(rng, low, high), rng.uniform(0.1, 1.0)
        sizes = size * rng.uniform(-1.0, 1.0, 3)
        shape = 1.0 - np.exp(-np.arange(len(record)) / (tau * len(record)))
        for axis in range(3):
            record = _bias(record, sensor, axis, float(sizes[axis]), shape)
        return record, f"{size:.3g} SI within {tau:.2f} of the log"

    return (
        of_imu(f"{name} bias step", step),
        of_imu(f"{name} bias ramp", ramp),
        of_imu(f"{name} warming up", warming),
    )


def _dead(record: ImuRecord, rng: Rng, whole: bool) -> tuple[ImuRecord, str]:
    sensor, axis = ("gyro", "accel")[int(rng.integers(2))], _axis(rng)
    begin, length = (0.0, 1.0) if whole else (rng.uniform(0.1, 0.7), rng.uniform(0.02, 0.2))
    first = int(begin * len(record))
    rows = slice(first, first + int(length * len(record)))
    values = getattr(record, sensor).copy()
    values[rows, axis] = 0.0 if whole else values[first, axis]
    return replace(record, **{sensor: values}), f"{sensor} {'xyz'[axis]} for {length:.0%}"


def _noisy(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    sensor, k = ("gyro", "accel")[int(rng.integers(2))], 10 ** rng.uniform(1.0, 3.0)
    values = getattr(record, sensor).copy()
    first = int(rng.uniform(0.1, 0.7) * len(record))
    rows = slice(first, first + int(0.15 * len(record)))
    values[rows] += k * _noise(values) * rng.standard_normal(values[rows].shape)
    return replace(record, **{sensor: values}), f"{sensor} {k:.0f} times"


def _time_unit(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    unit, k = (("ms", 1e3), ("us", 1e6), ("minutes", 1.0 / 60.0))[int(rng.integers(3))]
    return replace(record, time=k * record.time), unit


def _leaving(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    """A base that begins to move, slowly, and goes on: what its IMU then measures more."""
    record, speed = inputs["record"], over_decades(rng, 0.003, 1.0)
    begin, ramp, course = rng.uniform(0.1, 0.7), rng.uniform(2.0, 30.0), rng.uniform(0.0, 2.0 * math.pi)
    since = np.clip((record.time - record.time[0] - begin * record.duration) / ramp, 0.0, 1.0)
    v = speed * since**2 * (3.0 - 2.0 * since)
    a = speed * 6.0 * since * (1.0 - since) / ramp
    way = np.array([math.sin(course), math.cos(course), 0.0])
    C_bn = np.swapaxes(inputs["attitude"](record.time), 1, 2)
    if "encoder" in inputs:
        angles = np.stack(
            [np.interp(record.time, inputs["encoder"].time, x) for x in inputs["encoder"].angles.T], axis=1
        )
        C_bn = np.swapaxes(C_bs_from_angles(("z", "x"), angles), 1, 2) @ C_bn
    scale = record.interval if record.kind == "increments" else 1.0
    turn = np.outer(v, [-way[1], way[0], 0.0]) / METRES_PER_RADIAN
    spoilt = replace(
        record,
        gyro=record.gyro + scale * (C_bn @ turn[..., None])[..., 0],
        accel=record.accel + scale * (C_bn @ np.outer(a, way)[..., None])[..., 0],
    )
    return inputs | {"record": spoilt}, f"{speed:.3g} m/s from {begin:.2f} of the log on"


def _spiked(record: ImuRecord, rng: Rng) -> tuple[ImuRecord, str]:
    """Single rows of an axis to one side, by 5 to 500 times the usual step from row to row."""
    sensor, axis, count = ("gyro", "accel")[int(rng.integers(2))], _axis(rng), int(rng.integers(5, 200))
    values = getattr(record, sensor).copy()
    size = over_decades(rng, 5.0, 500.0) * float(np.median(np.abs(np.diff(values[:, axis], n=2))))
    values[rng.integers(5, len(record) - 5, count), axis] += size
    return replace(record, **{sensor: values}), f"{sensor} {'xyz'[axis]} {count} of {size:.3g}"


RATE = math.radians(1.0) / 3600.0
IMU_FAULTS: tuple[Fault, ...] = (
    _exchanged("gyro"),
    _exchanged("accel"),
    _scaled("gyro sign", "gyro", lambda rng: -1.0),
    _scaled("accel sign", "accel", lambda rng: -1.0),
    of_imu("half a turn", _half_turned),
    of_imu("gyro axes turned", _turned_axes),
    of_imu("gyro askew", _askew),
    _scaled("gyro scale", "gyro", lambda rng: 1.0 + either(rng, 0.02, 0.3)),
    _scaled("accel scale", "accel", lambda rng: 1.0 + either(rng, 0.02, 0.3)),
    _unit("gyro", {"deg/s": math.degrees(1.0), "deg/h": math.degrees(3600.0), "mrad/s": 1e3, "rad a row": 0.02}),
    _unit("accel", {"g": 1.0 / 9.80665, "mg": 1e3 / 9.80665, "cm/s^2": 100.0, "m/s a row": 0.02}),
    of_imu("time in another unit", _time_unit),
    of_imu("clock rate", clock_rate),
    of_imu("clock jumps", _clock_jump),
    of_imu("jitter", _jitter),
    of_imu("late gyros", _late_gyros),
    of_imu("gyros late by a filter", _filtered),
    of_imu("held rows", _held),
    of_imu("dropped rows", _dropped),
    of_imu("doubled rows", _doubled),
    of_imu("reordered rows", _reordered),
    of_imu("reversed rows", _reversed),
    of_imu("rows of two IMUs", _interleaved),
    _clipped("gyro"),
    _clipped("accel"),
    of_imu("coarse quantum", _quantised),
    *_changed("gyro", "gyro", 0.1 * RATE, 50.0 * RATE),
    *_changed("accel", "accel", 1e-4, 0.1),
    of_imu("dead sensor", lambda record, rng: _dead(record, rng, True)),
    of_imu("stuck sensor", lambda record, rng: _dead(record, rng, False)),
    of_imu("noisy for a while", _noisy),
    of_imu("spikes", _spiked),
    Fault("base leaves slowly", "attitude", _leaving),
)
