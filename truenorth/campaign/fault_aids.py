"""Faults of what is given besides the IMU's log: place, specification, arms, aiding sensors, a start."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.fault import Fault, Inputs, Rng, clock_rate, either, of_log, over_decades
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import METRES_PER_RADIAN
from truenorth.records import EncoderRecord, GnssRecord, MasterRecord, OdometerRecord
from truenorth.state.mounting import mounting_angles

Array = NDArray[np.float64]


# --------------------------------------------------------------------------------------------- place and specification


def _latitude(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    off, place = math.radians(either(rng, 1.0, 30.0)), inputs["place"]
    return inputs | {
        "place": replace(place, lat=float(np.clip(place.lat + off, -1.4, 1.4)))
    }, f"{math.degrees(off):+.1f} deg"


def _hemisphere(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    return inputs | {"place": replace(inputs["place"], lat=-inputs["place"].lat)}, "sign"


def _height(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    off = rng.uniform(500.0, 5000.0)
    return inputs | {"place": replace(inputs["place"], alt=inputs["place"].alt + off)}, f"{off:.0f} m"


def _specification(name: str, k: float) -> Fault:
    """Biases and noise of a specification times k."""
    names = [f"{sensor}_{term}" for sensor in ("gyro", "accel") for term in ("bias", "random_walk", "bias_instability")]

    def apply(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
        spec = inputs["imu"]
        return inputs | {"imu": replace(spec, **{name: k * getattr(spec, name) for name in names})}, f"times {k:g}"

    return Fault(name, "imu", apply)


def _arm(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    """An arm that is said to be known, and is another's."""
    arm = rng.standard_normal(3)
    arm *= rng.uniform(1.0, 8.0) / np.linalg.norm(arm)
    return inputs | {"mounting": replace(inputs["mounting"], lever_arm=arm)}, f"{np.linalg.norm(arm):.1f} m"


