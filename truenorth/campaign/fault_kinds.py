"""Faults of logs, clocks, places and specifications: each a function of the inputs and a drawn size."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import METRES_PER_RADIAN
from truenorth.records import EncoderRecord, GnssRecord, ImuRecord, MasterRecord, OdometerRecord

Array = NDArray[np.float64]
Inputs = dict[str, Any]  # of a procedure: its records, its place, its specification, its start


@dataclass(frozen=True)
class Fault:
    """One thing that goes wrong."""

    name: str
    needs: str  # the input that it spoils; procedures without it are not asked
    # inputs and a generator to the spoilt inputs and the drawn size in words
    apply: Callable[[Inputs, np.random.Generator], tuple[Inputs, str]]


def _imu(name: str, spoil: Callable[[ImuRecord, np.random.Generator], tuple[ImuRecord, str]]) -> Fault:
    def apply(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
        record, size = spoil(inputs["record"], rng)
        return inputs | {"record": record}, size

    return Fault(name, "record", apply)


def _log(name: str, key: str, spoil: Callable[[Any, np.random.Generator], tuple[Any, str]]) -> Fault:
    def apply(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
        log, size = spoil(inputs[key], rng)
        return inputs | {key: log}, size

    return Fault(name, key, apply)


def _axis(rng: np.random.Generator) -> int:
    return int(rng.integers(3))


# ------------------------------------------------------------------------------------------------------ axes of the IMU


def _exchanged(sensor: str) -> Fault:
    def spoil(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
        order = list(permutations(range(3)))[1 + int(rng.integers(5))]
        return replace(record, **{sensor: getattr(record, sensor)[:, order]}), "".join("xyz"[i] for i in order)

    return _imu(f"{sensor} axes exchanged", spoil)


def _scaled(name: str, sensor: str, factor: Callable[[np.random.Generator], float]) -> Fault:
    def spoil(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
        axis, k = _axis(rng), factor(rng)
        values = getattr(record, sensor).copy()
        values[:, axis] *= k
        return replace(record, **{sensor: values}), f"{'xyz'[axis]} {k:+.3f}"

    return _imu(name, spoil)


def _unit(name: str, sensor: str, factor: float) -> Fault:
    return _imu(
        name, lambda record, rng: (replace(record, **{sensor: factor * getattr(record, sensor)}), f"{factor:.3g}")
    )


# -------------------------------------------------------------------------------------------------------- clock and rows


def _clock_rate(record: Any, rng: np.random.Generator) -> tuple[Any, str]:
    k = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.005, 0.03)
    return replace(record, time=record.time[0] + k * (record.time - record.time[0])), f"{100 * (k - 1):+.2f} %"


def _clock_jump(record: Any, rng: np.random.Generator) -> tuple[Any, str]:
    row, jump = int(rng.uniform(0.2, 0.8) * len(record)), rng.uniform(0.2, 0.9)
    time = record.time.copy()
    time[row:] += jump
    return replace(record, time=time), f"{jump:.2f} s"


def _jitter(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.1, 0.4)
    time = record.time + share * record.interval * rng.uniform(-1.0, 1.0, len(record))
    return replace(record, time=time), f"{share:.2f} of the interval"


def _late_gyros(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    rows = max(1, round(10 ** rng.uniform(-1.3, -0.3) / record.interval))
    return (
        ImuRecord(record.time[rows:], record.gyro[:-rows], record.accel[rows:], record.kind, record.source),
        f"{rows * record.interval:.3f} s",
    )


def _held(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    count = int(rng.integers(3, 16))
    rows = count * (np.arange(len(record)) // count)
    return replace(record, gyro=record.gyro[rows], accel=record.accel[rows]), f"{count} rows"


def _dropped(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.002, 0.03)
    keep = rng.random(len(record)) > share
    keep[[0, -1]] = True
    rows = np.flatnonzero(keep)
    return ImuRecord(
        record.time[rows], record.gyro[rows], record.accel[rows], record.kind, record.source
    ), f"{share:.1%}"


def _doubled(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    share = rng.uniform(0.02, 0.2)
    again = np.flatnonzero(rng.random(len(record)) < share)
    rows = np.sort(np.concatenate([np.arange(len(record)), again]))
    time = record.time[0] + record.interval * np.arange(len(rows))
    return ImuRecord(time, record.gyro[rows], record.accel[rows], record.kind, record.source), f"{share:.1%}"


# ---------------------------------------------------------------------------------------------------------- sensor values


def _clipped(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    axis, share = _axis(rng), rng.uniform(0.4, 0.9)
    gyro = record.gyro.copy()
    top = share * float(np.max(np.abs(gyro[:, axis])))
    gyro[:, axis] = np.clip(gyro[:, axis], -top, top)
    return replace(record, gyro=gyro), f"{'xyz'[axis]} at {share:.2f} of its largest"


def _quantised(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    k = 10 ** rng.uniform(0.0, 2.0)
    gyro, accel = (
        q * np.round(v / q)
        for v, q in ((record.gyro, k * _noise(record.gyro)), (record.accel, k * _noise(record.accel)))
    )
    return replace(record, gyro=gyro, accel=accel), f"{k:.1f} times the noise"


def _noise(values: Array) -> float:
    return float(np.median(np.abs(np.diff(values, axis=0)))) + 1e-12


def _step(record: ImuRecord, rng: np.random.Generator, sensor: str, low: float, high: float) -> tuple[ImuRecord, str]:
    """A step, or a ramp, of a bias in the middle half of the log."""
    axis, size = _axis(rng), float(np.exp(rng.uniform(math.log(low), math.log(high))))
    at = rng.uniform(0.25, 0.75)
    share = (np.arange(len(record)) / len(record) - at) / (1.0 - at)
    shape = (share > 0.0) * (1.0 if rng.random() < 0.5 else share)
    values = getattr(record, sensor).copy()
    values[:, axis] += size * shape * (record.interval if record.kind == "increments" else 1.0)
    return replace(record, **{sensor: values}), f"{'xyz'[axis]} {size:.3g} SI from {at:.2f} of the log on"


def _dead(record: ImuRecord, rng: np.random.Generator, whole: bool) -> tuple[ImuRecord, str]:
    sensor, axis = ("gyro", "accel")[int(rng.integers(2))], _axis(rng)
    begin, length = (0.0, 1.0) if whole else (rng.uniform(0.1, 0.7), rng.uniform(0.02, 0.2))
    first = int(begin * len(record))
    rows = slice(first, first + int(length * len(record)))
    values = getattr(record, sensor).copy()
    values[rows, axis] = 0.0 if whole else values[first, axis]
    return replace(record, **{sensor: values}), f"{sensor} {'xyz'[axis]} for {length:.0%}"


def _noisy(record: ImuRecord, rng: np.random.Generator) -> tuple[ImuRecord, str]:
    sensor, k = ("gyro", "accel")[int(rng.integers(2))], 10 ** rng.uniform(1.0, 3.0)
    values = getattr(record, sensor).copy()
    first = int(rng.uniform(0.1, 0.7) * len(record))
    rows = slice(first, first + int(0.15 * len(record)))
    values[rows] += k * _noise(values) * rng.standard_normal(values[rows].shape)
    return replace(record, **{sensor: values}), f"{sensor} {k:.0f} times"


# --------------------------------------------------------------------------------------------- place and specification


def _latitude(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
    place = inputs["place"]
    off = -2.0 * place.lat if rng.random() < 0.3 else rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(1.0, 30.0))
    return inputs | {
        "place": replace(place, lat=float(np.clip(place.lat + off, -1.4, 1.4)))
    }, f"{math.degrees(off):+.1f} deg"


def _height(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
    off = rng.uniform(500.0, 5000.0)
    return inputs | {"place": replace(inputs["place"], alt=inputs["place"].alt + off)}, f"{off:.0f} m"


def _specification(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
    k = 10.0 if rng.random() < 0.5 else 0.1
    spec = inputs["imu"]
    names = (
        "gyro_bias",
        "gyro_random_walk",
        "gyro_bias_instability",
        "accel_bias",
        "accel_random_walk",
        "accel_bias_instability",
    )
    return inputs | {"imu": replace(spec, **{name: k * getattr(spec, name) for name in names})}, f"times {k:g}"


# -------------------------------------------------------------------------------------------------------- aiding sensors


def _turn_v(v: Array | None, angle: float) -> Array | None:
    return None if v is None else v @ dcm_from_rotation_vector(np.array([0.0, 0.0, angle])).T


def _grid_north(gnss: GnssRecord, rng: np.random.Generator) -> tuple[GnssRecord, str]:
    angle = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(0.5, 3.0))
    return replace(gnss, v_n=_turn_v(gnss.v_n, angle)), f"{math.degrees(angle):+.2f} deg"


def _shifted(record: Any, rng: np.random.Generator) -> tuple[Any, str]:
    late = rng.uniform(0.3, 2.0)
    return record.shifted(late), f"{late:.2f} s"


def _datum(gnss: GnssRecord, rng: np.random.Generator) -> tuple[GnssRecord, str]:
    east, north = 100.0 * rng.standard_normal(2)
    lon = gnss.lon + east / (METRES_PER_RADIAN * np.cos(gnss.lat))
    return replace(gnss, lat=gnss.lat + north / METRES_PER_RADIAN, lon=lon), f"{math.hypot(east, north):.0f} m"


def _spoofed(gnss: GnssRecord, rng: np.random.Generator) -> tuple[GnssRecord, str]:
    speed = rng.uniform(0.2, 2.0)
    away = speed * np.maximum(gnss.time - gnss.time[len(gnss) // 3], 0.0)
    v_n = None if gnss.v_n is None else gnss.v_n + speed * np.outer(away > 0.0, [0.0, 1.0, 0.0])
    return replace(gnss, lat=gnss.lat + away / METRES_PER_RADIAN, v_n=v_n), f"{speed:.2f} m/s"


def _wheel(name: str, factor: Callable[[np.random.Generator], float]) -> Fault:
    def spoil(log: OdometerRecord, rng: np.random.Generator) -> tuple[OdometerRecord, str]:
        k = factor(rng)
        return replace(log, values=k * log.values), f"{k:.3f}"

    return _log(name, "odometer", spoil)


def _slip(log: OdometerRecord, rng: np.random.Generator) -> tuple[OdometerRecord, str]:
    first, k = int(rng.uniform(0.3, 0.8) * len(log)), rng.uniform(0.0, 0.8)
    values = log.values.copy()
    values[first : first + len(log) // 20] *= k
    return replace(log, values=values), f"{k:.2f} for a twentieth"


def _angles(name: str, spoil: Callable[[Array, np.random.Generator], tuple[Array, str]]) -> Fault:
    def apply(log: EncoderRecord, rng: np.random.Generator) -> tuple[EncoderRecord, str]:
        angles, size = spoil(log.angles, rng)
        return replace(log, angles=angles), size

    return _log(name, "encoder", apply)


def _zero(angles: Array, rng: np.random.Generator) -> tuple[Array, str]:
    off = np.radians(rng.uniform(1.0, 20.0)) * rng.choice([-1.0, 1.0], angles.shape[1])
    return angles + off, f"{math.degrees(abs(off[0])):.1f} deg"


def _master(name: str, spoil: Callable[[MasterRecord, np.random.Generator], tuple[MasterRecord, str]]) -> Fault:
    return _log(name, "master", spoil)


def _turned_master(master: MasterRecord, rng: np.random.Generator) -> tuple[MasterRecord, str]:
    angle = math.radians(rng.uniform(0.5, 5.0))
    return replace(master, v_n=_turn_v(master.v_n, angle)), f"{math.degrees(angle):.2f} deg"


def _late_master(master: MasterRecord, rng: np.random.Generator) -> tuple[MasterRecord, str]:
    late = rng.uniform(0.3, 3.0)
    return master.shifted(late), f"{late:.2f} s"


def _swapped_master(master: MasterRecord, rng: np.random.Generator) -> tuple[MasterRecord, str]:
    assert master.v_n is not None
    return replace(master, v_n=master.v_n[:, [1, 0, 2]]), "V_E, V_N"


def _damaged_start(inputs: Inputs, rng: np.random.Generator) -> tuple[Inputs, str]:
    start, what = inputs["start"], int(rng.integers(4))
    if what == 0:
        return inputs | {"start": replace(start, C_nb=np.zeros((3, 3)))}, "zero matrix"
    if what == 1:
        P = start.P.copy()
        P[_axis(rng), _axis(rng)] = P[2, 2] = -1.0
        return inputs | {"start": replace(start, P=P)}, "negative variance"
    if what == 2:
        return inputs | {"start": replace(start, lat=-start.lat)}, "other hemisphere"
    return inputs | {"start": replace(start, C_nb=start.C_nb[::-1])}, "rows reversed"


RATE = math.radians(1.0) / 3600.0
FAULTS: tuple[Fault, ...] = (
    _exchanged("gyro"),
    _exchanged("accel"),
    _scaled("gyro sign", "gyro", lambda rng: -1.0),
    _scaled("accel sign", "accel", lambda rng: -1.0),
    _scaled("gyro scale", "gyro", lambda rng: 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.3)),
    _scaled("accel scale", "accel", lambda rng: 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.3)),
    _unit("gyro in deg/s", "gyro", math.degrees(1.0)),
    _unit("accel in g", "accel", 1.0 / 9.80665),
    _imu("clock rate", _clock_rate),
    _imu("clock jumps", _clock_jump),
    _imu("jitter", _jitter),
    _imu("late gyros", _late_gyros),
    _imu("held rows", _held),
    _imu("dropped rows", _dropped),
    _imu("doubled rows", _doubled),
    _imu("clipped gyro", _clipped),
    _imu("coarse quantum", _quantised),
    _imu("gyro bias step or ramp", lambda record, rng: _step(record, rng, "gyro", 0.1 * RATE, 50.0 * RATE)),
    _imu("accel bias step or ramp", lambda record, rng: _step(record, rng, "accel", 1e-4, 0.1)),
    _imu("dead sensor", lambda record, rng: _dead(record, rng, True)),
    _imu("stuck sensor", lambda record, rng: _dead(record, rng, False)),
    _imu("noisy for a while", _noisy),
    Fault("wrong latitude", "place", _latitude),
    Fault("wrong height", "place", _height),
    Fault("wrong specification", "imu", _specification),
    _log("grid north", "gnss", _grid_north),
    _log("late GNSS", "gnss", _shifted),
    _log("another datum", "gnss", _datum),
    _log("slowly spoofed", "gnss", _spoofed),
    _wheel("odometer scale", lambda rng: 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.4)),
    _wheel("odometer reversed", lambda rng: -1.0),
    _log("odometer slips", "odometer", _slip),
    _log("late odometer", "odometer", _shifted),
    _angles("encoder axes exchanged", lambda angles, rng: (angles[:, ::-1].copy(), "both")),
    _angles("encoder sign", lambda angles, rng: (angles * np.array([1.0, -1.0])[rng.permutation(2)], "one")),
    _angles("encoder zero", _zero),
    _log("encoder clock rate", "encoder", _clock_rate),
    _log("late encoder", "encoder", _shifted),
    _master("late master", _late_master),
    _master("turned master", _turned_master),
    _master("master's V_E and V_N exchanged", _swapped_master),
    Fault("damaged start", "start", _damaged_start),
)


def faults_of(inputs: Mapping[str, Any]) -> list[Fault]:
    """Those that can happen to these inputs."""
    return [fault for fault in FAULTS if fault.needs in inputs]
