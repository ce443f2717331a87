"""A start of which the heading is known: from a survey, a compass, two antennas, a painted line.

An alignment that knows its heading's error together with its biases, even where its heading was refused, takes a given heading as
a measurement: heading and east gyro bias of a base at rest hide each other; who knows the one knows the other. An alignment that
has levelled only is turned to the heading; of a mean rate that it took for the gyros' bias the level part of the earth's rate,
which it could not tell from gyro bias, is then known too.
"""

from __future__ import annotations

import math
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.alignment.recipes import align
from truenorth.alignment.result import Alignment
from truenorth.alignment.unsaid import as_usual
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector, euler_from_dcm, euler_jacobian
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.axes import standing
from truenorth.navigation.departure import SHORTEST, UNSEEN_GAIN, Departure, departure
from truenorth.navigation.first_heading import turn_since_first_row
from truenorth.navigation.start import moving_start, start_from_alignment
from truenorth.quality.held import as_sampled
from truenorth.quality.regimes import SEEN_LATE, motion_summary
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import note
from truenorth.state.layout import DV, PHI
from truenorth.state.prior import positive, prior_covariance
from truenorth.state.state import Start

Array = NDArray[np.float64]

SHORTEST_LEVEL, LONGEST_LEVEL = 5.0, 120.0  # s of log, from which the level is taken
BIASED = 3.0  # sigmas
SHORTEST_SWAY = 60.0  # s: less does not show whether a base that sways also goes
VELOCITY_SIGMA = 0.1  # m/s, of a vehicle whose attitude is given whole
LEVEL_SIGMA = math.radians(0.5)


def with_heading(alignment: Alignment, heading: float, sigma: float) -> Alignment:
    """An alignment whose heading is known from elsewhere.

    Parameters
    ----------
    alignment : Alignment
        Of a base that stays: aligned, or level only.
    heading : float, rad
        Of the forward axis, clockwise from true north.
    sigma : float, rad
        Its one-sigma error.

    Returns
    -------
    Alignment
        With status ``aligned``.

    Raises
    ------
    UsageError
        A sigma that is not positive, or an alignment on the move, which has its heading.
    AlignmentError
        An alignment whose level is not to be trusted either.
    """
    if not (math.isfinite(heading) and 0.0 < sigma < math.inf):
        raise UsageError(f"heading {heading}, sigma {sigma}; expected a finite angle and a positive sigma, rad")
    if alignment.moving is not None or alignment.transfer is not None:
        raise UsageError("a heading is given for an alignment on the move; expected one of a base that stays")
    if alignment.status == "inconsistent":
        raise AlignmentError(
            f"{alignment.source}: the alignment is inconsistent; its level is not to be trusted either: {alignment.reasons[0]}"
        )
    known = _measured if alignment.handover is not None else _turned
    answer = known(alignment, heading, sigma)
    answer = replace(answer, disturbance=_turned_too(alignment.disturbance, answer.C_nb @ alignment.C_nb.T))
    said = note("heading.given", heading=math.degrees(heading % (2.0 * math.pi)), sigma=sigma)
    return replace(answer, status="aligned", evidence=(*answer.evidence, said), history=None)


def _turned_too(velocity: Array, turn: Array) -> Array:
    """(3,) RMS velocities after a turn about the vertical: what they are at most, since how they go together is not known.

    Of an answer by means, whose level ones are the largest of any direction already, that is up to 1.4 times as much as need be.
    """
    east, north, up = velocity
    c, s = abs(float(turn[0, 0])), abs(float(turn[0, 1]))
    return np.array([c * east + s * north, s * east + c * north, up])


