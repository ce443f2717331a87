"""Coast lines for the map of a track, from the package itself: nothing is asked of a map server.

Source: Natural Earth, 1:50 million, public domain. A coast is true to a kilometre or two, so it is drawn on wide maps only.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from truenorth.report.document import ASSETS

Array = NDArray[np.float64]

WIDE = 20e3  # m: a narrower map would show a coast where there is none
UNIT = 100.0  # points a degree


def coast_within(south: float, north: float, west: float, east: float) -> tuple[Array, Array]:
    """Longitude and latitude (deg) of the coasts in a window, one array each, lines parted by NaN.

    Parameters
    ----------
    south, north : float, deg
    west, east : float, deg
        ``west < east``; both may lie beyond 180, where the window crosses the date line.
    """
    points = _points()
    middle = 0.5 * (west + east)
    lon = middle + (points[:, 0] - middle + 180.0) % 360.0 - 180.0
    lat = points[:, 1]
    inside = (lat >= south) & (lat <= north) & (lon >= west) & (lon <= east)
    near = inside | np.roll(inside, 1) | np.roll(inside, -1)  # a line leaves the window by its next point
    rows = np.flatnonzero(near)
    parted = np.diff(rows, prepend=-1) > 1  # the line goes on outside, or another one begins
    over_date_line = np.abs(np.diff(lon, prepend=lon[:1]))[rows] > 10.0
    breaks = np.flatnonzero(parted | over_date_line)
    return np.insert(lon[rows], breaks, np.nan), np.insert(lat[rows], breaks, np.nan)


@cache
def _points() -> Array:
    """(N, 2) longitude and latitude of all coasts, deg, a row of NaN after each line."""
    with np.load(ASSETS / "coast.npz") as file:
        points = np.cumsum(file["points"], axis=0, dtype=np.int16) / UNIT  # wraps as it was written
        return np.insert(points, file["ends"], np.nan, axis=0)
