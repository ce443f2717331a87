"""Readers of attitude, velocity and place over time: the solution of a master INS, a trajectory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.aiding import NAVIGATION, PLACE, FilePath, Pairs, known, made, open_log, sigmas, turned, whole
from truenorth.formats.guesses import UnsureError
from truenorth.formats.places import check_degrees
from truenorth.formats.quantities import TIME, Found, Quantity
from truenorth.records import MasterRecord, Trajectory

Array = NDArray[np.float64]

ANGLES = (
    Quantity("heading", "angle", "deg", ("heading_cw", "azimuth", "true_heading", "hdg"), ("yaw_ccw",), "attitude"),
    Quantity("yaw", "angle", "deg", (), (), "attitude"),  # which way it counts it does not say
    Quantity("pitch", "angle", "deg", (), (), "attitude"),
    Quantity("roll", "angle", "deg", (), (), "attitude"),
)
QUATERNION = tuple(Quantity(f"q_{axis}", aliases=(f"q{axis}",)) for axis in "wxyz")
SENSORS = (
    *(Quantity(f"gyro_{axis}", "angular_rate", "rad/s", (), (), "gyro") for axis in "xyz"),
    *(Quantity(f"accel_{axis}", "acceleration", "m/s^2", (), (), "accel") for axis in "xyz"),
)
POSES = (TIME, *PLACE, *NAVIGATION, *ANGLES, *QUATERNION)
OWN_SIGMAS = (
    *sigmas(["heading", "pitch", "roll"], "angle", "deg", "sigma_attitude"),
    *sigmas(["VE", "VN", "VU"], "speed", "m/s", "sigma_velocity"),
)


def read_master(
    path: FilePath,
    *,
    format: str | None = None,
    columns: Pairs | None = None,
    units: Pairs | None = None,
    axes: str | None = None,
) -> MasterRecord:
    """Read the solution of a master INS.

    Columns ``time`` and attitude (``heading, pitch, roll`` in degrees, heading clockwise from north, or ``yaw_ccw``; or
    ``q_w, q_x, q_y, q_z``, which turns right-forward-up into east-north-up), velocity (``VE, VN, VU`` or ``VD``), position
    (``lat, lon`` in degrees, ``alt``), and the master's own ``gyro_x .. accel_z``; each group whole or not at all. With
    ``sigma_`` before the names of angles and velocities the standard deviations of its own filter.

    Parameters
    ----------
    path, format, columns, units
        As for :func:`read_odometer`; `units` also by group: ``"attitude=rad,position=rad"``.
    axes : str, optional
        Where x, y and z of the master's gyros and accelerometers point; RFU when left out.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    found, others = open_log(
        path, format, (*POSES, *SENSORS, *OWN_SIGMAS), {"columns": columns, "units": units, "axes": axes}, "poses"
    )
    values = _poses(found)
    values["attitude_sigma"] = known(found.stack(*(f"sigma_{angle}" for angle in ("heading", "pitch", "roll"))))
    values["velocity_sigma"] = known(found.stack("sigma_VE", "sigma_VN", "sigma_VU"))
    for ours, sensor in (("w_ib_b", "gyro"), ("f_b", "accel")):
        values[ours] = turned(whole(found, *(f"{sensor}_{axis}" for axis in "xyz")), others.get("axes"))
    if values["C_nb"] is None and values["v_n"] is None:
        raise found.missing("time and attitude (heading, pitch, roll) or velocity (VE, VN, VU) or both")
    return made(found, MasterRecord, **values)


def read_trajectory(
    path: FilePath, *, format: str | None = None, columns: Pairs | None = None, units: Pairs | None = None
) -> Trajectory:
    """Read a trajectory: truth or a solution, such as the ``truth.parquet`` of a simulated run.

    Columns ``time, lat, lon, alt, VE, VN, VU, roll, pitch, heading`` (or ``q_w .. q_z``), angles in degrees.

    Raises
    ------
    UsageError, DataError
        As for :func:`read_odometer`.
    """
    found, _ = open_log(path, format, POSES, {"columns": columns, "units": units}, "poses")
    values = _poses(found)
    for name, what in (("C_nb", "heading, pitch, roll"), ("v_n", "VE, VN, VU"), ("lat", "lat, lon, alt")):
        if values[name] is None:
            raise found.missing(what)
    return made(found, Trajectory, **values)


def _poses(found: Found) -> dict[str, Any]:
    from truenorth.core.attitude import dcm_from_euler, dcm_from_quaternion

    if found.has("yaw") and not found.has("heading"):
        label = found.labels["yaw"]
        raise UnsureError(
            f"{found.source}: column {label} may count clockwise from north, as a heading does, or the other way; say which, in a "
            "YAML file next to the log, or to the reader",
            [{"columns": {"heading": label}}, {"columns": {"heading": f"-{label}"}}],
        )
    angles, q = whole(found, "heading", "pitch", "roll"), whole(found, "q_w", "q_x", "q_y", "q_z")
    C_nb = None
    if q is not None:
        norm = np.linalg.norm(q, axis=1)
        bad = np.flatnonzero(~(np.abs(norm - 1.0) < 1e-3))
        if bad.size:
            raise DataError(
                f"{found.source}: {found.place(int(bad[0]))}: a quaternion of norm {norm[bad[0]]:.6g}; expected 1: repair the log"
            )
        C_nb = dcm_from_quaternion(q / norm[:, None])
    elif angles is not None:
        C_nb = dcm_from_euler(*angles.T)
    place = whole(found, "lat", "lon", "alt")
    lat, lon, alt = (None, None, None) if place is None else place.T
    if place is not None:
        check_degrees(found)
    return {"C_nb": C_nb, "v_n": whole(found, "VE", "VN", "VU"), "lat": lat, "lon": lon, "alt": alt}
