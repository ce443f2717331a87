"""Whether a GNSS receiver's velocities are the change of its positions; and if not, in which axes or units they would be."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.core.position import eastward
from truenorth.records import GnssRecord

Array = NDArray[np.float64]

LONGEST_STEP = 5.0  # s, over which the mean of two velocities is that of the way
LEAST_STEPS = 5
LEAST_CLIMBS = 20  # steps
UNLIKE, ALIKE = 0.5, 0.3  # of the way: velocities that contradict it leave more of it, the right ones less


def check_frames(record: GnssRecord) -> None:
    """Compare velocities with the change of position.

    Raises
    ------
    DataError
        They fit north, east, down, or places that were exchanged or are radians, and not what is given.
    """
    both = np.flatnonzero(record.has_position & record.has_velocity)
    if len(both) <= LEAST_STEPS or record.v_n is None:
        return
    time, v = record.time[both], record.v_n[both]
    T = np.diff(time)
    close = T < LONGEST_STEP
    if close.sum() < LEAST_STEPS:
        return
    way = (0.5 * (v[1:] + v[:-1]) * T[:, None])[close]
    _check_horizontal(record.source, record.lat[both], record.lon[both], way[:, :2], close)
    _check_vertical(record.source, record.alt[both], np.diff(time) * 0.5 * (v[1:, 2] + v[:-1, 2]), close)


def _check_horizontal(source: str, lat: Array, lon: Array, way: Array, close: NDArray[np.bool_]) -> None:
    moved = _steps(lat, lon)[close]
    given = _rms(moved - way)
    if not given > UNLIKE * max(_rms(way), _rms(moved)):
        return
    turn = math.degrees(1.0)
    left = {
        "north, east, down; expected east, north, up: exchange the columns VE and VN (and the sign of up)": _rms(
            moved - way[:, ::-1]
        ),
        "right, and latitude and longitude exchanged: exchange these columns": _rms(_steps(lon, lat)[close] - way),
        "right, and latitude and longitude radians that were read as degrees: say units position=rad": _rms(
            _steps(turn * lat, turn * lon)[close] - way
        ),
    }
    likely = min(left, key=lambda words: left[words])
    if left[likely] < ALIKE * _rms(way):
        raise DataError(
            f"{source}: velocities contradict the change of position by {given:.3g} m a step, otherwise read by "
            f"{left[likely]:.3g} m: they seem to be {likely}"
        )


def _check_vertical(source: str, alt: Array, climbed: Array, close: NDArray[np.bool_]) -> None:
    """Heights against the sum of the climbs, over the longest stretch without a gap: from row to row they are all noise."""
    known = close & np.isfinite(np.diff(alt)) & np.isfinite(climbed)
    edges = np.concatenate([[-1], np.flatnonzero(~known), [len(known)]])
    first = int(edges[np.argmax(np.diff(edges))]) + 1
    last = first + int(np.diff(edges).max()) - 1
    if last - first < LEAST_CLIMBS:
        return
    height = alt[first : last + 1] - np.mean(alt[first : last + 1])
    climb = np.concatenate([[0.0], np.cumsum(climbed[first:last])])
    climb -= np.mean(climb)
    given, turned = _rms(height - climb), _rms(height + climb)
    if turned < UNLIKE * min(given, _rms(climb)):
        raise DataError(
            f"{source}: heights contradict the sum of the vertical velocities by {given:.3g} m, with the other sign by "
            f"{turned:.3g} m: one of the two seems to be counted downwards; expected both upwards: name the column VD, or depth"
        )


def _steps(lat: Array, lon: Array) -> Array:
    """(N-1, 2) metres east and north from row to row; latitudes beyond the poles are taken as they are."""
    R_M, R_N = radii(lat[:-1])
    return np.stack([eastward(lon[1:], lon[:-1]) * R_N * np.cos(lat[:-1]), np.diff(lat) * R_M], axis=1)


def _rms(values: Array) -> float:
    """Of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(values.reshape(len(values), -1) ** 2, axis=1))))
