"""The earth: WGS-84 ellipsoid, its rotation, and normal gravity.

Source: NIMA TR8350.2, "Department of Defense World Geodetic System 1984", 3rd ed. (2000): table 3.1 (defining
parameters), eq. 4-1 (Somigliana's closed form on the ellipsoid), eq. 4-3 (its second-order continuation with height).

Functions take scalars or arrays; the same source is compiled for kernels.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEMI_MAJOR = 6378137.0  # m
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
EARTH_RATE = 7.292115e-5  # rad/s
GM = 3.986004418e14  # m^3/s^2
GRAVITY_EQUATOR = 9.7803253359  # m/s^2
SOMIGLIANA = 0.00193185265241
CENTRIFUGAL_RATIO = 0.00344978650684  # m = w^2 a^2 b / GM
DEFLECTION = np.radians(
    5.0 / 3600.0
)  # of the vertical, rad, one sigma: what gravity's direction differs from the normal


def radii(lat: Any) -> tuple[Any, Any]:
    """Meridian and prime-vertical radius of curvature, m, at geodetic latitude (rad)."""
    return radii_at(np.sin(lat) ** 2)


def radii_at(s2: Any) -> tuple[Any, Any]:
    """Meridian and prime-vertical radius of curvature, m, where the sine of latitude has the square `s2`."""
    W2 = 1.0 - ECCENTRICITY_SQUARED * s2
    R_N = SEMI_MAJOR / np.sqrt(W2)
    return R_N * (1.0 - ECCENTRICITY_SQUARED) / W2, R_N


def normal_gravity(lat: Any, alt: Any) -> Any:
    """Normal gravity, m/s^2, downward positive, at geodetic latitude (rad) and height (m)."""
    return normal_gravity_at(np.sin(lat) ** 2, alt)


@lru_cache(maxsize=64)
def gravity_of_place(lat: float, alt: float) -> float:
    """:func:`normal_gravity` of one place, which is asked for again and again."""
    return float(normal_gravity(lat, alt))


def normal_gravity_at(s2: Any, alt: Any) -> Any:
    """Normal gravity, m/s^2, downward positive, where the sine of latitude has the square `s2`, at a height (m)."""
    surface = GRAVITY_EQUATOR * (1.0 + SOMIGLIANA * s2) / np.sqrt(1.0 - ECCENTRICITY_SQUARED * s2)
    h = alt / SEMI_MAJOR
    return surface * (1.0 - 2.0 * (1.0 + FLATTENING + CENTRIFUGAL_RATIO - 2.0 * FLATTENING * s2) * h + 3.0 * h * h)


def earth_rate_n(lat: Any) -> Array:
    """``w_ie_n`` (E, N, U), (..., 3) rad/s."""
    return np.stack([np.zeros_like(lat), EARTH_RATE * np.cos(lat), EARTH_RATE * np.sin(lat)], axis=-1)


def transport_rate_n(lat: Any, alt: Any, v_n: Array) -> Array:
    """``w_en_n`` (E, N, U), (..., 3) rad/s, of a velocity ``v_n`` (..., 3) m/s."""
    R_M, R_N = radii(lat)
    east = v_n[..., 0] / (R_N + alt)
    return np.stack([-v_n[..., 1] / (R_M + alt), east, east * np.tan(lat)], axis=-1)


def gravity_n(lat: Any, alt: Any) -> Array:
    """Normal gravity as a vector in n, (..., 3) m/s^2."""
    g = normal_gravity(lat, alt)
    return np.stack([np.zeros_like(g), np.zeros_like(g), -g], axis=-1)


def ecef_from_geodetic(lat: Any, lon: Any, alt: Any) -> Array:
    """Cartesian earth-fixed coordinates, (..., 3) m, of latitude, longitude (rad) and height (m)."""
    _, R_N = radii(lat)
    across = (R_N + alt) * np.cos(lat)
    up = (R_N * (1.0 - ECCENTRICITY_SQUARED) + alt) * np.sin(lat)
    return np.stack([across * np.cos(lon), across * np.sin(lon), up], axis=-1)


def geodetic_from_ecef(place: Array) -> tuple[Array, Array, Array]:
    """Latitude, longitude (rad) and height (m) of Cartesian earth-fixed coordinates (..., 3), m.

    Bowring's parametric latitude, iterated three times: within 1e-15 rad and 1e-8 m up to 1000 km of height (B. Bowring,
    Survey Review 23 (1976)).
    """
    x, y, z = np.moveaxis(np.asarray(place, dtype=np.float64), -1, 0)
    across = np.hypot(x, y)
    minor = SEMI_MAJOR * (1.0 - FLATTENING)
    second = ECCENTRICITY_SQUARED / (1.0 - ECCENTRICITY_SQUARED)
    beta = np.arctan2(SEMI_MAJOR * z, minor * across)
    lat = beta
    for _ in range(3):
        lat = np.arctan2(
            z + second * minor * np.sin(beta) ** 3, across - ECCENTRICITY_SQUARED * SEMI_MAJOR * np.cos(beta) ** 3
        )
        beta = np.arctan2((1.0 - FLATTENING) * np.sin(lat), np.cos(lat))
    s, c = np.sin(lat), np.cos(lat)
    alt = across * c + z * s - SEMI_MAJOR * np.sqrt(1.0 - ECCENTRICITY_SQUARED * s * s)
    return lat, np.arctan2(y, x), alt


def ecef_axes(lat: Any, lon: Any) -> Array:
    """``C_en``, (..., 3, 3): turns east, north, up into earth-fixed axes."""
    sl, cl, so, co = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(sl * so)
    east = np.stack([-so + zero, co + zero, zero], -1)
    north = np.stack([-sl * co, -sl * so, cl + zero], -1)
    up = np.stack([cl * co, cl * so, sl + zero], -1)
    return np.stack([east, north, up], -1)
