"""The track as files that maps and tables open: GeoJSON, KML, CSV."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from truenorth.core.atomic import atomic_path, write_text
from truenorth.core.errors import UsageError

POINTS = 10_000  # of a line; more than a map shows
PLACES = 8  # of a degree: a millimetre


class Exported(Protocol):
    """What is needed of a navigation."""

    @property
    def time(self) -> NDArray[np.float64]:
        """(K,) s."""

    @property
    def position(self) -> NDArray[np.float64]:
        """(K, 3) latitude, longitude (rad), height (m)."""

    @property
    def source(self) -> str:
        """Name of the log."""

    def summary(self) -> dict[str, Any]:
        """One flat dictionary."""

    def to_frame(self) -> Any:
        """The table."""


def export(result: Exported, path: Path) -> Path:
    """Write by the suffix; see :meth:`Navigation.export`."""
    writers = {".geojson": geojson, ".kml": kml, ".csv": csv}
    if path.suffix.lower() not in writers:
        raise UsageError(f"{path}: the suffix {path.suffix!r} is not known; expected one of {', '.join(writers)}")
    text = writers[path.suffix.lower()](result)
    with atomic_path(path) as temporary:
        write_text(temporary, text)
    return path


def geojson(result: Exported) -> str:
    """The track as a line (RFC 7946: longitude, latitude, height), with its end as a point."""
    lines = _lines(result)
    shape: dict[str, Any] = (
        {"type": "LineString", "coordinates": lines[0]}
        if len(lines) == 1
        else {"type": "MultiLineString", "coordinates": lines}
    )
    s = result.summary()
    features = [
        {"type": "Feature", "geometry": shape, "properties": {"source": result.source, "distance_m": s["distance_m"]}},
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": lines[-1][-1]},
            "properties": {
                "time_s": s["end_s"],
                "heading_deg": s["heading_deg"],
                "position_sigma_m": s["position_sigma_m"],
            },
        },
    ]
    return json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False) + "\n"


def kml(result: Exported) -> str:
    """The track as a line at its height (KML 2.2, whose heights are above the sea: it is said that ours are not)."""
    strings = "".join(
        f"<LineString><altitudeMode>absolute</altitudeMode><coordinates>"
        f"{' '.join(','.join(f'{x:.8f}' if i < 2 else f'{x:.3f}' for i, x in enumerate(point)) for point in line)}"
        f"</coordinates></LineString>"
        for line in _lines(result)
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"<name>{html.escape(result.source, quote=False)}</name>"
        "<description>Heights are above the WGS 84 ellipsoid. Above the sea they differ by the geoid, up to 106 m.</description>"
        "<Placemark><name>track</name>"
        f"<MultiGeometry>{strings}</MultiGeometry></Placemark></Document></kml>\n"
    )


def csv(result: Exported) -> str:
    """The table of :meth:`Navigation.to_frame`, every digit."""
    return str(result.to_frame().to_csv())


def _lines(result: Exported) -> list[list[list[float]]]:
    """Points in degrees and metres, in parts that do not cross the date line (RFC 7946, 3.1.9)."""
    rows = np.unique(np.linspace(0, len(result.time) - 1, min(POINTS, len(result.time))).astype(int))
    lat, lon, alt = result.position[rows].T
    lat, lon = np.round(np.degrees(lat), PLACES), np.round(np.degrees(lon), PLACES)
    points = np.stack([lon, lat, np.round(alt, 3)], axis=1)
    cuts = np.flatnonzero(np.abs(np.diff(lon)) > 180.0) + 1
    parts = [part.tolist() for part in np.split(points, cuts)]
    return [part if len(part) > 1 else part * 2 for part in parts]