def _mounted(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    """An IMU that is said to look straight ahead, and does not."""
    angle = math.radians(either(rng, 1.0, 20.0))
    turned = replace(inputs["turned"], C_mb=mounting_angles(angle))
    return inputs | {"turned": turned, "mounting": turned}, f"{math.degrees(angle):+.1f} deg"


# -------------------------------------------------------------------------------------------------------- aiding sensors


def _turn_v(v: Array | None, angle: float) -> Array | None:
    return None if v is None else v @ dcm_from_rotation_vector(np.array([0.0, 0.0, angle])).T


def _grid_north(gnss: GnssRecord, rng: Rng) -> tuple[GnssRecord, str]:
    angle = rng.choice([-1.0, 1.0]) * math.radians(rng.uniform(0.5, 3.0))
    return replace(gnss, v_n=_turn_v(gnss.v_n, angle)), f"{math.degrees(angle):+.2f} deg"


def _shifted(record: Any, rng: Rng) -> tuple[Any, str]:
    late = either(rng, 0.3, 2.0)
    return record.shifted(late), f"{late:+.2f} s"


def _datum(gnss: GnssRecord, rng: Rng) -> tuple[GnssRecord, str]:
    east, north = 100.0 * rng.standard_normal(2)
    lon = gnss.lon + east / (METRES_PER_RADIAN * np.cos(gnss.lat))
    return replace(gnss, lat=gnss.lat + north / METRES_PER_RADIAN, lon=lon), f"{math.hypot(east, north):.0f} m"


def _spoofed(gnss: GnssRecord, rng: Rng) -> tuple[GnssRecord, str]:
    speed = over_decades(rng, 0.02, 2.0)
    away = speed * np.maximum(gnss.time - gnss.time[len(gnss) // 3], 0.0)
    v_n = None if gnss.v_n is None else gnss.v_n + speed * np.outer(away > 0.0, [0.0, 1.0, 0.0])
    return replace(gnss, lat=gnss.lat + away / METRES_PER_RADIAN, v_n=v_n), f"{speed:.2f} m/s"


def _wheel(name: str, factor: Callable[[Rng], float]) -> Fault:
    def spoil(log: OdometerRecord, rng: Rng) -> tuple[OdometerRecord, str]:
        k = factor(rng)
        return replace(log, values=k * log.values), f"{k:.3f}"

    return of_log(name, "odometer", spoil)


def _slip(log: OdometerRecord, rng: Rng) -> tuple[OdometerRecord, str]:
    first, k = int(rng.uniform(0.3, 0.8) * len(log)), rng.uniform(0.0, 0.8)
    values = log.values.copy()
    values[first : first + len(log) // 20] *= k
    return replace(log, values=values), f"{k:.2f} for a twentieth"


def _angles(name: str, spoil: Callable[[Array, Rng], tuple[Array, str]]) -> Fault:
    def apply(log: EncoderRecord, rng: Rng) -> tuple[EncoderRecord, str]:
        angles, size = spoil(log.angles, rng)
        return replace(log, angles=angles), size

    return of_log(name, "encoder", apply)


def _zero(name: str, axis: int) -> Fault:
    def spoil(angles: Array, rng: Rng) -> tuple[Array, str]:
        off = either(rng, 1.0, 20.0)
        return angles + math.radians(off) * np.eye(2)[axis], f"{off:+.1f} deg"

    return _angles(name, spoil)


def _slipping(angles: Array, rng: Rng) -> tuple[Array, str]:
    axis, row, off = int(rng.integers(2)), int(rng.uniform(0.1, 0.9) * len(angles)), over_decades(rng, 0.02, 5.0)
    slipped = angles.copy()
    slipped[row:, axis] += rng.choice([-1.0, 1.0]) * math.radians(off)
    return slipped, f"{off:.2f} deg of the {('outer', 'inner')[axis]} axis"


def _speed_unit(record: Any, rng: Rng, field: str) -> tuple[Any, str]:
    unit, k = (("km/h", 3.6), ("knots", 1.9438), ("cm/s", 100.0))[int(rng.integers(3))]
    return replace(record, **{field: k * getattr(record, field)}), unit


def _bent(master: MasterRecord, rng: Rng) -> tuple[MasterRecord, str]:
    """A structure that bends between master and slave: the arm swings."""
    assert master.v_n is not None
    size, f, phase = over_decades(rng, 0.01, 0.5), rng.uniform(0.3, 2.0), rng.uniform(0.0, 2.0 * math.pi)
    w = 2.0 * math.pi * f
    swing = size * w * np.cos(w * master.time + phase)
    return replace(master, v_n=master.v_n + np.outer(swing, [0.3, 0.3, 0.9])), f"{size:.2f} m at {f:.1f} Hz"


def _master(name: str, spoil: Callable[[MasterRecord, Rng], tuple[MasterRecord, str]]) -> Fault:
    return of_log(name, "master", spoil)


def _turned_master(master: MasterRecord, rng: Rng) -> tuple[MasterRecord, str]:
    angle = math.radians(rng.uniform(0.5, 5.0))
    return replace(master, v_n=_turn_v(master.v_n, angle)), f"{math.degrees(angle):.2f} deg"


def _late_master(master: MasterRecord, rng: Rng) -> tuple[MasterRecord, str]:
    late = either(rng, 0.3, 3.0)
    return master.shifted(late), f"{late:+.2f} s"


def _swapped_master(master: MasterRecord, rng: Rng) -> tuple[MasterRecord, str]:
    assert master.v_n is not None
    return replace(master, v_n=master.v_n[:, [1, 0, 2]]), "V_E, V_N"


def _turned_start(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    angle, start = math.radians(either(rng, 1.0, 30.0)), inputs["start"]
    turned = dcm_from_rotation_vector(np.array([0.0, 0.0, angle])) @ start.C_nb
    return inputs | {"start": replace(start, C_nb=turned)}, f"{math.degrees(angle):+.1f} deg"


def _damaged_start(inputs: Inputs, rng: Rng) -> tuple[Inputs, str]:
    start, what = inputs["start"], int(rng.integers(4))
    if what == 0:
        return inputs | {"start": replace(start, C_nb=np.zeros((3, 3)))}, "zero matrix"
    if what == 1:
        P = start.P.copy()
        P[0, 0] = P[2, 2] = -1.0
        return inputs | {"start": replace(start, P=P)}, "negative variance"
    if what == 2:
        return inputs | {"start": replace(start, lat=-start.lat)}, "other hemisphere"
    return inputs | {"start": replace(start, C_nb=start.C_nb[::-1])}, "rows reversed"


def _height_drifts(log: GnssRecord, rng: Rng) -> tuple[GnssRecord, str]:
    rise = either(rng, 3.0, 60.0)
    return replace(log, alt=log.alt + rise * (log.time - log.time[0]) / log.duration), f"{rise:.1f} m"


AID_FAULTS: tuple[Fault, ...] = (
    Fault("wrong latitude", "place", _latitude),
    Fault("wrong hemisphere", "place", _hemisphere),
    Fault("wrong height", "place", _height),
    _specification("specification ten times too good", 0.1),
    _specification("specification ten times too bad", 10.0),
    Fault("wrong arm", "mounting", _arm),
    Fault("wrong mounting", "turned", _mounted),
    of_log("grid north", "gnss", _grid_north),
    of_log("late GNSS", "gnss", _shifted),
    of_log("GNSS clock rate", "gnss", clock_rate),
    of_log("another datum", "gnss", _datum),
    of_log("slowly spoofed", "gnss", _spoofed),
    of_log("GNSS height drifts", "gnss", _height_drifts),
    of_log("GNSS velocity in another unit", "gnss", lambda log, rng: _speed_unit(log, rng, "v_n")),
    _wheel("odometer scale", lambda rng: 1.0 + either(rng, 0.05, 0.4)),
    _wheel("odometer reversed", lambda rng: -1.0),
    of_log("odometer in another unit", "odometer", lambda log, rng: _speed_unit(log, rng, "values")),
    of_log("odometer slips", "odometer", _slip),
    of_log("late odometer", "odometer", _shifted),
    of_log("odometer clock rate", "odometer", clock_rate),
    _angles("encoder axes exchanged", lambda angles, rng: (angles[:, ::-1].copy(), "both")),
    _angles("encoder sign", lambda angles, rng: (angles * np.array([1.0, -1.0])[rng.permutation(2)], "one")),
    _angles("encoder in degrees", lambda angles, rng: (np.degrees(angles), "both")),
    _zero("zero of the outer angle", 0),
    _zero("zero of the inner angle", 1),
    _angles("encoder slips", _slipping),
    of_log("encoder clock rate", "encoder", clock_rate),
    of_log("late encoder", "encoder", _shifted),
    _master("late master", _late_master),
    _master("master's clock rate", clock_rate),
    _master("turned master", _turned_master),
    _master("master's V_E and V_N exchanged", _swapped_master),
    _master("master's velocity in another unit", lambda log, rng: _speed_unit(log, rng, "v_n")),
    _master("bent master", _bent),
    Fault("damaged start", "start", _damaged_start),
    Fault("turned start", "start", _turned_start),
)
