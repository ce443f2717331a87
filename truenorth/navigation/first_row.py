"""The rows that navigation takes, and the start as it is where the first of them begins.

A transfer holds at the last row of its master, which falls anywhere within a row of the IMU. That row was taken whole: by up to
its length the turn was taken twice. Ships that roll by 5 deg, 50 rows a second, were so tilted by 2 arcmin, and their velocity
4 to 10 sigmas off a quarter of a minute later. So the start is carried to the beginning of the row, by what the row says.

Rows that are lost right after the epoch leave no row before the gap that the navigation takes. One is made, of the last row before
the epoch, and the gap behind it is bridged and counted as any other. It ends whole rows before the first that came,
as a lost row did: an increment counts whole, so between two rows there must be whole rows. Where the epoch lay in a
row, one made at the epoch counted up to half a row twice, and its gravity: velocity was up to 9 sigmas off.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import earth_rate_n, gravity_n, radii, transport_rate_n
from truenorth.core.errors import DataError
from truenorth.records import ImuRecord
from truenorth.records.lost_rows import GAP_FACTOR
from truenorth.state.state import Start

Array = NDArray[np.float64]

FEWEST = 2  # rows of a log that goes on
EVEN = 1e-3  # of a row: half a row is half a row, whatever the rounding of times


def from_start(record: ImuRecord, start: Start) -> tuple[ImuRecord, Start]:
    """The rows after the start's epoch, and the start where they begin.

    Raises
    ------
    DataError
        The log does not hold the epoch, or does not go on from it.
    """
    begin = record.time[0] - record.interval
    slack = 0.5 * record.interval
    first = int(np.searchsorted(record.time, start.time + slack))
    if not begin - slack <= start.time or len(record) - first < FEWEST:
        raise DataError(
            f"{record.source}: runs from {begin:.3f} s to {record.time[-1]:.3f} s, but the alignment holds at {start.time:.3f} "
            "s; expected a log that holds the alignment's epoch and goes on from it, on the same clock"
        )
    part = record[first:]
    interval = part.interval  # not the whole log's: live, where few rows before the epoch are kept, it is the same
    lost = lost_after(start, float(part.time[0]), interval) if first in record.gaps else 0
    edge = float(part.time[0]) - interval - lost * interval
    holding = max(first - 1, 0) if lost or edge > start.time else first  # the row that the epoch lies in
    values = np.concatenate([record.gyro[holding], record.accel[holding]])
    begun = carried_to(start, np.append(edge, values), interval, increments=record.kind == "increments")
    if not lost:
        return part, begun
    rows = np.column_stack([part.time, part.gyro, part.accel])
    rows = np.vstack([row_before_gap(float(part.time[0]), lost, interval, values), rows])
    return replace(part, time=rows[:, 0], gyro=rows[:, 1:4], accel=rows[:, 4:]), begun


def lost_after(start: Start, first: float, interval: float) -> int:
    """How many whole rows are lost between a start's epoch, give or take half of one, and the first row that came."""
    missing = (first - start.time) / interval - GAP_FACTOR
    return max(0, math.ceil(missing - EVEN))


def row_before_gap(first: float, lost: int, interval: float, held: Array) -> Array:
    """(7,) the first of the rows that are lost before the first one that came, with gyros and accelerometers (6,)."""
    return np.append(first - lost * interval, held)


def carried_to(start: Start, row: Array, interval: float, *, increments: bool) -> Start:
    """A start that lies within a row, at an end of that row; any other as it is.

    Parameters
    ----------
    start : Start
    row : (7,) array
        The end's time, and the row's gyros and accelerometers.
    interval : float, s
    increments : bool
        Whether these are increments, or rates.
    """
    dt = float(row[0]) - start.time
    if not start.within or abs(dt) > interval:
        return start
    values = row[1:] / interval if increments else row[1:]
    w, f = values[:3] - start.gyro_bias, values[3:] - start.accel_bias
    earth, along = earth_rate_n(start.lat), transport_rate_n(start.lat, start.alt, start.v_n)
    half, whole = (
        dcm_from_rotation_vector(-part * (earth + along)) @ start.C_nb @ dcm_from_rotation_vector(part * w)
        for part in (0.5 * dt, dt)
    )
    gained = dt * (half @ f + gravity_n(start.lat, start.alt) - np.cross(2.0 * earth + along, start.v_n))
    east, north, up = dt * (start.v_n + 0.5 * gained)
    R_M, R_N = radii(start.lat)
    return replace(
        start,
        time=float(row[0]),
        C_nb=whole,
        v_n=start.v_n + gained,
        lat=start.lat + north / (R_M + start.alt),
        lon=start.lon + east / ((R_N + start.alt) * np.cos(start.lat)),
        alt=start.alt + up,
    )
