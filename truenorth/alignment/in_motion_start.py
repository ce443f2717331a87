"""Where an alignment on the move begins: guesses of the attitude at the first sample, velocity, stops; and the way back there."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.sensors import place_sigma
from truenorth.alignment.task import level_of
from truenorth.coarse.odometer import frames, gnss_alignment, gnss_track, odometer_alignment, velocities_shown
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector, rotation_vector_from_dcm, skew
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import BA, BG, DV, GYRO_AXES, PHI, SLOW_GYRO, STATES
from truenorth.state.mounting import Mounting
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments
from truenorth.strapdown.level import inertial_integrals

Array = NDArray[np.float64]

COARSE_LEVEL, COARSE_HEADING = math.radians(0.5), math.radians(20.0)  # one sigma, by the earth's rate
BANK_LEVEL = math.radians(4.0)  # of a level from the mean force of a vehicle that may be under way
# Of what a pass has found for the next to begin with, no wider than the first guess: its level so many times as wide, biases
# narrowed to such a part of their prior (both a hundredth of what the pass knows), and heading as wide as it was found, which is
# taken off again (:class:`truenorth.alignment.in_motion_passes.Pass`).
WIDER_LEVEL, NARROWED, LEAST_HEADING = 10.0, 0.3, math.radians(3.0)
HEADINGS = 12  # of the bank, all round
LEVEL_TIME = 4.0  # s
NEAR = 2.0  # s, within which a row of the wheel shows the velocity
CARRIED = 5.0  # s, over which the IMU leads a receiver's first velocity back to the start
PUSH = 2.0  # m/s^2, one sigma of what a vehicle does before the wheel's first row
ODOMETER_START, GNSS_START, UNKNOWN_START = 0.3, 0.3, 5.0  # m/s, one sigma of the velocity at the start


@dataclass(frozen=True)
class Guess:
    """Attitude at the beginning of the first sample, its sigmas, rad, and the biases about which errors are linear, SI.

    `bias_variance` (6,) is that of their constant part; None: as the specification says.
    """

    C_nb: Array
    level_sigma: float
    heading_sigma: float
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    accel_bias: Array = field(default_factory=lambda: np.zeros(3))
    bias_variance: Array | None = None


def coarse_guess(
    record: ImuRecord,
    position: Position,
    odometer: OdometerRecord | VelocityRecord | None,
    gnss: GnssRecord | None,
    wheel: Mounting,
    antenna: Mounting,
) -> Guess:
    """By optimisation-based alignment, with the odometer where there is one that covers the log, or no receiver."""
    ends = (float(record.time[0]), float(record.time[-1]))
    if odometer is not None and all(_shows(odometer, gnss, time) for time in ends):
        coarse = odometer_alignment(record, odometer, position, wheel)
    else:
        assert gnss is not None
        coarse = gnss_alignment(record, gnss, antenna)
    return Guess(coarse.C_n0_i, COARSE_LEVEL, max(COARSE_HEADING, coarse.heading_sigma))


def guesses_all_round(
    record: ImuRecord,
    odometer: OdometerRecord | VelocityRecord | None,
    gnss: GnssRecord | None,
    wheel: Mounting,
    antenna: Mounting,
) -> list[Guess]:
    """Attitudes that the force of the first seconds allows: all round gravity, or all round what a vehicle in a turn feels of it.

    What the wheel says of the acceleration, in body axes, is taken off the force. What a receiver says of it, in ENU, turns the
    axis of the bank: an aircraft that banks by 60 deg feels a vertical of that tilt.
    """
    dtheta, dvel = increments(record)
    rows = max(2, round(LEVEL_TIME / record.interval))
    C, velocity, _ = inertial_integrals(dtheta[:rows], dvel[:rows], record.steps[:rows], [0, rows])
    force, axis, sigma = velocity[1], np.eye(3), BANK_LEVEL
    step = 2.0 * math.pi / HEADINGS
    at = record.time[0] - record.steps[0] + np.array([0.0, float(record.steps[:rows].sum())])
    if odometer is not None and _shows(odometer, gnss, float(at[0])):
        v_b = _velocity_b(odometer, wheel, at)
        force = force - (C[1] @ v_b[1] - C[0] @ v_b[0])
    elif gnss is not None:
        axis, off = _felt_vertical(gnss, antenna, at, float(record.time[-1]))
        tilt = math.hypot(axis[0, 2], axis[1, 2])  # a turn about an axis that leans is a tilt, too
        sigma = math.hypot(sigma, off, tilt * step)
    level = level_of(force)
    return [Guess(axis @ dcm_from_euler(k * step, 0.0, 0.0) @ level, sigma, step) for k in range(HEADINGS)]


def _felt_vertical(gnss: GnssRecord, antenna: Mounting, at: Array, end: float) -> tuple[Array, float]:
    """Rotation (3, 3) from the vertical to ``a - g`` of a receiver's velocities at two times, and one sigma of its direction, rad.

    A change of velocity that its noise and delay may make as well is shrunk (James and Stein): it would tilt the bank by nothing.
    """
    before, after = (_by_gnss(gnss, antenna, float(t), end) for t in at)
    noise = before[1] ** 2 + after[1] ** 2
    change = after[0] - before[0]
    change = change * max(0.0, 1.0 - 3.0 * noise / max(float(change @ change), 1e-12))
    fallen = STANDARD_GRAVITY * float(at[1] - at[0])
    felt = change + np.array([0.0, 0.0, fallen])
    felt = felt / np.linalg.norm(felt)
    across = np.array([-felt[1], felt[0], 0.0])
    turn = math.atan2(math.hypot(felt[0], felt[1]), felt[2])
    rotation = dcm_from_rotation_vector(turn * across / max(float(np.linalg.norm(across)), 1e-12))
    return rotation, min(math.sqrt(noise) / fallen, turn)


def start_at(
    record: ImuRecord,
    guess: Guess,
    position: Position,
    spec: ImuSpec,
    odometer: OdometerRecord | VelocityRecord | None,
    gnss: GnssRecord | None,
    wheel: Mounting,
    antenna: Mounting,
) -> Start:
    """The state before the first sample: velocity by the wheel through the guessed attitude, else by GNSS."""
    time = float(record.time[0] - record.steps[0])
    v_n, sigma = np.zeros(3), UNKNOWN_START
    by_wheel = odometer is not None and _shows(odometer, gnss, time)
    if odometer is not None and by_wheel:
        v_b = _velocity_b(odometer, wheel, np.array([time]))[0]
        since = PUSH * max(_apart(odometer, time) - odometer.interval, 0.0)
        askew = wheel.angle_sigma * float(np.linalg.norm(v_b))
        v_n, sigma = guess.C_nb @ v_b, math.hypot(ODOMETER_START, askew, since)
    elif gnss is not None:
        first = _first_shown(gnss, antenna, time)
        v_n, sigma = _by_gnss(gnss, antenna, first, float(record.time[-1]))
        gained, unsure = _gained(record, guess, first)
        v_n, sigma = v_n - gained, math.hypot(sigma, unsure, _swing(record, antenna))
    # Slow parts of the biases are states of their own.
    angles = guess.level_sigma, guess.level_sigma, guess.heading_sigma
    variance = spec.constant_variance if guess.bias_variance is None else guess.bias_variance
    P = prior_covariance(angles, sigma, position.sigma, variance)
    if by_wheel:  # what the wheel says turns with the attitude: dv = dv_I + v x phi
        turn = np.eye(STATES)
        turn[DV, PHI] = skew(v_n)
        P = turn @ P @ turn.T
    return Start(time, guess.C_nb, v_n, position.lat, position.lon, position.alt, guess.gyro_bias, guess.accel_bias, P)


def _by_gnss(gnss: GnssRecord, antenna: Mounting, time: float, end: float) -> tuple[Array, float]:
    """Velocity (3,) at a time by a receiver, m/s, and one sigma of it: what delays and differences of places do counts."""
    at = np.array([time, time + max(antenna.latency_sigma, 1e-3), end])
    v = gnss_track(gnss, at, antenna)[0]
    change = float(np.linalg.norm(v[1] - v[0]))
    fixes = gnss.time[gnss.has_position]
    by_places = 0.0
    if not gnss.has_velocity.any() and len(fixes) > 1:
        first = min(int(np.searchsorted(fixes[1:], time)), len(fixes) - 2)  # of the two fixes that show it
        two = gnss.between(fixes[first], fixes[first + 1])
        by_places = math.sqrt(2.0) * place_sigma(two) / float(np.median(np.diff(fixes)))
    return v[0], math.sqrt(GNSS_START**2 + by_places**2 + change**2)


def _first_shown(gnss: GnssRecord, antenna: Mounting, time: float) -> float:
    """When, s, from a time on, a receiver first shows a velocity; the time itself where it is long after that, as at rest."""
    shown = velocities_shown(gnss, antenna)[0]
    first = max(time, float(shown[0])) if len(shown) else time
    return first if first - time <= CARRIED else time


def _gained(record: ImuRecord, guess: Guess, until: float) -> tuple[Array, float]:
    """Velocity (3,), m/s, that a vehicle gains from its first sample to a time, by the IMU in the guessed attitude; one sigma.

    Fixes show the velocity halfway between two. An aircraft that banks by 25 deg turns by 4.6 m/s^2 until then, and of fixes of
    centimetres a start that is off by ten of its sigmas passes for a delay of .8 s.
    """
    begin = float(record.time[0] - record.steps[0])
    rows = int(np.searchsorted(record.time, until - 0.5 * record.interval))
    if rows == 0 or until <= begin:
        return np.zeros(3), 0.0
    dtheta, dvel = increments(record)
    felt = inertial_integrals(dtheta[:rows], dvel[:rows], record.steps[:rows], [0, rows])[1][1]
    fallen = STANDARD_GRAVITY * float(record.steps[:rows].sum())
    gained = guess.C_nb @ felt - np.array([0.0, 0.0, fallen])
    turned = min(guess.heading_sigma, 1.0) * math.hypot(gained[0], gained[1])
    return gained, math.hypot(turned, guess.level_sigma * fallen)


def _swing(record: ImuRecord, antenna: Mounting) -> float:
    """RMS velocity of an antenna on its arm in the first seconds, m/s: the IMU does not have it."""
    rows = max(2, round(LEVEL_TIME / record.interval))
    rate = increments(record)[0][:rows] / record.steps[:rows, None]
    arm = math.hypot(float(np.linalg.norm(antenna.lever_arm)), math.sqrt(3.0) * antenna.lever_arm_sigma)
    return arm * math.sqrt(float(np.mean(np.sum(rate**2, axis=1))))


def _shows(odometer: OdometerRecord | VelocityRecord, gnss: GnssRecord | None, time: float) -> bool:
    """Whether the wheel shows the velocity at a time: it has a row about then, or the receiver has none that is nearer."""
    if gnss is None:
        return True
    return _apart(odometer, time) <= max(NEAR, _apart(gnss, time))


def _apart(log: OdometerRecord | VelocityRecord | GnssRecord, time: float) -> float:
    """From a time to the nearest row, s."""
    return float(np.min(np.abs(log.time - time)))


def _velocity_b(log: OdometerRecord | VelocityRecord, mounting: Mounting, at: Array) -> Array:
    """(M, 3) velocity in body axes at these times, m/s."""
    v = log.velocity_b(mounting.C_mb)
    return np.stack([np.interp(at, log.time - mounting.late_at(log.time), v[:, i]) for i in range(3)], axis=1)


def led_back(track: Track, back: Array, spec: ImuSpec, first: Guess) -> Guess:
    """Where the next pass begins: the attitude that a track leads back to, and what it has found of level, heading and biases.

    An error of the accelerometers turns with a heading that is not known yet, and a level of some degrees with it: the product of
    two errors is no part of a linear filter, which takes it for knowledge of heading. About what the pass before has found
    products are small. Of a sound van with gyros of 100 deg/h and an odometer heading was off by up to eight sigmas without this.

    Parameters
    ----------
    back : (3, 3) array
        The attitude there.
    first : Guess
        Of the first pass.
    """
    sigma = track.sigma[-1]
    level = max(COARSE_LEVEL, WIDER_LEVEL * float(np.max(sigma[PHI][:2])))
    heading = max(LEAST_HEADING, heading_sigma_back(track))
    known = sigma[BG.start : BA.stop] < NARROWED * np.sqrt(spec.bias_variance)
    bias = np.where(known, np.concatenate([track.gyro_bias[-1], track.accel_bias[-1]]), 0.0)
    return Guess(back, min(first.level_sigma, level), min(first.heading_sigma, heading), bias[:3], bias[3:])


def heading_sigma_back(track: Track) -> float:
    """One sigma of the heading at the beginning that the end of a track and the gyros lead back to, rad.

    From ``phi' = -C (b + M w)`` with what is left of biases b and axes M: ``phi(0) = phi(T) + int C b dt + sum C M dtheta``.
    A scale factor that is known to .5 % is 10 deg after ten circles: the heading at the end, which the vehicle has just shown, is
    far better than that of the beginning. What the gyros' noise does in between is in neither, and is small against it.
    """
    steps = np.diff(track.time)
    turns = rotation_vector_from_dcm(np.swapaxes(track.C_nb[:-1], 1, 2) @ track.C_nb[1:])
    up = track.C_nb[:-1, 2]
    back = np.zeros(track.layout.states)
    back[PHI.stop - 1] = 1.0
    back[BG] = steps @ up
    for name, columns in ((SLOW_GYRO, back[BG]), (GYRO_AXES, (up.T @ turns).ravel())):
        own = track.layout.slice_of(name)
        if own is not None:
            back[own] = columns
    return float(np.sqrt(max(back @ track.P[-1] @ back, 0.0)))


def _true_turns(dtheta: Array, steps: Array, track: Track) -> Array:
    """Increments of the gyros (N, 3), rad, less the bias and the axes' errors that the end of a track knows."""
    turned = dtheta - steps[:, None] * track.gyro_bias[-1]
    axes = track.layout.slice_of(GYRO_AXES)
    return turned if axes is None else np.linalg.solve(np.eye(3) + track.sensors[-1, axes].reshape(3, 3), turned.T).T


