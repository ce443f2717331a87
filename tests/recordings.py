"""The real recordings beside the repository, as records; a test that needs one skips by name where it is missing."""

from pathlib import Path

import numpy as np
import pytest

from truenorth.position import Position
from truenorth.records import ImuRecord

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
G = 9.80665


def _open(path: str):
    file = DATA / path
    if not file.exists():
        pytest.skip(f"real recording {path} is not here (expected in ../shared/data)")
    return np.load(file)


def _record(gyro, accel, interval, kind, name) -> ImuRecord:
    time = interval * np.arange(1, len(gyro) + 1)
    return ImuRecord(time, gyro, accel, kind, name)


def rlg_vehicle_xian() -> tuple[ImuRecord, Position]:
    z = _open("rlg_vehicle_xian/rlg_0_900s.npz")
    values = z["counts"] * z["scale"]
    record = _record(values[:, :3], values[:, 3:], 0.01, "increments", "rlg_vehicle_xian")
    return record, Position.from_degrees(34.246048, 108.909664, 380.0)


def navgrade_static_beijing() -> tuple[ImuRecord, Position, dict[str, float]]:
    z = _open("navgrade_static_beijing/static_0_300s.npz")
    record = _record(z["gyro"] / 80, z["acc"] / 80, 1 / 80, "increments", "navgrade_static_beijing")
    given = {name: float(z[f"ref_{name}_deg"]) for name in ("pitch", "roll", "heading_cw")}
    return record, Position.from_degrees(39.975172, 116.344695283, 30.0), given


def fog_gps_xian() -> tuple[ImuRecord, Position]:
    z = _open("fog_gps_xian/static_engine_0_68s.npz")
    lat, lon, alt = z["gnss"][0, 1:4]
    record = _record(z["dtheta"], z["dvel"], 0.005, "increments", "fog_gps_xian")
    return record, Position(float(lat), float(lon), float(alt))


def static_adis16405() -> tuple[ImuRecord, Position]:
    z = _open("static_adis16405/adis16405_unit1_10000s.npz")
    values = z["counts"] * z["scale"]
    # z points down: FRD to RFU. Recorded in Calgary.
    gyro, accel = np.radians(values[:, [1, 0, 2]]) * [1, 1, -1], values[:, [4, 3, 5]] * [G, G, -G]
    record = _record(gyro, accel, 0.01, "rates", "static_adis16405")
    return record, Position.from_degrees(51.08, -114.13, 1100.0)


def xsens_four_headings(direction: str) -> tuple[ImuRecord, Position]:
    z = _open(f"xsens_four_headings/{direction}.npz")
    record = _record(z["gyro"], z["acc"], 0.01, "rates", f"xsens_four_headings/{direction}")
    return record, Position.from_degrees(23.05, 113.4, 20.0)


def stim300_cart_chicago() -> tuple[ImuRecord, Position]:
    z = _open("stim300_cart_chicago/smooth_turn.npz")
    record = ImuRecord(z["imu_t"], np.radians(z["gyro_dps"]), z["acc_g"] * G, "rates", "stim300_cart_chicago")
    return record, Position.from_degrees(41.8342, -87.6271, 180.0)


def mems_rotation_table() -> tuple[ImuRecord, Position]:
    z = _open("mems_rotation_table/static_and_rotation_0_162s.npz")
    values = z["counts"] * z["scale"]
    record = _record(np.radians(values[:, 3:]), values[:, :3] * G, 0.002, "rates", "mems_rotation_table")
    return record, Position.from_degrees(39.976419, 116.340561, 57.0)