def _measured(alignment: Alignment, heading: float, sigma: float) -> Alignment:
    """An update of the joint estimate, along the curve on which heading and biases leave the same rates to be measured.

    At level ``heading_hat - heading = phi_U``. What goes with a turn of heading goes with it in navigation axes: the east gyro bias
    by the earth's rate. Over a large turn that direction turns in the body; for a small one this is the Kalman update.
    """
    joint = alignment.handover
    assert joint is not None  # asked before
    off = math.remainder(alignment.heading - heading, 2.0 * math.pi)
    P, n = joint.P, len(joint.P)
    H = np.concatenate([euler_jacobian(joint.C_nb)[0], np.zeros(n - 3)])
    variance = float(H @ P @ H)
    along = P @ H / variance  # what goes with an error of heading by one radian
    moved = variance / (variance + sigma**2) * off
    rest = P - variance * np.outer(along, along)
    # The bulk of the turn is one about the vertical; the body then has another attitude to the same errors in n.
    turn = dcm_from_rotation_vector(np.array([0.0, 0.0, moved]))
    turned = np.eye(n)
    turned[:3, :3] = turn
    C_nb = turn @ joint.C_nb
    half = dcm_from_rotation_vector(np.array([0.0, 0.0, 0.5 * moved])) @ joint.C_nb
    chord = np.sinc(0.5 * moved / math.pi)  # of the arc that the horizontal bias runs through
    in_n = joint.C_nb @ along[3:6]
    biases = along[3:9] * moved
    biases[:3] = half.T @ (in_n * [chord, chord, 1.0]) * moved
    tilt = dcm_from_rotation_vector(turn @ (along[:3] - [0.0, 0.0, 1.0]) * moved)
    along = np.concatenate([turn @ along[:3], C_nb.T @ in_n, along[6:]])
    P = turned @ rest @ turned.T + variance * sigma**2 / (variance + sigma**2) * np.outer(along, along)
    return replace(
        alignment,
        C_nb=tilt @ turn @ alignment.C_nb,
        phi_covariance=P[:3, :3],
        phi_floor=_lowered(alignment.phi_floor, float(P[2, 2])),
        gyro_bias=alignment.gyro_bias + biases[:3],
        gyro_bias_sigma=np.sqrt(np.diag(P)[3:6]),
        handover=replace(joint, C_nb=tilt @ C_nb, accel_bias=joint.accel_bias + biases[3:], P=P),
    )


def _turned(alignment: Alignment, heading: float, sigma: float) -> Alignment:
    """The level kept, turned about the vertical to the heading; the earth's level rate taken off the gyro bias."""
    C_nb = dcm_from_euler(heading, alignment.pitch, alignment.roll)
    turn = C_nb @ alignment.C_nb.T
    P, floor = (turn @ M @ turn.T for M in (alignment.phi_covariance, alignment.phi_floor))
    J = euler_jacobian(C_nb)[0]
    of_heading = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-J[0] / J[2], -J[1] / J[2], 1.0 / J[2]]])
    P[2], P[:, 2] = 0.0, 0.0
    P[2, 2] = sigma**2
    gyro_bias, gyro_sigma = alignment.gyro_bias, alignment.gyro_bias_sigma
    if not alignment.heading_known and alignment.history is None and alignment.gyro_bias.any():  # the mean rate
        rate, level = EARTH_RATE * math.cos(alignment.position.lat), 1.0 - C_nb[2] ** 2
        gyro_bias = gyro_bias - rate * C_nb[1]  # north part of the earth's rate along each axis
        variance = gyro_sigma**2 - 0.5 * rate**2 * level + (rate * min(sigma, 1.0)) ** 2 * level
        gyro_sigma = np.sqrt(np.maximum(variance, 0.01 * gyro_sigma**2))
    return replace(
        alignment,
        C_nb=C_nb,
        phi_covariance=of_heading @ P @ of_heading.T,  # of phi, from that of the level and the heading
        phi_floor=_lowered(floor, 0.0),
        gyro_bias=gyro_bias,
        gyro_bias_sigma=gyro_sigma,
        handover=None,
    )


