"""Reader of GNSS logs: named columns in geodetic, earth-fixed or local coordinates, or NMEA 0183."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.paths import as_path, unreadable
from truenorth.core.position import Position
from truenorth.formats.aiding import NAVIGATION, PLACE, FilePath, Pairs, known, made, open_log, sigmas
from truenorth.formats.nmea import NMEA_SUFFIXES, is_nmea, read_nmea
from truenorth.formats.phone import PHONE, accuracies, speed_and_bearing
from truenorth.formats.places import check_degrees
from truenorth.formats.quantities import TIME, Found, Quantity
from truenorth.formats.zipped import of_folder, unpacked
from truenorth.records import GnssRecord
from truenorth.records.stale import without_stale

Array = NDArray[np.float64]

POS_U = ("posu_e", "posu_n", "posu_d")  # what VectorNav calls the standard deviations of a place
EARTH_FIXED = tuple(Quantity(f"ecef_{axis}", "length", "m", (), (), "ecef") for axis in "xyz")
EARTH_FIXED_VELOCITY = tuple(Quantity(f"ecef_v{axis}", "speed", "m/s", (), (), "ecef_velocity") for axis in "xyz")
LOCAL = (
    Quantity("east", "length", "m", ("pos_e",), ("west",), "local"),
    Quantity("north", "length", "m", ("pos_n",), ("south",), "local"),
    Quantity("up", "length", "m", ("pos_u",), ("down", "pos_d"), "local"),
)
TRACK = (
    Quantity("speed", "speed", "m/s", ("ground_speed", "sog")),
    Quantity("course", "angle", "deg", ("track", "cog", "course_over_ground")),
)
SIGMAS = (
    *(
        replace(q, aliases=(*q.aliases, name))
        for q, name in zip(sigmas(["E", "N", "U"], "length", "m", "sigma"), POS_U)
    ),
    *sigmas(["VE", "VN", "VU"], "speed", "m/s", "sigma_velocity"),
    *sigmas([q.name for q in EARTH_FIXED], "length", "m", "sigma"),
    *sigmas([q.name for q in EARTH_FIXED_VELOCITY], "speed", "m/s", "sigma_velocity"),
)
HEADING = (
    Quantity("heading", "angle", "deg", ("heading_true", "true_heading", "dual_heading", "baseline_heading", "hdt")),
    Quantity("sigma_heading", "angle", "deg", ("heading_sigma", "heading_std", "heading_accuracy", "heading_acc")),
)
BASELINE = (
    Quantity("baseline_E", "length", "m", ("rel_pos_e", "relpos_e", "baseline_east"), (), "baseline"),
    Quantity("baseline_N", "length", "m", ("rel_pos_n", "relpos_n", "baseline_north"), (), "baseline"),
    Quantity("baseline_U", "length", "m", ("baseline_up",), ("rel_pos_d", "relpos_d", "baseline_D"), "baseline"),
    *sigmas(["baseline_E", "baseline_N"], "length", "m", "baseline"),
)
BASELINE_SIGMA = 0.01  # m, of each axis of a baseline by carrier phases whose receiver says nothing
RECEIVER = (Quantity("hdop"), Quantity("vdop"), Quantity("quality", aliases=("fix", "fix_quality")))
ANTENNAS = (*HEADING, *BASELINE)
QUANTITIES = (
    *(
        TIME,
        *PLACE,
        *NAVIGATION,
        *TRACK,
        *PHONE,
        *SIGMAS,
        *ANTENNAS,
        *RECEIVER,
        *EARTH_FIXED,
        *EARTH_FIXED_VELOCITY,
        *LOCAL,
    ),
)


def read_gnss(
    path: FilePath,
    *,
    format: str | None = None,
    columns: Pairs | None = None,
    units: Pairs | None = None,
    origin: Position | None = None,
    topic: str | None = None,
) -> GnssRecord:
    """Read the log of a GNSS receiver.

    A table of named columns, NMEA 0183 (GGA, RMC, VTG, HDT, THS, ZDA), RTKLIB's ``.pos``, the GNSS text of KF-GINS, or a device's
    log (u-blox, Septentrio, NovAtel, VectorNav, PX4, ArduPilot, an Android phone, ROS, KITTI). Of a folder of sensors, or a zip
    archive of one, as phones write them, the file ``Location.csv`` or ``GPS.csv``.

    Columns ``time``; position as ``lat, lon`` (degrees) and ``alt``, as ``ecef_x, ecef_y, ecef_z``, or as metres ``east, north,
    up`` (or ``down``) from an `origin`; velocity as ``VE, VN, VU`` (or ``VD``), ``ecef_vx, ecef_vy, ecef_vz``, or ``speed`` and
    ``course``; standard deviations with ``sigma_`` before the names (``sigma_E, sigma_N, sigma_U`` of the position; of earth-fixed
    ones the correlation between the axes is not known and taken as none); ``hdop, vdop, quality``. Of two antennas ``heading`` with
    ``sigma_heading`` (without it, it may be the course, and is used only where `columns` names it), or their ``baseline_E,
    baseline_N, baseline_U``. Empty cells are absent values; a standard deviation of zero is an unknown one. Rows of quality 0 (no
    fix) lose their position and velocity. A fix that is written again while the vehicle goes on, by a receiver that hangs or a
    logger that is faster, is left out.

    Parameters
    ----------
    path, format, columns, units
        As for :func:`truenorth.read_odometer`; `units` also by group: ``"position=rad"``.
    origin : Position, optional
        Of local coordinates, which are taken in its tangent plane.
    topic : str, optional
        Of a ROS bag with several receivers.

    Returns
    -------
    GnssRecord
        Time is that of the file; in NMEA logs seconds since 1970 (UTC) where RMC or ZDA have dates, else from midnight of the first
        day.

    Raises
    ------
    UsageError
        No such file, an unknown format, column or unit; local coordinates without an origin.
    DataError
        Bad data: with file, line (or row) and column.
    """
    path = as_path(path, "log")
    try:
        by_content = format is None and path.is_file() and (path.suffix.lower() in NMEA_SUFFIXES or is_nmea(path))
        if format == "nmea" or by_content:
            return without_stale(read_nmea(path))
    except OSError as error:
        raise unreadable(path, error) from None
    given = {"columns": columns, "units": units, "topic": topic}
    with unpacked(path, "gnss") as log:
        file = of_folder(log, "gnss")
        found, _ = open_log(file, "csv" if format == "kf-gins" else format, QUANTITIES, given, "gnss")
    values = _geodetic(found) or _earth_fixed(found) or _local(found, origin)
    track, turned = _velocity(found), _heading(found)
    if not values and track is None and not turned:
        raise found.missing("time and lat, lon, alt, or VE, VN, VU")
    absent = np.full(len(found.values["time"]), np.nan)
    values = {"lat": absent, "lon": absent, "alt": absent, "v_n": track} | values | turned
    of_place, of_velocity = accuracies(found)
    values.setdefault("position_sigma", known(_or(found.stack("sigma_E", "sigma_N", "sigma_U"), of_place)))
    values.setdefault("velocity_sigma", known(_or(found.stack("sigma_VE", "sigma_VN", "sigma_VU"), of_velocity)))
    no_fix = found.values.get("quality", absent) == 0
    for name in ("lat", "lon", "alt", "v_n", "heading", "position_sigma", "velocity_sigma"):
        if values.get(name) is not None and no_fix.any():
            values[name] = np.where(no_fix if values[name].ndim == 1 else no_fix[:, None], np.nan, values[name])
    dop = known(found.stack("hdop", "vdop"))
    record: GnssRecord = made(found, GnssRecord, **values, dop=dop, quality=found.values.get("quality"))
    return without_stale(record)


def _or(first: Array | None, second: Array | None) -> Array | None:
    return second if first is None else first


def _heading(found: Found) -> dict[str, Any]:
    """Heading of two antennas, given or from their baseline.

    A column called heading without a sigma is, in many a receiver's log, the course over ground: it is left out.
    """
    if found.has("baseline_E", "baseline_N"):
        east, north = found.values["baseline_E"], found.values["baseline_N"]
        level = np.hypot(east, north)
        given = found.stack("sigma_baseline_E", "sigma_baseline_N")
        sigma = np.full((len(east), 2), BASELINE_SIGMA) if given is None else given
        across = np.hypot(north * sigma[:, 0], east * sigma[:, 1]) / np.where(level > 0.0, level, np.nan) ** 2
        return {"heading": np.where(level > 0.0, np.arctan2(east, north), np.nan), "heading_sigma": known(across)}
    sure = found.has("heading", "sigma_heading") or "heading" in found.asked
    if not (found.has("heading") and sure and np.isfinite(found.values["heading"]).any()):
        return {}
    return {"heading": found.values["heading"], "heading_sigma": known(found.values.get("sigma_heading"))}


def _geodetic(found: Found) -> dict[str, Any]:
    if not found.has("lat", "lon"):
        if "lat" in found.values or "lon" in found.values:
            raise found.missing("lon next to lat" if "lat" in found.values else "lat next to lon")
        return {}
    check_degrees(found)
    absent = np.full(len(found.values["time"]), np.nan)
    return {"lat": found.values["lat"], "lon": found.values["lon"], "alt": found.values.get("alt", absent)}


def _earth_fixed(found: Found) -> dict[str, Any]:
    """Place, velocity and their sigmas from earth-fixed coordinates."""
    place = [q.name for q in EARTH_FIXED]
    if not found.has(*place):
        return {}
    from truenorth.core.earth import ecef_axes, geodetic_from_ecef

    lat, lon, alt = geodetic_from_ecef(np.column_stack([found.values[name] for name in place]))
    C_ne = np.swapaxes(ecef_axes(lat, lon), -1, -2)
    values: dict[str, Any] = {"lat": lat, "lon": lon, "alt": alt}
    velocity = [q.name for q in EARTH_FIXED_VELOCITY]
    v_e = found.stack(*velocity)
    if v_e is not None:
        values["v_n"] = np.einsum("kij,kj->ki", C_ne, v_e)
    for ours, names in (("position_sigma", place), ("velocity_sigma", velocity)):
        sigma = known(found.stack(*(f"sigma_{name}" for name in names)))
        if sigma is not None:
            values[ours] = np.sqrt(np.einsum("kij,kj->ki", C_ne**2, sigma**2))
    return values


def _local(found: Found, origin: Position | None) -> dict[str, Any]:
    """Place from metres east, north, up of an origin."""
    if not found.has("east", "north"):
        return {}
    if origin is None:
        raise UsageError(
            f"{found.source}: local coordinates without an origin; give origin=Position.from_degrees(lat, lon, alt)"
        )
    from truenorth.core.earth import ecef_axes, ecef_from_geodetic, geodetic_from_ecef

    away = found.stack("east", "north", "up")
    assert away is not None
    flat = np.nan_to_num(away)  # without a height the place is that at the origin's
    start = ecef_from_geodetic(origin.lat, origin.lon, origin.alt)
    lat, lon, alt = geodetic_from_ecef(start + flat @ ecef_axes(origin.lat, origin.lon).T)
    here = np.isfinite(away[:, :2]).all(axis=1)
    return {
        "lat": np.where(here, lat, np.nan),
        "lon": np.where(here, lon, np.nan),
        "alt": np.where(here & np.isfinite(away[:, 2]), alt, np.nan),
    }


def _velocity(found: Found) -> Array | None:
    """Velocity in n, from its components, or from speed and course with the component up where the log has it."""
    v_n, of_phone = found.stack("VE", "VN", "VU"), speed_and_bearing(found)
    if not (found.has("VE") or found.has("VN")) and (of_phone is not None or found.has("speed", "course")):
        speed, course = of_phone or (found.values["speed"], found.values["course"])
        # A receiver that stands still leaves its course empty.
        course = np.where((speed == 0.0) & np.isnan(course), 0.0, course)
        up = found.values.get("VU", np.full(len(speed), np.nan))
        there = np.isfinite(course)
        angle, left = np.where(there, course, 0.0), np.where(there, 0.0, course)  # what is no number stays none
        v_n = np.column_stack([speed * np.sin(angle) + left, speed * np.cos(angle) + left, up])
    return v_n
