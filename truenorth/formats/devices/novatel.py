"""NovAtel OEM logs, binary, ASCII or short, by novatel-edie: RAWIMU(S)(X), BESTPOS, BESTVEL, INSPVA(S)(X). Time of GPS week, s.

RAWIMU holds counts, whose size depends on the IMU: the reader asks for it. The second axis is written with the other sign, and z
first (OEM7 commands and logs reference manual); here they are x, y, z of the IMU.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXTRA = "novatel"
AXES = "RFU"


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """Counts of rates and forces; position and velocity; the solution of the INS."""
    from novatel_edie import oem

    rows: dict[str, list[list[float]]] = {"imu": [], "place": [], "velocity": [], "poses": []}
    for message in oem.FileParser(str(path)):
        name = getattr(message, "name", "")
        values = message.to_dict() if name.startswith(("RAWIMU", "BESTPOS", "BESTVEL", "INSPVA")) else None
        if values is None:
            continue
        header, body = values["header"], values["body"]
        tow = float(header.get("milliseconds", 0.0)) * 1e-3
        if name.startswith("RAWIMU"):
            rows["imu"].append([float(body.get("seconds", tow)), *_counts(body)])
        elif name.startswith("BESTPOS") and _solved(body):
            height = float(body["orthometric_height"]) + float(body["undulation"])
            sigmas = [float(body[f"{key}_std_dev"]) for key in ("longitude", "latitude", "height")]
            rows["place"].append([tow, float(body["latitude"]), float(body["longitude"]), height, *sigmas])
        elif name.startswith("BESTVEL") and _solved(body):
            speed, course = float(body["horizontal_speed"]), np.radians(float(body["track_ground"]))
            rows["velocity"].append(
                [tow, speed * np.sin(course), speed * np.cos(course), float(body["vertical_speed"])]
            )
        elif name.startswith("INSPVA"):
            rows["poses"].append(_pose(body, tow))
    return {"imu": _imu(rows["imu"]), "gnss": _gnss(rows["place"], rows["velocity"]), "poses": _poses(rows["poses"])}


def _solved(body: dict[str, Any]) -> bool:
    return "SOL_COMPUTED" in str(body.get("solution_status", "")) or str(body.get("solution_status")) == "0"


def _counts(body: dict[str, Any]) -> list[float]:
    def of(*names: str) -> float:
        return next(float(body[name]) for name in names if name in body)

    gyro = [
        of("x_gyro", "x_gyro_output"),
        -of("y_gyro", "minus_y_gyro_output", "y_gyro_output"),
        of("z_gyro", "z_gyro_output"),
    ]
    accel = [
        of("x_accel", "x_accel_output"),
        -of("y_accel", "minus_y_accel_output", "y_accel_output"),
        of("z_accel", "z_accel_output"),
    ]
    return [*gyro, *accel]


def _pose(body: dict[str, Any], tow: float) -> list[float]:
    def of(*names: str) -> float:
        return next(float(body[name]) for name in names if name in body)

    up = float(body["height"]) + float(
        body.get("undulation", 0.0)
    )  # INSPVA's height is the ellipsoid's, INSPVAX adds undulation
    return [
        float(body.get("seconds", tow)), of("latitude"), of("longitude"), up, of("east_velocity"), of("north_velocity"),
        of("up_velocity"), of("roll"), of("pitch"), of("azimuth"),
    ]  # fmt: skip


def _imu(rows: list[list[float]]) -> dict[str, Array]:
    names = ["time [s]", *(f"dtheta_{x}_counts" for x in "xyz"), *(f"dvel_{x}_counts" for x in "xyz")]
    names = [name.replace("_counts", "") for name in names]
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