def _lowered(floor: Array, variance: float) -> Array:
    """The floor, that of heading no larger than this."""
    scale = np.array([1.0, 1.0, math.sqrt(min(1.0, variance / max(float(floor[2, 2]), 1e-30)))])
    return floor * np.outer(scale, scale)


def known_start(
    record: ImuRecord,
    place: Position | tuple[float, ...],
    imu: ImuSpec | str | PathLike[str] | dict[str, Any],
    heading: float,
    sigma: float,
    *,
    pitch: float | None = None,
    roll: float | None = None,
    level_sigma: float = LEVEL_SIGMA,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    velocity_sigma: float = VELOCITY_SIGMA,
) -> Start:
    """A start of navigation from a known heading and place.

    Parameters
    ----------
    record : ImuRecord or DataFrame
    place : Position or (lat, lon[, alt])
        At the start.
    imu : ImuSpec, str, path or mapping
    heading, sigma : float, rad
        Where the record begins.
    pitch, roll : float, rad, optional
        Both or none. Left out, the level is that of the log, whose beginning the vehicle then spends at rest or swaying.
    level_sigma : float, rad
        Of a given pitch and roll.
    velocity, velocity_sigma : (3,) floats and float, m/s
        East, north, up, where pitch and roll are given.

    Returns
    -------
    Start
        At the end of what was levelled on; at the record's beginning where pitch and roll are given.

    Raises
    ------
    UsageError
        Pitch without roll; sigmas that are not positive.
    AlignmentError
        The vehicle moves from the first seconds on, and no level is given.
    """
    log, at = as_sampled(record), Position.of(place)
    spec = as_usual(imu_spec(imu), log)
    if (pitch is None) != (roll is None):
        raise UsageError("pitch or roll is given alone; expected both, or none: the level then comes from the log")
    if pitch is None or roll is None:
        answer, departs = _levelled(log, at, spec)
        turned, unsure = turn_since_first_row(log, answer)
        start = start_from_alignment(with_heading(answer, heading + turned, math.hypot(sigma, unsure)))
        return start if departs is None else _may_have_left(start, departs.unseen)
    if not (sigma > 0.0 and level_sigma > 0.0 and velocity_sigma > 0.0):
        raise UsageError(f"sigmas {sigma:g}, {level_sigma:g} rad, {velocity_sigma:g} m/s; expected all above zero")
    C_nb = dcm_from_euler(heading, pitch, roll)
    phi_of = np.linalg.inv(euler_jacobian(C_nb))
    P = prior_covariance(dv=velocity_sigma, dp=at.sigma, bias_variance=spec.bias_variance)
    P[PHI, PHI] = phi_of @ np.diag([sigma, level_sigma, level_sigma]) ** 2 @ phi_of.T
    zero, begin = np.zeros(3), float(log.time[0] - log.interval)
    v_n = np.array(velocity, dtype=np.float64)
    return moving_start(begin, C_nb, v_n, positive(P), zero, zero, at, spec, {}, standing())


