"""The real recordings next to the repository, as records; a test that needs one skips by name where it is missing."""

from pathlib import Path

import numpy as np
import pytest

from truenorth.core.position import Position
from truenorth.formats import read_gnss, read_master, read_odometer
from truenorth.records import GnssRecord, ImuRecord, MasterRecord, OdometerRecord

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
G = 9.80665


def _file(path: str) -> Path:
    file = DATA / path
    if not file.exists():
        pytest.skip(f"real recording {path} is not here (expected in ../shared/data)")
    return file


def _open(path: str):
    return np.load(_file(path))


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


def car_mems_odo_gnss() -> tuple[ImuRecord, OdometerRecord, GnssRecord]:
    """The IMU in its own tilted axes (FRD-like, turned to RFU); the receiver's place is about 59 N, not known better."""
    file = _file("car_mems_odo_gnss/car_0_150s.npz")
    z = np.load(file)
    imu = ImuRecord(z["imu_t"], z["gyro"], z["acc"], "rates", "car_mems_odo_gnss")
    odometer = read_odometer(file, columns={"time": "odo_t", "speed": "odo_speed"}, signed=False)
    columns = {"time": "gnss_t", "north": "gnss_pos_ned[0]", "east": "gnss_pos_ned[1]", "up": "-gnss_pos_ned[2]"}
    gnss = read_gnss(file, columns=columns, origin=Position.from_degrees(59.35, 18.07, 30.0))
    return imu.rotated([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), odometer, gnss


def fog_gps_xian_gnss() -> GnssRecord:
    columns = {"time": "gnss[0]", "lat": "gnss[1]", "lon": "gnss[2]", "alt": "gnss[3]"}
    columns |= {"VN": "gnss[4]", "VE": "gnss[5]", "VU": "-gnss[6]"}
    file = _file("fog_gps_xian/static_engine_0_68s.npz")
    return read_gnss(file, columns=columns, units="position=rad")


def stim300_cart_chicago_gnss() -> GnssRecord:
    """Of the antenna, 2 m above the IMU."""
    columns = {"time": "gps[0]"}
    for i, axis in enumerate("xyz"):
        columns |= {f"ecef_{axis}": f"gps[{1 + i}]", f"ecef_v{axis}": f"gps[{4 + i}]"}
        columns |= {f"sigma_ecef_{axis}": f"gps[{7 + i}]", f"sigma_ecef_v{axis}": f"gps[{10 + i}]"}
    return read_gnss(_file("stim300_cart_chicago/smooth_turn.npz"), columns=columns)


def transfer_fog_mems() -> tuple[ImuRecord, MasterRecord]:
    """The slave's log and the master's solution."""
    file = _file("transfer_fog_mems/transfer_0_50s.npz")
    mimu = np.load(file)["mimu"]
    slave = ImuRecord(mimu[:, 6], mimu[:, :3], mimu[:, 3:6], "increments", "transfer_fog_mems")
    names = ("pitch", "roll", "heading", "VE", "VN", "VU", "lat", "lon", "alt", "time")
    columns = {name: f"master[{i}]" for i, name in enumerate(names)} | {"heading": "-master[2]"}  # the source's is CCW
    return slave, read_master(file, columns=columns, units="attitude=rad,position=rad")
