"""Latitudes and longitudes of a log that cannot be: refused by line and column, with what they look like."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import SEMI_MAJOR
from truenorth.core.errors import DataError
from truenorth.formats.guesses import UnsureError
from truenorth.formats.quantities import FASTEST, Found

Array = NDArray[np.float64]

LIMIT = {"lat": 90.0, "lon": 360.0}  # deg; longitudes are counted from -180 or from 0
COARSE = 1e-5  # rad, 64 m: nobody writes places in steps of it
SCALED = (1e7, 1e6, 1e9)  # counts a degree, as receivers write whole numbers


def check_degrees(found: Found) -> None:
    """Refuse latitudes beyond 90 deg and longitudes beyond 360.

    Raises
    ------
    DataError
        With line and column, what stands there, what was expected, and what it looks like: columns exchanged, degrees where
        radians are said, degrees and minutes, whole numbers.
    """
    for name, limit in LIMIT.items():
        bad = np.flatnonzero(np.abs(found.values[name]) > np.radians(limit) * (1.0 + 1e-12))
        if bad.size:
            row = int(bad[0])
            radians = _in_radians(found, name)
            unit, least = ("rad", np.radians(limit)) if radians else ("deg", limit)
            raise DataError(
                f"{found.source}: {found.place(row)}, column {found.labels[name]}: {_written(found, name)[row]:.10g} {unit}; "
                f"expected {-least:.6g} to {least:.6g} {unit}: {_advice(found, name)}"
            )

    _ask_near_zero(found)


def _ask_near_zero(found: Found) -> None:
    """Ask where neither the log nor the caller says a unit and both do: south of Ghana in degrees, anywhere in radians."""
    if {"lat", "lon"} & found.stated:
        return
    lat, lon = (np.degrees(found.values[name]) for name in LIMIT)
    here = np.isfinite(lat) & np.isfinite(lon)
    lat, lon, time = lat[here], lon[here], found.values["time"][here]
    if not len(lat) or np.abs(lat).max() > 0.5 * np.pi or np.abs(lon).max() > np.pi:
        return
    steps = SEMI_MAJOR * np.hypot(np.diff(lat), np.diff(lon) * np.cos(lat[1:]))
    whole = np.concatenate([lat, lon]) / COARSE
    if np.all(np.abs(whole - np.round(whole)) < 1e-6) or np.any(steps > FASTEST * np.diff(time)):
        return
    labels = f"{found.labels['lat']}, {found.labels['lon']}"
    seen = f"lat {np.degrees(lat[0]):.3f}, lon {np.degrees(lon[0]):.3f} deg"
    raise UnsureError(
        f"{found.source}: columns {labels}: {lat[0]:.6g}, {lon[0]:.6g} are degrees south of Ghana, or radians of {seen}; say "
        f"which, in a file {_next_to(found)} next to the log, or to the reader",
        [{"units": {"position": "rad"}}, {"units": {"position": "deg"}}],
    )


def _next_to(found: Found) -> str:
    return found.source.rpartition(".")[0] + ".yaml"


def _in_radians(found: Found, name: str) -> bool:
    return found.factors[name] == 1.0


def _written(found: Found, name: str) -> Array:
    """Degrees or radians as they stand in the file, or as its unit makes of them."""
    return found.values[name] if _in_radians(found, name) else np.degrees(found.values[name])


def _advice(found: Found, name: str) -> str:
    lat, lon = (np.abs(_written(found, key)) for key in LIMIT)
    farthest, other = float(np.nanmax(lat, initial=0.0)), float(np.nanmax(lon, initial=0.0))
    labels = {key: found.labels[key] for key in LIMIT}

    def options(text: str) -> str:
        return f"put {text} into a file {_next_to(found)} next to the log, or give it to the reader"

    if _in_radians(found, name):
        if farthest <= LIMIT["lat"] and other <= LIMIT["lon"]:
            return f"these look like degrees: {options('units: {position: deg}')}"
        return "check the unit that is said, rad"
    if name == "lat" and farthest <= LIMIT["lon"] and other <= LIMIT["lat"]:
        exchanged = options(f"columns: {{lat: {labels['lon']!r}, lon: {labels['lat']!r}}}")
        return (
            f"column {labels['lon']} stays within {other:.6g} deg, latitude and longitude seem exchanged: {exchanged}"
        )
    for scale in SCALED:
        if farthest / scale <= LIMIT["lat"] and other / scale <= LIMIT["lon"] and farthest > 0.01 * scale:
            unit = f"{1.0 / scale:.0e} deg"
            return f"these look like whole numbers of {unit}: {options(f'units: {{position: {unit}}}')}"
    if 90.0 < farthest < 9000.0 and other <= 18000.0 and _minutes(lat) and _minutes(lon):
        return "these look like degrees and minutes (ddmm.mmmm): write them as degrees"
    return f"check that this column is the {'latitude' if name == 'lat' else 'longitude'}, and its unit"


def _minutes(values: Array) -> bool:
    """Whether the last two digits before the point are all less than 60."""
    return bool(np.all(values[np.isfinite(values)] % 100.0 < 60.0))