def start_from_master(
    record: ImuRecord,
    master: MasterRecord,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any],
    heading_sigma: float,
    level_sigma: float,
    *,
    place: Position | tuple[float, ...] | None = None,
    C_mb: ArrayLike | None = None,
    velocity_sigma: float = VELOCITY_SIGMA,
) -> Start:
    """A start of navigation from a row of another system's solution: the first one within the record.

    Parameters
    ----------
    record : ImuRecord or DataFrame
    master : MasterRecord
        With attitude; its velocity (zero without) and position.
    imu : ImuSpec, str, path or mapping
    heading_sigma, level_sigma : float, rad
        Of the row's attitude, the seat's error included.
    place : Position or (lat, lon[, alt]), optional
        Where the master has no position.
    C_mb : (3, 3) array, optional
        IMU's to the master's axes; the same when left out.
    velocity_sigma : float, m/s

    Returns
    -------
    Start
        At the row's time.

    Raises
    ------
    UsageError
        Neither a place nor positions of the master; a master without attitude.
    DataError
        No row of the master within the record.
    """
    log = as_sampled(record)
    if master.C_nb is None:
        raise UsageError(f"{master.source}: no attitude in it; expected heading, pitch and roll")
    inside = np.flatnonzero((master.time >= log.time[0] - log.interval) & (master.time < log.time[-1] - log.interval))
    if not inside.size:
        raise DataError(
            f"{master.source}: runs from {master.time[0]:.3f} s to {master.time[-1]:.3f} s, {log.source} from "
            f"{log.time[0]:.3f} s to {log.time[-1]:.3f} s; expected a row within the log, on its clock"
        )
    row = int(inside[0])
    if master.lat is not None and master.lon is not None and master.alt is not None:
        at = Position(float(master.lat[row]), float(master.lon[row]), float(master.alt[row]))
    elif place is not None:
        at = Position.of(place)
    else:
        raise UsageError(f"{master.source}: no position in it, and no place is given; expected one of them")
    C_nb = master.C_nb[row] if C_mb is None else master.C_nb[row] @ np.asarray(C_mb, dtype=np.float64)
    heading, pitch, roll = (float(x) for x in euler_from_dcm(C_nb))
    start = known_start(
        log,
        at,
        imu,
        heading,
        heading_sigma,
        pitch=pitch,
        roll=roll,
        level_sigma=level_sigma,
        velocity=np.zeros(3) if master.v_n is None else master.v_n[row],
        velocity_sigma=velocity_sigma,
    )
    return replace(start, time=float(master.time[row]))


def _may_have_left(start: Start, gained: float) -> Start:
    """The start of a vehicle that departs soon: it may have gained a speed, m/s, that is not plain yet."""
    P = start.P.copy()
    P[DV, DV] += np.diag([gained, gained, 0.0]) ** 2
    return replace(start, P=P)


def _levelled(record: ImuRecord, place: Position, spec: ImuSpec) -> tuple[Alignment, Departure | None]:
    """The level by the beginning of the log, in which the vehicle goes nowhere, and whether it departs after that.

    One that sways in the sea may seem to move.
    """
    begin, regimes = float(record.time[0]), motion_summary(record).regimes
    longest = min(begin + LONGEST_LEVEL, float(record.time[-1]))
    start = record.between(None, longest)
    kinds = ("moving",) if _turns_as_biased(start, spec) else ("moving", "rotating")
    end = min([longest, *(r.start - SEEN_LATE for r in regimes if r.kind in kinds)])
    seen = departure(start)
    if seen is not None:
        end = min(end, seen.time)
    if end - begin >= SHORTEST_LEVEL:
        unseen = Departure(end, UNSEEN_GAIN) if end < longest else None
        return align(record.between(None, end), place, spec), seen or unseen
    turns = any(r.kind == "rotating" and r.start < longest for r in regimes)
    if seen is None and not turns and longest - begin >= SHORTEST_SWAY:
        answer = align(start, place, spec)
        if answer.status in ("aligned", "level_only"):
            return answer, None
    # Where a departure begins within its shortest span is not known better.
    first, needed = (
        (SHORTEST,) * 2 if seen is not None else (max(1.0, end + SEEN_LATE - begin), SHORTEST_LEVEL + SEEN_LATE)
    )
    raise AlignmentError(
        f"{record.source}: the vehicle moves within the first {first:.0f} s; {needed:g} s at rest are needed, "
        "or a minute in which it only sways: give pitch and roll"
    )


def _turns_as_biased(record: ImuRecord, spec: ImuSpec) -> bool:
    """The gyros turn from the first seconds on, by no more than they may be biased; what turns later is seen to leave."""
    first = record.between(None, float(record.time[0]) + SHORTEST_LEVEL)
    rate = first.gyro.mean(axis=0) / (first.interval if first.kind == "increments" else 1.0)
    return bool((np.abs(rate) < EARTH_RATE + BIASED * np.sqrt(spec.bias_variance[:3])).all())