def backtracked(record: ImuRecord, track: Track) -> Array:
    """``C_nb`` at the beginning of the log, from the end of a track and the gyros, with the bias and the axes found there."""
    rows = int(np.searchsorted(record.time, track.time[-1] - 0.5 * record.interval)) + 1
    dtheta, dvel = increments(record)
    turned = _true_turns(dtheta[:rows], record.steps[:rows], track)
    C_ib = inertial_integrals(turned, dvel[:rows], record.steps[:rows], [rows])[0][0]
    C_n0_n = frames(track.time - track.time[0], path_to_the_end(track))[-1]
    return np.asarray(C_n0_n @ track.C_nb[-1] @ C_ib.T)


def path_to_the_end(track: Track) -> Array:
    """(K, 3) latitude, longitude (rad) and height (m), led back from the end of a track by its velocity.

    Where the place was unknown at first, the positions found move by what is learnt of it, and the vehicle did not.
    """
    lat, lon, alt = track.position[-1]
    R_M, R_N = radii(lat)
    metres = np.array([(R_N + alt) * math.cos(lat), R_M + alt, 1.0])
    speed = track.v_n / metres
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(track.time)[:, None]
    moved = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])[:, [1, 0, 2]]
    return np.asarray(np.array([lat, lon, alt]) + moved - moved[-1])


def departures(record: ImuRecord, track: Track) -> Array:
    """(K, 3) phi of the attitude found at each epoch, against what the end of the track and the gyros say of that epoch, rad."""
    rows = np.searchsorted(record.time, track.time - 0.5 * record.interval)
    rows[1:] += 1
    dtheta, dvel = increments(record)
    turned = _true_turns(dtheta, record.steps, track)
    C_ib = inertial_integrals(turned, dvel, record.steps, np.minimum(rows, len(record)))[0]
    C_n0_n = frames(track.time - track.time[0], path_to_the_end(track))
    C_n0_i = C_n0_n[-1] @ track.C_nb[-1] @ C_ib[-1].T
    final = np.swapaxes(C_n0_n, 1, 2) @ C_n0_i @ C_ib
    return rotation_vector_from_dcm(final @ np.swapaxes(track.C_nb, 1, 2))
