"""MAVLink telemetry (.tlog) by pymavlink: HIGHRES_IMU or SCALED_IMU (axes FRD, with their magnetometer), GPS_RAW_INT.

Time is the board's, s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXTRA = "ardupilot"
AXES = "FRD"
FIX_2D = 2
NOT_KNOWN = 65535


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Rates and specific forces; position and velocity; the magnetic field."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(path))
    rows: dict[str, list[list[float]]] = {"HIGHRES_IMU": [], "SCALED_IMU": [], "GPS_RAW_INT": []}
    fields: dict[str, list[list[float]]] = {"HIGHRES_IMU": [], "SCALED_IMU": []}
    try:
        while (m := log.recv_match(type=list(rows))) is not None:
            kind = m.get_type()
            if kind == "HIGHRES_IMU":
                rows[kind].append([m.time_usec * 1e-6, m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc])
                _add_field(fields[kind], m.time_usec * 1e-6, m)
            elif kind == "SCALED_IMU":
                rows[kind].append([m.time_boot_ms * 1e-3, m.xgyro, m.ygyro, m.zgyro, m.xacc, m.yacc, m.zacc])
                _add_field(fields[kind], m.time_boot_ms * 1e-3, m)
            elif m.fix_type >= FIX_2D:
                moving = m.vel != NOT_KNOWN and m.cog != NOT_KNOWN
                speed, course = (m.vel * 1e-2, np.radians(m.cog * 1e-2)) if moving else (np.nan, np.nan)
                place = [m.lat * 1e-7, m.lon * 1e-7, m.alt * 1e-3]
                rows[kind].append(
                    [m.time_usec * 1e-6, *place, speed * np.sin(course), speed * np.cos(course), m.fix_type]
                )
    finally:
        log.close()
    fine = bool(rows["HIGHRES_IMU"])
    rate, force = ("rad/s", "m/s^2") if fine else ("mrad/s", "mg")
    imu = rows["HIGHRES_IMU" if fine else "SCALED_IMU"]
    sensors = ["time [s]", *(f"gyro_{x} [{rate}]" for x in "xyz"), *(f"accel_{x} [{force}]" for x in "xyz")]
    places = ["time [s]", "lat [deg]", "lon [deg]", "alt [m]", "VE [m/s]", "VN [m/s]", "quality"]
    gnss = rows["GPS_RAW_INT"]
    mag = fields["HIGHRES_IMU" if fine else "SCALED_IMU"]
    unit = "gauss" if fine else "mgauss"
    return {
        "imu": dict(zip(sensors, np.array(imu).T)) if imu else {},
        "gnss": dict(zip(places, np.array(gnss).T)) if gnss else {},
        "mag": dict(zip(["time [s]", *(f"mag_{x} [{unit}]" for x in "xyz")], np.array(mag).T)) if mag else {},
    }


def _add_field(rows: list[list[float]], t: float, m: Any) -> None:
    """A new reading: a board sends the last one again with each sample of its gyros, and zeros where it has none."""
    field = [m.xmag, m.ymag, m.zmag]
    if any(field) and (not rows or rows[-1][1:] != field):
        rows.append([t, *field])
