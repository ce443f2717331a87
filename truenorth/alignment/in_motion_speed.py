"""How fast a vehicle is when its aids begin, and how far it gets before that, by an aid alone."""

from __future__ import annotations

import math

import numpy as np

from truenorth.core.earth import radii
from truenorth.core.position import eastward
from truenorth.records import GnssRecord, OdometerRecord, VelocityRecord

PACE = 5.0  # s, over which fixes show a speed
SIGMAS = 3.0  # of what a receiver says, that may seem to be a speed


def first_speed(odometer: OdometerRecord | VelocityRecord | None, gnss: GnssRecord | None, first: float) -> float:
    """By the aid that begins first, m/s.

    Of a vehicle that drives straight and evenly an IMU says no more than that it is shaken. First fixes of a receiver that starts
    up are poor, and say so: by as much no vehicle drives.
    """
    if gnss is not None and (odometer is None or gnss.time[0] <= odometer.time[0]):
        return max(speed_at(gnss, first) - _unsure(gnss, first), 0.0)
    if odometer is None:
        return 0.0
    begun = odometer.time < first + 1.0  # a single row may be one pulse in a hundredth of a second
    if isinstance(odometer, OdometerRecord):
        return float(np.mean(np.abs(odometer.speed[begun])))
    return float(np.linalg.norm(np.mean(odometer.velocity[begun], axis=0)))


def speed_at(gnss: GnssRecord, time: float) -> float:
    """Of a receiver at a time, m/s, by its velocity or by how far it gets in some seconds."""
    if gnss.v_n is not None and gnss.has_velocity.any():
        rows = np.flatnonzero(gnss.has_velocity)
        return float(np.linalg.norm(gnss.v_n[rows[np.argmin(np.abs(gnss.time[rows] - time))], :2]))
    rows = np.flatnonzero(gnss.has_position & (gnss.time >= time))
    last = rows[min(int(np.searchsorted(gnss.time[rows], time + PACE)), len(rows) - 1)]
    if last == rows[0]:
        return 0.0
    R_M, R_N = radii(float(gnss.lat[last]))
    north, east = (
        R_M * (gnss.lat[last] - gnss.lat[rows[0]]),
        R_N * math.cos(gnss.lat[last]) * eastward(gnss.lon[last], gnss.lon[rows[0]]),
    )
    return math.hypot(north, east) / float(gnss.time[last] - gnss.time[rows[0]])


def driven(log: OdometerRecord | VelocityRecord | None, begin: float, end: float) -> float:
    """How far a sensor in body axes says that a vehicle drives between two times, m; zero without one."""
    within = slice(0, 0) if log is None else slice(*np.searchsorted(log.time, [begin, end]))
    if log is None or within.start == within.stop:
        return 0.0
    return float(np.sum(np.linalg.norm(log.way_b(np.eye(3))[within], axis=1)))


def _unsure(gnss: GnssRecord, time: float) -> float:
    """What the errors that a receiver states at a time may seem to be, m/s."""
    by_velocity = gnss.v_n is not None and bool(gnss.has_velocity.any())
    sigma = gnss.velocity_sigma if by_velocity else gnss.position_sigma
    if sigma is None:
        return 0.0
    rows = np.flatnonzero(gnss.has_velocity if by_velocity else gnss.has_position)
    said = sigma[rows[int(np.argmin(np.abs(gnss.time[rows] - time)))], :2]
    worst = float(np.nan_to_num(said).max())
    return SIGMAS * (worst if by_velocity else math.sqrt(2.0) * worst / PACE)
