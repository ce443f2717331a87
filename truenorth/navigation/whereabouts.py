"""Whether logs are of the time of the navigation, and places of one journey with the start; and if not, what went wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid, Barometer, Gnss
from truenorth.aiding.source import Aiding
from truenorth.core.earth import ecef_from_geodetic
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.core.units import FOOT
from truenorth.navigation.given import record_of
from truenorth.records import GnssRecord, HeightRecord, ImuRecord
from truenorth.records.overlap import no_overlap
from truenorth.state.layout import DP
from truenorth.state.state import Start

Array = NDArray[np.float64]

FIXES = 5  # of the log's beginning that are looked at, by their median: one outlier says nothing
SIGMAS = 6.0
FASTEST, STEEPEST = 400.0, 30.0  # m/s, of a vehicle between the alignment's epoch and the fix
LEAST_FAR, LEAST_HIGH = 200.0, 50.0  # m
CLOSER = 0.01  # of the distance is left where a mistake is undone


def check_overlap(record: ImuRecord, aiding: Sequence[Aiding]) -> None:
    """Refuse measurements that all lie outside the navigated part of the log."""
    for sensor in aiding:
        inside = (sensor.time > record.time[0] - record.interval) & (sensor.time <= record.time[-1])
        if not inside.any():
            navigated = float(record.time[0] - record.interval), float(record.time[-1])
            raise no_overlap(
                sensor.name, (float(sensor.time.min()), float(sensor.time.max())), record.source, navigated
            )


def check_places(given: Mapping[str, Aid], begin: Start, altitude: str) -> None:
    """Refuse fixes and heights that lie far from where the alignment stands; `altitude`: how height is kept."""
    sigma = np.sqrt(np.diag(begin.P)[DP])
    place = Position(begin.lat, begin.lon, begin.alt, float(sigma[:2].max()), float(sigma[2]))
    if (gnss := record_of(given, Gnss)) is not None:
        check_fixes(gnss, place, begin.time, heights=altitude in ("gnss", "free"))
    if altitude == "baro" and (baro := record_of(given, Barometer)) is not None:
        check_heights(baro, place, begin.time)


def check_fixes(record: GnssRecord, place: Position, time: float, *, heights: bool = True) -> None:
    """Refuse GNSS fixes that no vehicle can have reached from the place where the log begins.

    Parameters
    ----------
    place : Position
        Of the IMU at `time`, with its sigmas.
    time : float, s
    heights : bool
        Compare heights too.

    Raises
    ------
    DataError
        With row and columns, both places, how far they lie apart, and what it looks like: columns exchanged, radians read as
        degrees, a sign, an alignment without its longitude or height.
    """
    rows = np.flatnonzero(record.has_position & (record.time >= time))[:FIXES]
    if rows.size == 0:
        return
    lat, lon, alt = record.lat[rows], record.lon[rows], record.alt[rows]
    passed = record.time[rows] - time
    # First fixes that are poor and say so lie as far off as they say.
    said = np.zeros((len(rows), 3)) if record.position_sigma is None else np.nan_to_num(record.position_sigma[rows])
    far = _distance(lat, lon, place)
    rough = np.hypot(place.horizontal_sigma, said[:, :2].max(axis=1))
    if np.median(far - FASTEST * passed - SIGMAS * rough) > LEAST_FAR:
        k = int(np.argsort(far)[len(far) // 2])
        raise DataError(
            f"{record.source}: row {rows[k] + 1}, columns lat and lon: {_degrees(lat[k], lon[k])}, {_apart(far[k])} from "
            f"{_degrees(place.lat, place.lon)}, where the alignment stands to {place.horizontal_sigma:g} m; expected the track to "
            f"begin there: {_mistake(float(lat[k]), float(lon[k]), place, float(far[k]))}"
        )
    if heights:
        _check_heights(record.source, rows, alt, passed, place, said[:, 2])


def check_heights(record: HeightRecord, place: Position, time: float) -> None:
    """Refuse heights of a barometer that lie far from where the log begins.

    Raises
    ------
    DataError
        As for :func:`check_fixes`.
    """
    rows = np.flatnonzero(record.time >= time)[:FIXES]
    _check_heights(record.source, rows, record.alt[rows], record.time[rows] - time, place, np.zeros(len(rows)))


def _check_heights(
    source: str, rows: NDArray[np.intp], alt: Array, passed: Array, place: Position, said: Array
) -> None:
    off = np.abs(alt - place.alt)
    known = np.isfinite(off)
    beyond = off - STEEPEST * passed - SIGMAS * np.hypot(place.vertical_sigma, said)
    if not known.any() or not np.median(beyond[known]) > LEAST_HIGH:
        return
    k = int(np.argsort(off)[known.sum() // 2])  # NaN is sorted behind
    if abs(alt[k] + place.alt) < CLOSER * off[k] + LEAST_HIGH:
        advice = "the heights seem to be counted downwards: name the column depth, or turn its sign"
    elif (
        abs(FOOT * alt[k] - place.alt)
        < CLOSER * off[k] + STEEPEST * passed[k] + SIGMAS * place.vertical_sigma
        < 0.5 * off[k]
    ):
        advice = "times 0.3048 they fit: the heights seem to be in feet (3.28 to a metre); give them in metres"
    else:
        advice = f"align with `alt` {alt[k]:.0f}, or with a `vertical_sigma` that says how rough that is"
    raise DataError(
        f"{source}: row {rows[k] + 1}, column alt: {alt[k]:.1f} m, {off[k]:.0f} m from {place.alt:.1f} m, where the alignment "
        f"stands to {place.vertical_sigma:g} m; expected the track to begin there: {advice}"
    )


def _distance(lat: Array, lon: Array, place: Position) -> Array:
    """Straight through the earth, m."""
    apart = ecef_from_geodetic(lat, lon, 0.0 * lat) - ecef_from_geodetic(place.lat, place.lon, 0.0)
    return np.asarray(np.linalg.norm(apart, axis=-1), dtype=np.float64)


def _mistake(lat: float, lon: float, place: Position, far: float) -> str:
    """What brings the places together."""
    turn = math.degrees(1.0)
    for lat_meant, lon_meant, words in (
        (lon, lat, "exchanged they fit: name the columns, lat is lon and lon is lat"),
        (lat * turn, lon * turn, "read as radians they fit: say so with units position=rad"),
        (lat, -lon, "with the longitude's other sign they fit: east is positive"),
        (-lat, lon, "with the latitude's other sign they fit: north is positive"),
    ):
        if abs(lat_meant) <= math.pi / 2 and _distance(np.array(lat_meant), np.array(lon_meant), place) < CLOSER * far:
            return words
    left_out = "was `lon` left out? " if place.lon == 0.0 else ""
    return (
        f"{left_out}align with `lat` {math.degrees(lat):.5f} `lon` {math.degrees(lon):.5f}, or with a `horizontal_sigma` that says "
        "how rough its place is"
    )


def _degrees(lat: float, lon: float) -> str:
    return f"{math.degrees(lat):.5f}, {math.degrees(lon):.5f} deg"


def _apart(metres: float) -> str:
    return f"{metres:.0f} m" if metres < 1e4 else f"{metres / 1e3:.0f} km"
