"""The GNSS receiver's record: positions and velocities of the antenna; and heights of a barometer."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.records.base import Record, check_positive, check_range

Array = NDArray[np.float64]
PLACE = {"lat": ("lat",), "lon": ("lon",), "alt": ("alt",)}
HEIGHTS = (-12_000.0, 1_000_000.0)  # m


@dataclass(frozen=True, repr=False)
class GnssRecord(Record):
    """Fixes of a GNSS receiver. What is absent in a row is NaN.

    Parameters
    ----------
    time : (N,) array, s
    lat, lon, alt : (N,) arrays, rad and m
        Of the antenna, WGS-84, height above the ellipsoid.
    v_n : (N, 3) array or None, m/s
        Velocity east, north, up.
    position_sigma : (N, 3) array or None, m
        East, north, up.
    velocity_sigma : (N, 3) array or None, m/s
    dop : (N, 2) array or None
        Horizontal and vertical dilution of precision.
    quality : (N,) array or None
        Indicator of NMEA 0183: 0 no fix, 1 single, 2 differential, 4 RTK fixed, 5 RTK float, 6 dead reckoning.
    heading : (N,) array or None, rad
        Of the line from the first to a second antenna, clockwise from true north.
    heading_sigma : (N,) array or None, rad
    source : str
    stale : int
        Rows whose fix a reader left out, since it was the one before, written again on the move.

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; degrees for radians, a sigma that is not positive, not one fix in the record.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = PLACE | {
        "v_n": ("VE", "VN", "VU"),
        "position_sigma": ("sigma_E", "sigma_N", "sigma_U"),
        "velocity_sigma": ("sigma_VE", "sigma_VN", "sigma_VU"),
        "dop": ("hdop", "vdop"),
        "quality": ("quality",),
        "heading": ("heading",),
        "heading_sigma": ("sigma_heading",),
    }
    OPTIONAL: ClassVar[frozenset[str]] = frozenset(
        {"v_n", "position_sigma", "velocity_sigma", "dop", "quality", "heading", "heading_sigma"}
    )
    PARTIAL: ClassVar[frozenset[str]] = OPTIONAL | {"lat", "lon", "alt"}

    time: Array
    lat: Array
    lon: Array
    alt: Array
    v_n: Array | None = None
    position_sigma: Array | None = None
    velocity_sigma: Array | None = None
    dop: Array | None = None
    quality: Array | None = None
    heading: Array | None = None
    heading_sigma: Array | None = None
    source: str = field(default="GNSS record", compare=False)
    stale: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_place(self)
        check_positive(self, "position_sigma", "velocity_sigma", "dop", "heading_sigma")
        check_range(self, "heading", -2 * math.pi, 2 * math.pi, "headings are in radians here: were degrees handed in?")
        if not (self.has_position.any() or self.has_velocity.any() or self.has_heading.any()):
            raise DataError(f"{self.source}: neither a position nor a velocity in any row; expected some fixes")

    @property
    def notes(self) -> tuple[str, ...]:
        """What was put right when the log was read, in words."""
        if not self.stale:
            return super().notes
        were = "1 fix is" if self.stale == 1 else f"{self.stale} fixes are"
        return (
            *super().notes,
            f"{self.source}: {were} the one before, written again: left out",
        )

    @property
    def has_position(self) -> NDArray[np.bool_]:
        """(N,) whether a row holds latitude and longitude."""
        return np.isfinite(self.lat) & np.isfinite(self.lon)

    @property
    def has_velocity(self) -> NDArray[np.bool_]:
        """(N,) whether a row holds velocity east and north."""
        if self.v_n is None:
            return np.zeros(len(self), dtype=bool)
        return np.isfinite(self.v_n[:, 0]) & np.isfinite(self.v_n[:, 1])

    @property
    def has_heading(self) -> NDArray[np.bool_]:
        """(N,) whether a row holds a heading."""
        return np.zeros(len(self), dtype=bool) if self.heading is None else np.isfinite(self.heading)

    def columns(self) -> dict[str, Array]:
        """Latitude, longitude and heading in degrees; the rest in SI."""
        return in_degrees(super().columns())


@dataclass(frozen=True, repr=False)
class HeightRecord(Record):
    """Heights of a barometer, or of any other sensor of height alone.

    Parameters
    ----------
    time : (N,) array, s
    alt : (N,) array, m
    sigma : (N,) array or None, m
        One-sigma errors, NaN where not known.
    source : str

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; a height no vehicle reaches, or a sigma that is not positive.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {"alt": ("alt",), "sigma": ("sigma_U",)}
    OPTIONAL: ClassVar[frozenset[str]] = frozenset({"sigma"})
    PARTIAL: ClassVar[frozenset[str]] = OPTIONAL

    time: Array
    alt: Array
    sigma: Array | None = None
    source: str = field(default="height record", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range(self, "alt", *HEIGHTS, "check the unit, metres are expected")
        check_positive(self, "sigma")


def check_place(record: Record) -> None:
    """Refuse latitudes, longitudes and heights that cannot be.

    Raises
    ------
    DataError
        With source, row and column.
    """
    lat, lon = getattr(record, "lat", None), getattr(record, "lon", None)
    advice = "latitude and longitude are in radians here: were degrees handed in?"
    if (
        lat is not None
        and lon is not None
        and not (np.abs(lat) > math.pi).any()
        and not (np.abs(lon) > math.pi / 2).any()
    ):
        advice = "radians; the longitudes would pass for latitudes: were they exchanged?"
    check_range(record, "lat", -math.pi / 2, math.pi / 2, advice)
    check_range(record, "lon", -2 * math.pi, 2 * math.pi, advice)
    check_range(record, "alt", *HEIGHTS, "check the unit, metres are expected")


def in_degrees(columns: dict[str, Array]) -> dict[str, Array]:
    """The same columns, latitude, longitude and heading in degrees."""
    angles = ("lat", "lon", "heading", "sigma_heading", "sigma_pitch", "sigma_roll")
    return {name: np.degrees(values) if name in angles else values for name, values in columns.items()}
