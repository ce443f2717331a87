"""Records made for the tests of quality, and what was found in them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from tests import recordings
from truenorth.quality import Inspection
from truenorth.records import ImuRecord

G = 9.80665
LAT = np.radians(40.0)


def base(
    amplitude=(0.0, 0.0, 0.0),
    period=(6.0, 5.0, 9.0),
    duration=120.0,
    interval=0.01,
    arw=1e-5,
    vrw=1e-4,
    surge=None,
    seed=0,
) -> ImuRecord:
    """Pitch, roll, yaw oscillate about level with these amplitudes, deg; `surge(t)` accelerates along y."""
    rng = np.random.default_rng(seed)
    edges = np.arange(round(duration / interval) + 1) * interval
    phase = np.array([0.3, 1.1, 2.0])
    angles = np.radians(amplitude) * np.sin(2 * np.pi * edges[:, None] / np.array(period) + phase)
    C_nb = Rotation.from_euler("ZXY", angles[:, [2, 0, 1]])
    earth = np.array([0.0, np.cos(LAT), np.sin(LAT)]) * 7.292115e-5
    gyro = (C_nb[:-1].inv() * C_nb[1:]).as_rotvec() / interval + C_nb[1:].inv().apply(earth)
    force = np.tile([0.0, 0.0, G], (len(gyro), 1))
    if surge is not None:
        force[:, 1] += surge(edges[1:])
    accel = C_nb[1:].inv().apply(force)
    gyro = gyro + arw / np.sqrt(interval) * rng.standard_normal(gyro.shape)
    accel = accel + vrw / np.sqrt(interval) * rng.standard_normal(accel.shape)
    return ImuRecord(edges[1:], gyro, accel, "rates", "made for this test")


def changed(record: ImuRecord, gyro=1.0, accel=1.0, kind=None) -> ImuRecord:
    """`gyro` and `accel` scale or, as a matrix, turn the columns."""
    g = record.gyro * gyro if np.ndim(gyro) == 0 else record.gyro @ np.asarray(gyro).T
    return ImuRecord(record.time, g, record.accel * accel, kind or record.kind, record.source)


def as_increments(record: ImuRecord) -> ImuRecord:
    dt = record.interval
    return ImuRecord(record.time, record.gyro * dt, record.accel * dt, "increments", record.source)


def codes(inspection: Inspection, *severities: str) -> set[str]:
    return {f.code for f in inspection.findings if not severities or f.severity in severities}


def car() -> ImuRecord:
    z = recordings._open("car_mems_odo_gnss/car_0_150s.npz")
    return ImuRecord(z["imu_t"], z["gyro"], z["acc"], "rates", "car_mems_odo_gnss")
