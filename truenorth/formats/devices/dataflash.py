"""ArduPilot DataFlash (.bin, and the text made of it) by pymavlink: IMU and MAG of the first instance (axes FRD), GPS.

Time is the board's, s: ``TimeUS``, or ``TimeMS`` of versions before 3.3 (2015), whose GPS has the board's time as ``T`` and the
receiver's time of week as ``TimeMS``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

Array = NDArray[np.float64]

EXTRA = "ardupilot"
AXES = "FRD"
FIX_2D = 2
TEXT = b"FMT,"


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Rates and specific forces; position and velocity (height above mean sea level, as the board has it); magnetic field.

    Raises
    ------
    DataError
        Messages without a time of the board.
    """
    from pymavlink import DFReader

    with path.open("rb") as file:
        is_text = file.read(len(TEXT)) == TEXT
    log = (DFReader.DFReader_text if is_text else DFReader.DFReader_binary)(str(path), zero_time_base=True)
    imu: list[list[float]] = []
    gnss: list[list[float]] = []
    field: list[list[float]] = []
    try:
        while (m := log.recv_match(type=["IMU", "GPS", "MAG"])) is not None:
            if m.get_type() == "IMU" and getattr(m, "I", 0) == 0:
                imu.append([_time(m), m.GyrX, m.GyrY, m.GyrZ, m.AccX, m.AccY, m.AccZ])
            elif m.get_type() == "MAG" and getattr(m, "I", 0) == 0 and getattr(m, "Health", 1):
                field.append([_time(m), m.MagX, m.MagY, m.MagZ])
            elif part == "gnss" and m.get_type() == "GPS" and getattr(m, "I", 0) == 0 and m.Status >= FIX_2D:
                gnss.append([_time(m), m.Lat, m.Lng, m.Alt, m.Spd, m.GCrs, -m.VZ, m.Status])
    except _UntimedError as error:
        raise DataError(
            f"{path.name}: {error} have no time of the board among {error.fields}; expected TimeUS, TimeMS, or T of GPS"
        ) from None
    finally:
        log.close()
    if is_text:  # whose first message the decoder gives twice
        imu, gnss, field = (rows[1:] if rows[:1] == rows[1:2] else rows for rows in (imu, gnss, field))
    names = ["time [s]", *(f"gyro_{x} [rad/s]" for x in "xyz"), *(f"accel_{x} [m/s^2]" for x in "xyz")]
    found = {"imu": dict(zip(names, np.array(imu).T)) if imu else {}, "gnss": {}, "mag": {}}
    if field:
        found["mag"] = dict(zip(["time [s]", *(f"mag_{x} [mgauss]" for x in "xyz")], np.array(field).T))
    if gnss:
        t, lat, lon, alt, speed, course, vu, quality = np.array(gnss).T
        found["gnss"] = {
            "time [s]": t, "lat [deg]": lat, "lon [deg]": lon, "alt [m]": alt, "VE [m/s]": speed * np.sin(np.radians(course)),
            "VN [m/s]": speed * np.cos(np.radians(course)), "VU [m/s]": vu, "quality": quality,
        }  # fmt: skip
    return found


class _UntimedError(Exception):
    """Messages of a kind that say no time."""

    def __init__(self, message: Any) -> None:
        self.fields = ", ".join(message._fieldnames)
        super().__init__(f"messages {message.get_type()}")


def _time(message: Any) -> float:
    """Of the board, s."""
    for name, tick in (("TimeUS", 1e-6), ("T" if message.get_type() == "GPS" else "TimeMS", 1e-3)):
        if (count := getattr(message, name, None)) is not None:
            return float(count) * tick
    raise _UntimedError(message)
