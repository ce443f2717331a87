"""NovAtel OEM logs, binary, ASCII or short, by novatel-edie: RAWIMU(S)(X), BESTPOS, BESTVEL, INSPVA(S)(X). Time of GPS week, s.

RAWIMU holds counts, whose size depends on the IMU: the reader asks for it. The second axis is written with the other sign, and z
first (OEM7 commands and logs reference manual); here they are x, y, z of the IMU.
"""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXTRA = "novatel"
AXES = "RFU"
LONGEST_LINE = 4096  # bytes, of a log of text


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Counts of rates and forces; position and velocity; the solution of the INS."""
    from novatel_edie import oem

    atexit.unregister(gc.freeze)  # of the command line: the library's own count of what is left would call that leaked

    rows: dict[str, list[list[float]]] = {"imu": [], "place": [], "velocity": [], "poses": []}
    for message in _text_messages(path) if _has_bare_lines(path) else oem.FileParser(str(path)):
        name = getattr(message, "name", "")
        values = message.to_dict() if name.startswith(("RAWIMU", "BESTPOS", "BESTVEL", "INSPVA")) else None
        if values is None:
            continue
        tow = float(values["header"].get("milliseconds", 0.0)) * 1e-3
        if name.startswith("RAWIMU"):
            rows["imu"].append([float(values["gps_seconds"]), *_counts(values)])
        elif name.startswith("BESTPOS") and _solved(values):
            height = _height(values)
            sigmas = [float(values[f"{key}_std_dev"]) for key in ("longitude", "latitude", "height")]
            rows["place"].append([tow, float(values["latitude"]), float(values["longitude"]), height, *sigmas])
        elif name.startswith("BESTVEL") and _solved(values):
            speed, course = float(values["horizontal_speed"]), np.radians(float(values["ground_track"]))
            rows["velocity"].append([tow, speed * np.sin(course), speed * np.cos(course), float(values["z"])])
        elif name.startswith("INSPVA"):
            rows["poses"].append(_pose(values, tow))
    return {"imu": _imu(rows["imu"]), "gnss": _gnss(rows["place"], rows["velocity"]), "poses": _poses(rows["poses"])}


def _has_bare_lines(path: Path) -> bool:
    """Whether the log is text whose carriage returns an editor or a version control took away: the decoder wants them."""
    with path.open("rb") as file:
        first = file.readline(LONGEST_LINE)
    return first[:1] in (b"#", b"%") and first.endswith(b"\n") and not first.endswith(b"\r\n")


def _text_messages(path: Path) -> Iterator[Any]:
    """The messages of a log of text, each line ended as the receiver ends it."""
    from novatel_edie import oem

    parser = oem.Parser()
    with path.open("rb") as file:
        for line in file:
            parser.write(line.rstrip(b"\r\n") + b"\r\n")
            yield from parser


def _solved(values: dict[str, Any]) -> bool:
    said = next((values[name] for name in ("solution_status", "status", "velocity_status") if name in values), 1)
    return int(said) == 0


def _height(values: dict[str, Any]) -> float:
    """Above the ellipsoid: older firmware calls that above mean sea level ``height``, too, where an undulation stands by it."""
    above = values["height"] if "height" in values else values["orthometric_height"]
    return float(above) + float(values.get("undulation", 0.0))


def _counts(values: dict[str, Any]) -> list[float]:
    """x, y and z of gyros and accelerometers."""
    long = "del_ang_body_x" in values
    gyro, accel = ("del_ang_body", "del_vel_body") if long else ("gyro", "accel")
    signs = {"x": 1.0, "y": -1.0, "z": 1.0}
    return [signs[axis] * float(values[f"{sensor}_{axis}"]) for sensor in (gyro, accel) for axis in "xyz"]


def _pose(values: dict[str, Any], tow: float) -> list[float]:
    names = ("latitude", "longitude", "", "east_vel", "north_vel", "up_vel", "roll", "pitch", "azimuth")
    return [float(values.get("seconds", tow)), *(float(values[name]) if name else _height(values) for name in names)]


def _imu(rows: list[list[float]]) -> dict[str, Array]:
    names = [
        "time [s]",
        *(f"d_theta_{x}" for x in "xyz"),
        *(f"d_vel_{x}" for x in "xyz"),
    ]  # no names of ours: these mean SI
    return dict(zip(names, np.array(rows).T)) if rows else {}


def _gnss(places: list[list[float]], velocities: list[list[float]]) -> dict[str, Array]:
    if not places:
        return {}
    names = ("time [s]", "lat [deg]", "lon [deg]", "alt [m]", "sigma_E [m]", "sigma_N [m]", "sigma_U [m]")
    table = dict(zip(names, np.array(places).T))
    by_time = {row[0]: row[1:] for row in velocities}
    found = np.array([by_time.get(row[0], [np.nan] * 3) for row in places])
    return table | dict(zip(("VE [m/s]", "VN [m/s]", "VU [m/s]"), found.T))


def _poses(rows: list[list[float]]) -> dict[str, Array]:
    names = ("time [s]", "lat [deg]", "lon [deg]", "alt [m]", "VE [m/s]", "VN [m/s]", "VU [m/s]", "roll [deg]", "pitch [deg]",
             "heading [deg]")  # fmt: skip
    return dict(zip(names, np.array(rows).T)) if rows else {}
