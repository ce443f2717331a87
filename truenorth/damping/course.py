"""What damping takes of an INS's track: motion between epochs, its error model along it, and errors taken off.

The track is the output of a free inertial navigation with its height held, at even epochs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.errors.intervals import Intervals
from truenorth.errors.marine import DP, DV, MOTION, OF_INS, PHI, MarineModel
from truenorth.records.interpolation import Between
from truenorth.state.track import Track

Array = NDArray[np.float64]


def motion_at(course: Track, times: Array) -> tuple[Array, Array]:
    """``C_nb`` (M, 3, 3) and ``v_n`` (M, 3) between epochs: by constant turns, and by cubics through three epochs' slopes.

    Raises
    ------
    DataError
        A time outside the track.
    """
    between = Between(course.time, times, "damping")
    slopes = np.gradient(course.v_n, course.time, axis=0)
    v = [between.cubic(value, slope) for value, slope in zip(course.v_n.T, slopes.T, strict=True)]
    return between.slerp(course.C_nb), np.stack(v, axis=1)


def place_at(course: Track, time: float) -> tuple[float, float, float]:
    """Latitude, longitude (rad) and height (m) between epochs, on from the nearest by the mean velocity since."""
    k = int(np.argmin(np.abs(course.time - time)))
    lat, lon, alt = (float(x) for x in course.position[k])
    _, v = motion_at(course, np.array([time]))
    east, north = 0.5 * (course.v_n[k, :2] + v[0, :2]) * (time - course.time[k])
    R_M, R_N = earth.radii(lat)
    return lat + north / (R_M + alt), lon + east / ((R_N + alt) * np.cos(lat)), alt


def intervals(course: Track) -> Intervals:
    """From epoch to epoch, about the means of both ends.

    The specific force is what has changed the velocity: ``f = dv/dt + (2 w_ie + w_en) x v - g``; the rate is what has turned the
    attitude, ``w_ib = w_nb + C' (w_ie + w_en)``.
    """
    v, C, position = (0.5 * (a[1:] + a[:-1]) for a in (course.v_n, course.C_nb, course.position))
    lat, alt = position[:, 0], position[:, 2]
    earth_rate, transport = earth.earth_rate_n(lat), earth.transport_rate_n(lat, alt, v)
    f = (
        np.diff(course.v_n, axis=0) / course.interval
        + np.cross(2.0 * earth_rate + transport, v)
        - earth.gravity_n(lat, alt)
    )
    turn = rotation_vector_from_dcm(np.swapaxes(course.C_nb[:-1], 1, 2) @ course.C_nb[1:])
    w_b = turn / course.interval + np.einsum("kji,kj->ki", C, earth_rate + transport)
    return Intervals(np.full(len(v), course.interval), C, f, v, lat, alt, w_b)


def linearised(course: Track, model: MarineModel) -> tuple[Array, Array]:
    """``F`` and ``Phi`` (K, n, n) of each of its intervals."""
    return model.linearise(intervals(course))


def without_errors(course: Track, x: Array) -> Track:
    """The track with errors (K+1, 7) or (7,) taken off, in the model's states (metres for position)."""
    lat, _, alt = course.position.T
    R_M, R_N = earth.radii(lat)
    position, v_n = course.position.copy(), course.v_n.copy()
    v_n[:, :2] -= x[..., DV]
    position[:, 0] -= x[..., DP.start + 1] / (R_M + alt)
    position[:, 1] -= x[..., DP.start] / ((R_N + alt) * np.cos(lat))
    return replace(course, C_nb=dcm_from_rotation_vector(x[..., PHI]) @ course.C_nb, v_n=v_n, position=position)


def errors_of(course: Track, truth: Track) -> Array:
    """(K+1, 7) errors of attitude, velocity and position (m) of a track against the true one, in the model's states."""
    return course.errors_against(truth)[:, OF_INS[MOTION]]
