"""Way-points of a route from a file: CSV with a header, or GPX (routes, tracks, way-points)."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from truenorth.core.earth import SEMI_MAJOR
from truenorth.core.errors import DataError, UsageError
from truenorth.core.yaml_file import unknown_key
from truenorth.simulation.route import WayPoint

# Columns of a CSV file by the field of a way-point; angles in degrees.
COLUMNS = {
    "lat": ("lat", "lat_deg", "latitude"),
    "lon": ("lon", "lon_deg", "longitude"),
    "alt": ("alt", "alt_m", "altitude", "ele", "height"),
    "speed": ("speed", "speed_m_s"),
    "stop": ("stop", "stop_s"),
}
LIMITS = {"lat": (-89.5, 89.5), "lon": (-360.0, 360.0), "alt": (-12e3, 5e4), "speed": (0.01, 1e3), "stop": (0.0, 1e6)}
GPX_POINTS = ("rtept", "trkpt", "wpt")


def read_waypoints(path: str | PathLike[str], spacing: float | None = None) -> list[WayPoint]:
    """Way-points of a CSV or GPX file.

    Parameters
    ----------
    path : str or path
        A ``.csv`` has a header with lat, lon (deg) and, where wanted, alt (m), speed (m/s), stop (s); an empty cell is a
        value not given. Of a ``.gpx`` the route is taken, else the track, else the way-points.
    spacing : float, m, optional
        Points closer to the last one kept are left out; 10 m for the track of a receiver, which wanders, else none.

    Raises
    ------
    UsageError
        The file cannot be opened, or its suffix is neither.
    DataError
        A column that is missing or unknown, a cell that is no number or out of range, a GPX that is not XML or has no
        points: the message names file, row and column.
    """
    path = Path(path)
    readers = {".csv": _read_csv, ".gpx": _read_gpx}
    if path.suffix.lower() not in readers:
        raise UsageError(f"{path}: way-points come as .csv or .gpx; found the suffix {path.suffix!r}")
    try:
        points, measured = readers[path.suffix.lower()](path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise DataError(f"{path}: not a text file; expected {path.suffix} text in UTF-8") from None
    if spacing is None:
        spacing = 10.0 if measured else 0.0
    points = thinned(points, spacing)
    if len(points) < 2:
        raise DataError(f"{path}: {len(points)} way-point(s) at least {spacing:g} m apart; expected two or more")
    return points


def thinned(points: Sequence[WayPoint], spacing: float) -> list[WayPoint]:
    """Those at least `spacing` (m) from the last one kept."""
    kept: list[WayPoint] = []
    for point in points:
        if kept:
            last = kept[-1]
            north, east = point.lat - last.lat, (point.lon - last.lon) * math.cos(point.lat)
            if SEMI_MAJOR * math.hypot(north, east) < spacing:
                continue
        kept.append(point)
    return kept


def _read_csv(path: Path) -> tuple[list[WayPoint], bool]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = list(csv.reader(file))
    if not rows:
        raise DataError(f"{path}: the file is empty; expected a header with lat and lon")
    names = {alias: name for name, aliases in COLUMNS.items() for alias in aliases}
    header = [cell.strip().lower() for cell in rows[0]]
    for column, cell in enumerate(header, 1):
        if cell not in names:
            raise DataError(unknown_key(f"{path}: row 1, column {column}", cell, names))
    fields = [names[cell] for cell in header]
    for name in ("lat", "lon"):
        if fields.count(name) != 1:
            raise DataError(
                f"{path}: row 1: {fields.count(name)} columns for {name}; expected one named {name}, in degrees"
            )
    points = []
    for number, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(fields):
            raise DataError(f"{path}: row {number}: {len(row)} cells; the header has {len(fields)}")
        cells = {name: cell.strip() for name, cell in zip(fields, row, strict=True) if cell.strip()}
        points.append(
            _point(
                {name: _number(cell, name, f"{path}: row {number}") for name, cell in cells.items()},
                f"{path}: row {number}",
            )
        )
    return points, False


def _read_gpx(path: Path) -> tuple[list[WayPoint], bool]:
    from xml.etree import ElementTree

    try:
        root = ElementTree.fromstring(path.read_text(encoding="utf-8-sig"))
    except ElementTree.ParseError as error:
        raise DataError(
            f"{path}: not a GPX file: line {error.position[0]}, column {error.position[1]}: {error}"
        ) from None
    for tag in GPX_POINTS:
        found = [element for element in root.iter() if element.tag.rpartition("}")[2] == tag]
        if not found:
            continue
        points = []
        for number, element in enumerate(found, 1):
            where = f"{path}: {tag} {number}"
            values = {name: _number(element.get(name), name, where) for name in ("lat", "lon")}
            for child in element:
                if child.tag.rpartition("}")[2] == "ele":
                    values["alt"] = _number(child.text, "alt", where)
            points.append(_point(values, where))
        return points, tag == "trkpt"
    raise DataError(f"{path}: no points; expected {', '.join(GPX_POINTS)}")


def _number(cell: str | None, name: str, where: str) -> float:
    low, high = LIMITS[name]
    try:
        value = float(cell or "")
    except ValueError:
        raise DataError(f"{where}, column {name}: {cell!r}; expected a number") from None
    if not low <= value <= high:
        raise DataError(f"{where}, column {name}: {value:g}; expected {low:g} to {high:g}")
    return value


def _point(values: dict[str, float], where: str) -> WayPoint:
    for name in ("lat", "lon"):
        if name not in values:
            raise DataError(f"{where}, column {name}: empty; expected degrees")
    angles = {name: math.radians(values.pop(name)) for name in ("lat", "lon")}
    return WayPoint(**angles, **values)
