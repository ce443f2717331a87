"""PX4 ULog by pyulog: sensor_combined (IMU), sensor_gps or vehicle_gps_position, vehicle_magnetometer or sensor_mag.

Axes FRD. Time is the board's, s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXTRA = "px4"
AXES = "FRD"
GNSS = ("sensor_gps", "vehicle_gps_position")
FIELD = {"vehicle_magnetometer": "magnetometer_ga[{}]", "sensor_mag": "{}"}  # columns of x, y, z: gauss in both


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Rates and specific forces; position and velocity; the magnetic field."""
    from pyulog import ULog

    log = ULog(str(path), ["sensor_combined", *GNSS, *FIELD])
    data = {(topic.name, topic.multi_id): topic.data for topic in log.data_list}
    return {
        "imu": _imu(data.get(("sensor_combined", 0))),
        "gnss": _gnss(next((data[n, 0] for n in GNSS if (n, 0) in data), None)),
        "mag": next((_field(data[n, 0], FIELD[n]) for n in FIELD if (n, 0) in data), {}),
    }


def _field(data: dict[str, Any], name: str) -> dict[str, Array]:
    names = [name.format(i if "[" in name else axis) for i, axis in enumerate("xyz")]
    table = {"time [s]": data["timestamp"] * 1e-6}
    table |= {f"mag_{axis} [gauss]": data[theirs] for axis, theirs in zip("xyz", names)}
    return {ours: np.asarray(column, dtype=np.float64) for ours, column in table.items()}


def _imu(data: dict[str, Any] | None) -> dict[str, Array]:
    if data is None:
        return {}
    table = {"time [s]": data["timestamp"] * 1e-6}
    for i, axis in enumerate("xyz"):
        table[f"gyro_{axis} [rad/s]"] = data[f"gyro_rad[{i}]"]
        table[f"accel_{axis} [m/s^2]"] = data[f"accelerometer_m_s2[{i}]"]
    return {name: np.asarray(column, dtype=np.float64) for name, column in table.items()}


def _gnss(data: dict[str, Any] | None) -> dict[str, Array]:
    if data is None:
        return {}
    table = {"time [s]": data["timestamp"] * 1e-6, "quality": data["fix_type"]}
    if "latitude_deg" in data:
        table |= {
            "lat [deg]": data["latitude_deg"],
            "lon [deg]": data["longitude_deg"],
            "alt [m]": data["altitude_ellipsoid_m"],
        }
    else:  # until PX4 1.14: whole numbers of 1e-7 deg and mm
        table |= {
            "lat [deg]": data["lat"] * 1e-7,
            "lon [deg]": data["lon"] * 1e-7,
            "alt [m]": data["alt_ellipsoid"] * 1e-3,
        }
    table |= {"VE [m/s]": data["vel_e_m_s"], "VN [m/s]": data["vel_n_m_s"], "VD [m/s]": data["vel_d_m_s"]}
    table |= {
        "sigma_E [m]": data["eph"] / np.sqrt(2.0),
        "sigma_N [m]": data["eph"] / np.sqrt(2.0),
        "sigma_U [m]": data["epv"],
    }
    fixed = np.asarray(data["fix_type"]) >= 2
    return {name: np.asarray(column, dtype=np.float64)[fixed] for name, column in table.items()}
