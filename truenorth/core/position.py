"""Where the IMU stands, and how well that is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.core.numeric import is_masked, is_number

FARTHEST = 2e7  # m: half way round the earth
UNITS = {"lat": "rad", "lon": "rad", "alt": "m", "horizontal_sigma": "m", "vertical_sigma": "m"}
METRES_PER_RADIAN = 6_371_000.0  # mean earth radius: good enough for a position's uncertainty


@dataclass(frozen=True)
class Position:
    """A place on the WGS-84 ellipsoid.

    Parameters
    ----------
    lat, lon : float, rad
        Geodetic latitude and longitude.
    alt : float, m
        Height above the ellipsoid.
    horizontal_sigma, vertical_sigma : float, m
        One-sigma error of the position that the user gives; it goes into the uncertainty of the attitude.

    Raises
    ------
    UsageError
        No number, latitude outside +-90 deg, longitude outside +-360 deg, a height no vehicle reaches, or a negative sigma.
    """

    lat: float
    lon: float = 0.0
    alt: float = 0.0
    horizontal_sigma: float = 10.0
    vertical_sigma: float = 20.0

    def __post_init__(self) -> None:
        for name, unit in UNITS.items():
            if not is_number(value := getattr(self, name)):
                raise UsageError(f"a position's {name} is {value!r}; expected a number, in {unit}")
        lat, lon = math.degrees(self.lat), math.degrees(self.lon)
        if not abs(lat) <= 90.0:
            raise UsageError(f"latitude {lat:g} deg; expected -90 to 90 deg, north positive: check `lat`")
        if not abs(lon) <= 360.0:
            raise UsageError(f"longitude {lon:g} deg; expected -180 to 180 deg, east positive: check `lon`")
        if not -12_000.0 <= self.alt <= 50_000.0:
            raise UsageError(f"height {self.alt:g} m; expected metres between -12000 and 50000: check `alt`")
        if not all(0.0 <= sigma <= FARTHEST for sigma in (self.horizontal_sigma, self.vertical_sigma)):
            raise UsageError(f"a position sigma is negative or not a number, or beyond {FARTHEST:g} m; expected metres")

    @property
    def sigma(self) -> tuple[float, float, float]:
        """One-sigma error east, north, up, m."""
        return self.horizontal_sigma, self.horizontal_sigma, self.vertical_sigma

    @classmethod
    def from_degrees(cls, lat: float, lon: float = 0.0, alt: float = 0.0, **sigmas: float) -> Position:
        """Latitude and longitude in degrees, height in metres.

        Raises
        ------
        UsageError
            Not a number, or a latitude beyond a pole.
        """
        if not all(map(is_number, (lat, lon, alt))):
            raise UsageError(f"place {lat!r}, {lon!r}, {alt!r}; expected degrees and metres as numbers")
        return cls(math.radians(lat), math.radians(lon), alt, **sigmas)

    @classmethod
    def of(cls, place: Position | Sequence[float]) -> Position:
        """A position as it is, or (lat, lon[, alt]) in degrees and metres as one.

        Raises
        ------
        UsageError
            Other than two or three numbers, or numbers that could as well be radians.
        """
        if isinstance(place, cls):
            return place
        try:
            numbers = [] if any(map(is_masked, place)) else [float(x) for x in place]  # type: ignore[arg-type,union-attr]
        except (TypeError, ValueError):
            numbers = []
        if len(numbers) not in (2, 3):
            raise UsageError(
                f"place {place!r}; expected a Position, or (lat, lon) or (lat, lon, alt) in degrees and metres"
            )
        lat, lon = numbers[:2]
        if abs(lat) <= math.pi / 2 and abs(lon) <= math.pi and (lat, lon) != (0.0, 0.0):
            raise UsageError(
                f"place {place!r} could be degrees or radians; expected Position.from_degrees({lat:g}, {lon:g}) for degrees, "
                f"Position({lat:g}, {lon:g}) for radians"
            )
        return cls.from_degrees(*numbers)

    @property
    def lat_sigma(self) -> float:
        """One-sigma error of the latitude, rad."""
        return self.horizontal_sigma / METRES_PER_RADIAN


def eastward(lon: Any, lon0: Any) -> Any:
    """By how much longitudes lie east of others, rad, the shorter way round: across the date line, too."""
    apart = lon - lon0
    return apart - 2.0 * math.pi * np.round(apart / (2.0 * math.pi))
