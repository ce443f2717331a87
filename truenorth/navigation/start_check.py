"""A start that cannot be one, and one that the log contradicts: damaged matrices, another hemisphere, another attitude."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE, earth_rate_n, normal_gravity
from truenorth.core.errors import DataError
from truenorth.quality.regimes import MOVING_ACCELERATION, motion_summary
from truenorth.records import ImuRecord
from truenorth.state.layout import BA, BG, PHI, STATES
from truenorth.state.limits import limit
from truenorth.state.state import Start

Array = NDArray[np.float64]

ORTHONORMAL = 1e-6
SYMMETRIC = 1e-6  # of the largest product of two sigmas
FIRST, LEAST = 20.0, 5.0  # s of the log's begin that are held against the start, and the least of them at rest
TURNS = 3.0  # times the earth's rate: no attitude and no latitude makes it miss itself by more than twice
SAME_WAY = 0.98  # cosine
SHAKE = 0.02  # m/s^2 and, divided by a second, rad/s: of a mean over seconds at rest with the engine running


def check_start(start: Start) -> None:
    """Refuse a start that is no state with a covariance.

    Raises
    ------
    DataError
        Numbers that are not finite; an attitude that is no rotation; a covariance with a negative variance.
    """
    numbers = (
        start.time,
        start.C_nb,
        start.v_n,
        start.lat,
        start.lon,
        start.alt,
        start.gyro_bias,
        start.accel_bias,
        start.P,
    )
    if not all(np.all(np.isfinite(x)) for x in numbers):
        raise DataError("start: a number of it is not finite; expected all finite: align anew")
    C, P = np.asarray(start.C_nb), np.asarray(start.P)
    if C.shape != (3, 3) or np.abs(C @ C.T - np.eye(3)).max() > ORTHONORMAL or np.linalg.det(C) < 0.0:
        raise DataError(
            "start: C_nb is no rotation; expected orthonormal, right-handed axes: the start is damaged, align anew"
        )
    if not (abs(start.lat) <= math.pi / 2.0 and abs(start.lon) <= 2.0 * math.pi):
        raise DataError(
            f"start: latitude {start.lat:g} rad, longitude {start.lon:g} rad; expected a place on the earth"
        )
    variance = np.diag(P)
    scale = np.sqrt(np.outer(np.abs(variance), np.abs(variance)))
    states = STATES + sum(map(len, start.known.values()))
    if P.shape != (states, states) or np.any(np.abs(P - P.T) > SYMMETRIC * scale.max()):
        raise DataError(
            f"start: the covariance P is not symmetric; expected ({states}, {states}), symmetric: align anew"
        )
    known = variance > 0.0
    unit = P[np.ix_(known, known)] / scale[np.ix_(known, known)]
    if np.any(variance < 0.0) or (known.any() and np.linalg.eigvalsh(unit).min() < -SYMMETRIC):
        raise DataError(
            "start: the covariance P has a negative variance; expected none: the start is damaged, align anew"
        )


def check_start_at_rest(start: Start, record: ImuRecord) -> None:
    """Refuse a start that the first seconds contradict, where the vehicle is at rest in them.

    There the gyros see the earth turn, and the accelerometers gravity's reaction, along the axes that the start says.

    Parameters
    ----------
    record : ImuRecord
        From the start on.

    Raises
    ------
    DataError
        With what is off.
    """
    clear = limit("start at rest")
    v_sigma = math.sqrt(float(np.max(np.diag(start.P)[3:6])))
    if record.duration < LEAST or float(np.linalg.norm(start.v_n)) > clear * v_sigma:
        return
    part = record.between(None, float(record.time[0]) + FIRST)
    motion = motion_summary(part)
    rest = motion.longest("still", "disturbed")
    if rest is None or rest.duration < LEAST or rest.start > part.time[0] + 1.0:
        return
    force = motion.specific_force[motion.time <= rest.stop]
    if np.any(np.ptp(force, axis=0) > MOVING_ACCELERATION):  # a log that begins just before its vehicle drives off
        return
    part = part.between(None, rest.stop)
    scale = part.interval if part.kind == "increments" else 1.0
    w, f = part.gyro.mean(axis=0) / scale - start.gyro_bias, part.accel.mean(axis=0) / scale - start.accel_bias
    w_off = start.C_nb @ w - earth_rate_n(start.lat)
    g = float(normal_gravity(start.lat, start.alt))
    f_off = (start.C_nb @ f - np.array([0.0, 0.0, g]))[:2]
    sigma = np.sqrt(np.maximum(np.diag(start.P), 0.0))
    noise = float(np.max(motion.angle_noise)) / math.sqrt(max(rest.duration, 1.0))
    w_sigma = math.sqrt(float(np.max(sigma[BG])) ** 2 + noise**2 + (SHAKE / g / rest.duration) ** 2)
    f_sigma = math.hypot(g * float(np.max(sigma[PHI][:2])), float(np.max(sigma[BA])), SHAKE)
    worst, hour = float(np.max(np.abs(w_off))), math.radians(1.0) / 3600.0
    turns = worst > TURNS * EARTH_RATE + clear * w_sigma and not _scaled(start.C_nb @ w, earth_rate_n(start.lat))
    if worst > clear * w_sigma + 0.1 * EARTH_RATE and not turns:
        raise DataError(
            f"{record.source}: at rest the gyros miss the earth's rate, as the start has it, by {worst / hour:.3g} deg/h; expected "
            f"{w_sigma / hour:.2g} deg/h (one sigma): check the start's latitude and attitude, and the IMU's axes and units"
        )
    if np.max(np.abs(f_off)) > clear * f_sigma:
        raise DataError(
            f"{record.source}: at rest the accelerometers are tilted by {math.degrees(float(np.max(np.abs(f_off))) / g):.2g} deg "
            f"against the start; expected {math.degrees(f_sigma / g):.2g} deg (one sigma): the IMU has been moved, or the start is "
            "of another log; align anew"
        )


def _scaled(rate: Array, earth: Array) -> bool:
    """Whether a rate is the earth's in another unit: along it, and not as large. Of a base that turns evenly it is not."""
    return float(rate @ earth) > SAME_WAY * float(np.linalg.norm(rate)) * EARTH_RATE
