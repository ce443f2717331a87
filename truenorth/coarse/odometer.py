"""Coarse alignment on the move: gravity in the inertial frame, with the vehicle's own motion taken from an odometer or GNSS.

The velocity of a vehicle, seen from the frame ``n0`` that is frozen at the start, obeys

    d/dt (C_n0_n v_n) = C_n0_n (C_nb f - w_ie x v_n + g)

and ``C_n0_n C_nb = C_n0_i C_ib`` with one constant rotation, which is sought. A wheel gives velocity in body axes,
``v_n = C_nb v_b``; GNSS gives it in navigation axes. Collected on the side on which they are known,

    odometer   C_n0_i [int C_ib f dt - C_ib v_b - int w_ie_i x C_ib v_b dt]  =  -int C_n0_n g dt - C_n0_n0 v_n(0)
    GNSS       C_n0_i [int C_ib f dt]  =  C_n0_n v_n - int C_n0_n (g - w_ie x v_n) dt - v_n(0)

Each is a pair of vectors ``C b = r``. Both are averaged over the filter intervals, so that an odometer enters with distance,
not with the noise of its pulses; in the *position* form they are integrated once more. Differences against the first interval
(with GNSS, whose velocities are noisier, over the last three quarters of the time elapsed) drop the constants, and
Davenport's q-method finds the rotation.

The odometer's small terms need the answer themselves (the earth rate in i; how far the vehicle went, which turns
``C_n0_n``): they are found by iteration from zero, which converges by the ratio of these terms to gravity.

Sources: M. Wu, Y. Wu, X. Hu, D. Hu, "Optimization-based alignment for inertial navigation systems: theory and algorithm",
Aerosp. Sci. Technol. 15 (2011); Y. Wu, X. Pan, "Velocity/position integration formula part I: application to in-flight
coarse alignment", IEEE Trans. Aerosp. Electron. Syst. 49 (2013).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.coarse.inertial import Form
from truenorth.coarse.wahba import davenport_matrices, rotation_from_davenport
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, earth_rate_n, ecef_axes, normal_gravity, radii
from truenorth.core.errors import DataError
from truenorth.core.position import Position, eastward
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.state.mounting import Mounting
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import InertialIntegrals, integrate
from truenorth.strapdown.level import inertial_integrals

Array = NDArray[np.float64]

INTERVAL = 1.0  # s, over which both sides are averaged
ITERATIONS = 3  # of the odometer's small terms; each is a thousandth of the one before
LEAST_FIXES = 5
HELD = 5.0  # s before the first row of a moving vehicle's odometer
STANDS = 0.1  # m/s
LEAST = 10.0  # s that an odometer must cover
FIRST = 0.25  # of the time elapsed, that GNSS's noise at a single epoch shall not be in all pairs


@dataclass(frozen=True)
class MovingAttitude:
    """What coarse alignment on the move found."""

    time: Array  # (K+1,) s: ends of the intervals, since the beginning of the first sample
    C_n0_i: Array  # (3, 3): body to ENU at the beginning of the first sample
    history: Array  # (K, 3, 3): the same as known at each epoch but the first
    position: Array  # (K+1, 3): latitude, longitude (rad) and height (m) along the way
    heading_sigma: float  # rad; by what the fit leaves


def odometer_alignment(
    record: ImuRecord,
    odometer: OdometerRecord | VelocityRecord,  # OdometerRecord or VelocityRecord; the latter in body axes
    position: Position,  # at the start
    mounting: Mounting | None = None,  # of the wheel: its axes and lever arm as far as known
    form: Form = "velocity",
) -> MovingAttitude:
    """Attitude at the start of a drive, from inertial sensors and an odometer; from any heading.

    Raises
    ------
    DataError
        The odometer begins or ends elsewhere; one that ends early shows the attitude by the log until then.
    """
    mounting = mounting or Mounting()
    record = _covered(record, odometer, mounting)
    integrals = integrate(record, INTERVAL)
    moved = _wheel_displacement(record, odometer, mounting, integrals)  # (K+1, 3) in i, since the start
    T = integrals.intervals
    velocity = np.diff(moved, axis=0) / T[:, None]  # mean over each interval
    C = np.eye(3)
    place = _stay(position, len(T) + 1)
    for iteration in range(ITERATIONS):
        C_n0_n = frames(integrals.time, place)
        # w_ie in i, not known at first.
        w = np.zeros(3) if iteration == 0 else C.T @ earth_rate_n(position.lat)
        back = np.cross(w, 0.5 * (moved[1:] + moved[:-1]))  # mean of int w x v dt
        b = integrals.mean_velocity - velocity - back
        r = _mean_of_integral(-_gravity(C_n0_n, place), T)
        found = _solve(integrals.time, b, r, form, place, 0.0)
        C = found.C_n0_i
        v_n = np.einsum("kji,kj->ki", 0.5 * (C_n0_n[1:] + C_n0_n[:-1]), velocity @ C.T)
        place = _travelled(position, v_n, T)
    return found


def gnss_alignment(record: ImuRecord, gnss: GnssRecord, mounting: Mounting | None = None) -> MovingAttitude:
    """Attitude at the start of a log, from inertial sensors and a GNSS receiver; from any heading.

    Velocities where the receiver has them, else differences of positions. Of the antenna's mounting the latency counts, and how
    it grows; its lever arm, against unknown attitude, is of no use yet.

    Raises
    ------
    DataError
        Fewer than five fixes in the log.
    """
    integrals = integrate(record, INTERVAL)
    at = integrals.start + integrals.time
    velocity, place = gnss_track(gnss, at, mounting)
    T = integrals.intervals
    C_n0_n = frames(integrals.time, place)
    v_n0 = np.einsum("kij,kj->ki", C_n0_n, velocity)
    w = np.asarray(earth_rate_n(float(place[0, 0])))
    rate = np.cross(w, v_n0) - _gravity(C_n0_n, place)
    r = 0.5 * (v_n0[1:] + v_n0[:-1]) + _mean_of_integral(rate, T)
    return _solve(integrals.time, integrals.mean_velocity, r, "velocity", place, FIRST)


def gnss_track(gnss: GnssRecord, at: Array, mounting: Mounting | None = None) -> tuple[Array, Array]:
    """Velocity (K, 3), m/s, and position (K, 3) of the antenna at some times, between its fixes by straight lines.

    By the IMU's clock, as late as the antenna's mounting says, and in its seconds.

    Raises
    ------
    DataError
        Fewer than five fixes within these times.
    """
    mounting = mounting or Mounting()
    time = gnss.time - mounting.late_at(gnss.time)
    fixed = gnss.has_position
    inside = fixed & (time >= at[0] - 1.0) & (time <= at[-1] + 1.0)
    if inside.sum() < LEAST_FIXES:
        raise DataError(
            f"{gnss.source}: {int(inside.sum())} positions between {at[0]:.1f} s and {at[-1]:.1f} s; expected at least "
            f"{LEAST_FIXES} within the IMU's log, on its clock: check it (`record.shifted`)"
        )
    height = np.where(np.isfinite(gnss.alt), gnss.alt, 0.0)
    lat, lon, alt = gnss.lat[fixed], np.unwrap(gnss.lon[fixed]), height[fixed]
    place = np.stack([np.interp(at, time[fixed], a) for a in (lat, lon, alt)], axis=1)
    when, v = velocities_shown(gnss, mounting)
    return np.stack([np.interp(at, when, v[:, i]) for i in range(3)], axis=1), place


def velocities_shown(gnss: GnssRecord, mounting: Mounting) -> tuple[Array, Array]:
    """Times (M,), s, and velocities (M, 3), m/s, of an antenna: its own, or those by which its places differ, halfway between.

    By the IMU's clock, as late as the antenna's mounting says, and in its seconds.
    """
    time = gnss.time - mounting.late_at(gnss.time)
    known, fixed = gnss.has_velocity, gnss.has_position
    if gnss.v_n is not None and known.sum() >= LEAST_FIXES:
        return time[known], np.nan_to_num(gnss.v_n[known]) / (1.0 - mounting.clock.rate)
    height = np.where(np.isfinite(gnss.alt), gnss.alt, 0.0)
    t, lat, lon, alt = time[fixed], gnss.lat[fixed], gnss.lon[fixed], height[fixed]
    R_M, R_N = radii(lat[:-1])
    T = np.diff(t)
    v = np.stack(
        [
            eastward(lon[1:], lon[:-1]) * (R_N + alt[:-1]) * np.cos(lat[:-1]) / T,
            np.diff(lat) * (R_M + alt[:-1]) / T,
            np.diff(alt) / T,
        ],
        axis=1,
    )
    return 0.5 * (t[1:] + t[:-1]), v


def frames(time: Array, place: Array) -> Array:
    """``C_n0_n``, (K, 3, 3): ENU at each time and place seen from ENU at the start, in inertial space."""
    C_en = ecef_axes(place[:, 0], place[:, 1])
    turn = dcm_from_rotation_vector(EARTH_RATE * time[:, None] * np.array([0.0, 0.0, 1.0]))
    return np.asarray(C_en[0].T @ turn @ C_en)


def _covered(record: ImuRecord, odometer: OdometerRecord | VelocityRecord, mounting: Mounting) -> ImuRecord:
    """The record as far as the odometer goes; until it begins the vehicle goes on as at its first row, for some seconds at most."""
    ends = odometer.time - mounting.late_at(odometer.time)
    begin, start = record.time[0] - record.interval, ends[0] - odometer.interval
    v = odometer.velocity_b(mounting.C_mb)[0]
    if (start > begin + HELD and not np.linalg.norm(v) < STANDS) or ends[-1] < begin + LEAST:
        raise DataError(
            f"{odometer.source}: runs from {start:.3f} s to {ends[-1]:.3f} s, {record.source} from {begin:.3f} s to "
            f"{record.time[-1]:.3f} s; expected an odometer that covers the log, on its clock: check it (`record.shifted`)"
        )
    return record if ends[-1] > record.time[-1] - INTERVAL else record.between(None, float(ends[-1]))


def _wheel_displacement(
    record: ImuRecord, odometer: OdometerRecord | VelocityRecord, mounting: Mounting, integrals: InertialIntegrals
) -> Array:
    """(K+1, 3) how far the IMU went in i since the start, by the wheel, m, at the ends of the intervals."""
    ends = odometer.time - mounting.late_at(odometer.time)
    starts = ends - odometer.steps
    at = integrals.start + integrals.time
    # Attitude half way through each row's interval.
    edges = np.concatenate([[at[0]], record.time])
    rows = np.clip(np.searchsorted(edges, 0.5 * (starts + ends)), 0, len(record))
    dtheta, dvel = increments(record)
    every, back = np.unique(rows, return_inverse=True)
    C_ib = inertial_integrals(dtheta, dvel, record.steps, every)[0][back]
    steps = np.einsum("kij,kj->ki", C_ib, odometer.way_b(mounting.C_mb))
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    clock = np.concatenate([starts[:1], ends])
    if starts[0] > at[0]:  # as at the first row until then
        path = np.concatenate([path[:1] - steps[0] * (starts[0] - at[0]) / odometer.steps[0], path])
        clock = np.concatenate([at[:1], clock])
    moved = np.stack([np.interp(at, clock, path[:, i]) for i in range(3)], axis=1)
    # The wheel's way less that of the lever arm's end about the IMU.
    moved -= integrals.C_ib @ mounting.lever_arm
    return moved - moved[0]


def _stay(position: Position, count: int) -> Array:
    return np.tile([position.lat, position.lon, position.alt], (count, 1))


def _travelled(position: Position, v_n: Array, T: Array) -> Array:
    """(K+1, 3) positions of a way with mean velocities over intervals; flat but for the two radii, metres over kilometres."""
    R_M, R_N = radii(position.lat)
    way = np.concatenate([np.zeros((1, 3)), np.cumsum(v_n * T[:, None], axis=0)])
    scale = np.array([(R_N + position.alt) * math.cos(position.lat), R_M + position.alt, 1.0])
    lon, lat, alt = (way / scale).T
    return np.stack([position.lat + lat, position.lon + lon, position.alt + alt], axis=1)


def _gravity(C_n0_n: Array, place: Array) -> Array:
    """(K, 3) gravity in n0, m/s^2."""
    return -C_n0_n[:, :, 2] * normal_gravity(place[:, 0], place[:, 2])[:, None]


def _mean_of_integral(rate: Array, T: Array) -> Array:
    """(K, 3) mean over each interval of the integral since the start of a rate given at its ends; the rate is straight between."""
    whole = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * T[:, None] * (rate[1:] + rate[:-1]), axis=0)])
    return whole[:-1] + T[:, None] * (rate[:-1] / 3.0 + rate[1:] / 6.0)


def _solve(time: Array, b: Array, r: Array, form: Form, place: Array, first: float) -> MovingAttitude:
    """q-method over the time elapsed but for its first part."""
    T = np.diff(time)[:, None]
    if form == "position":
        b, r = np.cumsum(b * T, axis=0), np.cumsum(r * T, axis=0)
        if len(b) > 2:  # the unknown velocity at the start has become a slope
            b, r = b - np.outer(np.arange(len(b)), b[1] - b[0]), r - np.outer(np.arange(len(r)), r[1] - r[0])
    ends = np.arange(1, len(b))
    starts = (first * ends).astype(int)
    db, dr = b[ends] - b[starts], r[ends] - r[starts]
    weights = np.ones(len(ends))
    history = rotation_from_davenport(np.cumsum(davenport_matrices(db, dr, weights), axis=0))
    sigma = _heading_sigma(db @ history[-1].T, dr)
    return MovingAttitude(time, history[-1], np.concatenate([history[:1], history]), place, sigma)


def _heading_sigma(turned: Array, dr: Array) -> float:
    """One sigma of the rotation about the vertical, rad, by what pairs of vectors (K, 3) leave of each other, as white noise.

    Of ``r = C b`` with errors of size s the rotation vector has the covariance ``s^2 (sum (b'b E - b b'))^-1``, in the axes of r.
    """
    information = np.sum(turned**2) * np.eye(3) - turned.T @ turned
    left = float(np.mean((dr - turned)[:, :2] ** 2))
    return math.sqrt(left * float(np.linalg.pinv(information)[2, 2]))
