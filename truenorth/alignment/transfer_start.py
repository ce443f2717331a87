"""Where a transfer alignment begins: clocks brought together, the slave's first state and its covariance."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Matched
from truenorth.alignment.transfer_delay import (
    WINDOW,
    Found,
    agreement,
    delay_by_arm,
    find_delay,
    runs_backwards,
)
from truenorth.alignment.transfer_filter import Assumed
from truenorth.alignment.transfer_smoothed import filter_sigmas
from truenorth.core.attitude import dcm_from_euler, euler_from_dcm
from truenorth.core.earth import GRAVITY_EQUATOR, radii
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.axes import turning_axes
from truenorth.errors.group import Group
from truenorth.errors.ins import TURN_TIME
from truenorth.errors.master import ATTITUDE_ERROR, PLACE_SIGMA, MasterErrors, TransferModel
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.flexure import FlexureSpec
from truenorth.records.interpolation import interpolated
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.layout import ACCEL_AXES, BG, GYRO_AXES, PHI
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

SLOWEST = 3.0  # m/s: slower, a course says nothing of heading
COURSE_SIGMA, LEVEL_SIGMA = math.radians(10.0), math.radians(3.0)  # of a start from course and specific force
DELAY_WALK = 1e-4  # s/sqrt(s): clocks of two boxes part by a millisecond in 100 s
FIRST = 1.0  # s over which those are taken
AGAIN = 5.0  # s: sooner no manoeuvre comes again
OUTAGE = 3.0  # intervals without a row
MISFIT = 2.0  # times the part of a motion that the best delay leaves: another delay that leaves more is another clock's


def common_clock(slave: ImuRecord, master: MasterRecord, assumed: Assumed) -> tuple[Assumed, tuple[str, ...]]:
    """The delay assumed, or that which the motion shows where the two contradict each other, with notes in words.

    Raises
    ------
    DataError
        The logs have no time in common and their motion does not say how they belong together; or one of them is reversed.
    """
    found = find_delay(slave, master, assumed.C_mb)
    start, stop = master.time[0] - assumed.delay, master.time[-1] - assumed.delay
    apart = start >= slave.time[-1] or stop <= slave.time[0]
    miss = abs(found.delay - assumed.delay)
    by_arm = delay_by_arm(slave, master, assumed.lever_arm, assumed.lever_arm_sigma)
    sigma = math.hypot(assumed.delay_sigma, by_arm)
    slack = limit("other delay") * max(sigma, 0.5 * master.interval)
    # Of a clock that jumps between manoeuvres that are alike, one of them agrees with the other better than all where it was said.
    elsewhere = found.sure and not apart and miss > AGAIN
    if elsewhere and (
        _again(slave, master, assumed, found) or parted_clocks(slave, master, assumed.C_mb, assumed.delay)
    ):
        return assumed, ()
    if found.sure and (apart or miss > slack):
        if not apart and runs_backwards(slave, master, assumed.C_mb, assumed.delay, slack):
            raise DataError(
                f"{slave.source}: its motion agrees with the master's in reversed order, without a shift and in more of it than at "
                f"a shift of {found.delay:.3f} s: the rows of one of the logs run backwards: write them in the order in which they "
                "were measured"
            )
        return replace(assumed, delay=found.delay, delay_sigma=sigma), (
            f"the master's stamps are {found.delay:.3f} s behind the slave's clock by their motion (correlation "
            f"{found.correlation:.3f}), where {assumed.delay:.3f} s were given: the found delay is taken",
        )
    if apart:
        raise DataError(
            f"{master.source}: it runs from {master.time[0]:.3f} s to {master.time[-1]:.3f} s, the slave's log from "
            f"{slave.time[0]:.3f} s to {slave.time[-1]:.3f} s, and no shift makes their motion agree (best correlation "
            f"{found.correlation:.2f}, elsewhere {found.rival:.2f}): give `mounting.latency`, the offset "
            "of the master's clock, or logs with more motion in common"
        )
    return assumed, ()


def _again(slave: ImuRecord, master: MasterRecord, assumed: Assumed, found: Found) -> bool:
    """Whether the motion that agrees at a delay far from the one that was said comes again, and the log belongs where it was said.

    Manoeuvres that come again agree as well with the next ones, and rows of a second or stamps that scatter make it a matter of
    chance where best. So a log belongs where it was said if it agrees there about as well. By how much the delay is off then, the
    filter asks.
    """
    return _left(slave, master, assumed.C_mb, assumed.delay) < MISFIT * (1.0 - found.correlation**2)


def _unbroken(master: MasterRecord) -> MasterRecord:
    """The longest stretch of a log without an outage: what happened in one has no course in time."""
    ends = np.flatnonzero(np.diff(master.time, append=np.inf) > OUTAGE * master.interval)
    begins = np.append(0, ends[:-1] + 1)
    longest = int(np.argmax(ends - begins))
    return master[begins[longest] : ends[longest] + 1]


def parted_clocks(slave: ImuRecord, master: MasterRecord, C_mb: Array, delay: float) -> Evidence | None:
    """That the first and the last third of what both logs show are late by different delays; None where nothing says so.

    A master that runs before and after the slave's log shows motion there that the slave has not seen: any resemblance is chance.
    """
    common = (master.time - delay >= slave.time[0]) & (master.time - delay <= slave.time[-1])
    rows = np.flatnonzero(common)
    if rows.size < 2:
        return None
    master = master[rows[0] : rows[-1] + 1]
    first, last = len(master) // 3, 2 * len(master) // 3
    if first < 2:
        return None
    # Half a window: where the agreement is just sure, a delay is found to a tenth of it.
    shortest = max(0.5 * WINDOW["rate" if master.C_nb is not None else "force"], master.interval)
    parts = _unbroken(master[:first]), _unbroken(master[last:])
    if min(map(len, parts)) < 2:
        return None
    found = [find_delay(slave, part, C_mb) for part in parts]
    if not all(part.agree for part in found):
        return None
    begin, end = (part.delay for part in found)
    if abs(end - begin) < shortest:
        return None
    # What comes again and again, such as turns, a sea or a rotor, agrees at many delays, and chance says which is best: one that
    # fits both parts is that of the clock.
    own = [_left(slave, part, C_mb, one) for part, one in zip(parts, (begin, end), strict=True)]
    for one in (begin, end, delay, find_delay(slave, _unbroken(master), C_mb).delay):
        if all(_left(slave, part, C_mb, one) < MISFIT * least for part, least in zip(parts, own, strict=True)):
            return None
    return contradiction(
        "transfer.clocks_part",
        "part_of_logs",
        "put_times_right",
        before=begin,
        until=float(master.time[first - 1]),
        after=end,
        since=float(master.time[last]),
    )


def _left(slave: ImuRecord, part: MasterRecord, C_mb: Array, delay: float) -> float:
    """Share of a part's motion that its agreement at a delay leaves."""
    return 1.0 - max(agreement(slave, part, C_mb, delay), 0.0) ** 2


def model_from_spec(
    spec: ImuSpec,
    assumed: Assumed,
    attitude: bool,
    flexure: tuple[Array, float] | None,
    delay_walk: float,
    master: MasterErrors | None = None,
    axes: tuple[Group, ...] | None = None,
) -> TransferModel:
    """The error model of a specification; instabilities become random walks of the biases.

    `axes` are the groups of axes that a log asks for, those of :func:`turning_axes` when left out.
    """
    axes = turning_axes(spec) if axes is None else axes
    as_noise = 0.0 if any(group.name == GYRO_AXES for group in axes) else TURN_TIME  # constants, or noise
    sigma, beta = ((0.0, 0.0, 0.0), 1.0) if flexure is None else (tuple(float(x) for x in flexure[0]), flexure[1])
    return TransferModel.of(
        spec,
        turn_noise=(spec.gyro_scale_factor**2 * as_noise, spec.gyro_misalignment**2 * as_noise),
        axes=axes,
        delay=assumed.delay_sigma > 0.0,
        lever_arm=assumed.lever_arm_sigma > 0.0,
        mounting=attitude and assumed.mounting_sigma > 0.0,
        delay_walk=delay_walk if assumed.delay_sigma > 0.0 else 0.0,
        flexure_sigma=sigma,
        flexure_beta=beta,
        master=master or MasterErrors(),
    )


def model_for(
    spec: ImuSpec,
    assumed: Assumed,
    what: Matched,
    flexure: FlexureSpec | None,
    errors: MasterErrors,
    axes: tuple[Group, ...],
) -> TransferModel:
    """States for what is matched; of the master's errors, those that act on it."""
    of_rows = errors
    if what.translation != "velocity":
        of_rows = replace(of_rows, velocity=0.0, velocity_drift=0.0)
    if not what.attitude and what.translation != "acceleration":
        of_rows = replace(of_rows, attitude_drift=0.0, heading_drift=None, level=0.0, heading=0.0)
    bend = None if flexure is None else (np.array(flexure.sigma)[[1, 2, 0]], flexure.beta)  # turn, pitch, roll
    model = model_from_spec(spec, assumed, what.attitude, bend, DELAY_WALK, of_rows, axes)
    if flexure is not None and what.translation is not None:
        model = replace(model, coupling=flexure.coupling, coupling_sigma=flexure.coupling_sigma)
    if what.translation == "position":  # place and velocity are against a master whose own velocity error wanders
        walk = math.sqrt(2.0 / errors.correlation_time) * errors.velocity_drift
        model = replace(model, accel_random_walk=math.hypot(model.accel_random_walk, walk))
    if what.translation == "velocity":
        model = replace(model, filter=filter_sigmas(errors.filter, what.attitude))
    return replace(model, arm_considered=what.translation == "acceleration")


def bias_sigmas(spec: ImuSpec) -> tuple[Array, Array]:
    """(3,) sigmas of what acts as gyro and accelerometer bias: at level, scale factor and misalignment times gravity too."""
    variance = spec.bias_variance
    force = math.hypot(spec.accel_scale_factor, spec.accel_misalignment) * GRAVITY_EQUATOR
    return np.sqrt(variance[:3]), np.hypot(np.sqrt(variance[3:]), force)


def hand_over(
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    spec: ImuSpec,
    assumed: Assumed,
    noise: tuple[float, float],  # (velocity, attitude) m/s and rad: of the master's rows
    position: Position | None,  # where the master gives none
    errors: MasterErrors,  # all that is said of the master's own, also those that no row bears: it hands the start over
) -> tuple[ImuRecord, Start]:
    """The slave's record from the master's first row on, and its first state as the master gives it.

    Raises
    ------
    DataError
        No rows in common.
    UsageError
        Neither a place nor a heading is known.
    """
    first = int(np.searchsorted(slave.time, master.time[0] - assumed.delay))
    if first > len(slave) - 2 or master.time[-1] - assumed.delay <= slave.time[0]:
        raise DataError(
            f"{master.source}: no row falls into the slave's record ({slave.time[0]:.3f} s to {slave.time[-1]:.3f} s, the master's "
            f"from {master.time[0]:.3f} s to {master.time[-1]:.3f} s less {assumed.delay:.3f} s): check `mounting.latency`"
        )
    part = slave[first + 1 :]
    begin = float(slave.time[first])
    at: dict[str, Any] = {
        k: v if v is None else v[0] for k, v in interpolated(master, np.array([begin + assumed.delay])).items()
    }
    if at["lat"] is not None:
        lat, lon, alt = float(at["lat"]), float(at["lon"]), float(at["alt"])
    elif position is not None:
        lat, lon, alt = position.lat, position.lon, position.alt
    else:
        raise UsageError(f"{master.source}: no position in it; give one (`place`)")

    dtheta, dvel = increments(part)
    rows = max(1, round(FIRST / part.interval))
    w, f = dtheta[:2].mean(axis=0) / part.interval, dvel[:rows].mean(axis=0) / part.interval
    C_nm = at["C_nb"]
    if C_nm is not None:
        C = np.asarray(C_nm @ assumed.C_mb)
        phi = np.full(3, noise[1] if np.isfinite(noise[1]) else math.radians(0.02))
        phi = np.hypot(phi, float(np.linalg.norm(w)) * assumed.delay_sigma)
        if not model.mounting:
            phi = np.hypot(phi, assumed.mounting_sigma)
        if ATTITUDE_ERROR not in model.groups:  # not matched, and handed over once
            phi = np.hypot(phi, errors.attitude)
    else:
        C = _from_course(master, assumed, f)
        phi = np.array([LEVEL_SIGMA, LEVEL_SIGMA, COURSE_SIGMA])
    v = np.zeros(3) if at["v_n"] is None else at["v_n"] + C @ np.cross(w, assumed.lever_arm)
    if at["lat"] is not None:  # a place of the master that is off by an arm of 40 m is four sigmas off
        R_M, R_N = radii(lat)
        east, north, up = C @ assumed.lever_arm
        lat, lon, alt = lat + north / (R_M + alt), lon + east / ((R_N + alt) * math.cos(lat)), alt + up
    force = float(np.linalg.norm(C @ f - [0.0, 0.0, GRAVITY_EQUATOR]))
    slack = math.hypot(force * assumed.delay_sigma, float(np.linalg.norm(w)) * assumed.lever_arm_sigma)
    dv = math.hypot(0.1 if at["v_n"] is not None else 300.0, slack)
    if np.isfinite(noise[0]):
        dv = math.hypot(dv, noise[0])
    gyro, accel = bias_sigmas(spec)
    if ACCEL_AXES in model.groups:
        accel = np.sqrt(spec.bias_variance[3:])
    P = model.prior(
        dv,
        phi,
        accel,
        gyro,
        tau=assumed.delay_sigma,
        arm=assumed.lever_arm_sigma,
        mounting=assumed.mounting_sigma,
        dp=math.sqrt(
            PLACE_SIGMA**2 + (float(np.linalg.norm(v)) * assumed.delay_sigma) ** 2 + assumed.lever_arm_sigma**2
        ),
        C_nb=None if C_nm is None else C,
        C_mb=assumed.C_mb,
    )
    return part, Start(begin, C, v, lat, lon, alt, np.zeros(3), np.zeros(3), P)


def _from_course(master: MasterRecord, assumed: Assumed, f: Array) -> Array:
    """Attitude from the course (or a given heading) and the specific force less the vehicle's own acceleration."""
    assert master.v_n is not None
    rows = max(2, round(FIRST / master.interval))
    v = master.v_n[:rows]
    east, north = v[:, :2].mean(axis=0)
    if assumed.heading is not None:
        heading = assumed.heading
    elif math.hypot(east, north) > SLOWEST:
        heading = math.atan2(east, north) + float(euler_from_dcm(assumed.C_mb)[0])
    else:
        raise UsageError(
            f"{master.source}: it gives velocity alone, and {math.hypot(east, north):.1f} m/s at the start, too slow for a course: "
            "give a master with attitude, a part of the logs that begins on the move (`record.between`), or the slave's `heading`"
        )
    t = master.time[:rows] - master.time[:rows].mean()
    a_n = t @ v / float(t @ t)
    up_n = a_n + np.array([0.0, 0.0, GRAVITY_EQUATOR])
    level = dcm_from_euler(heading, 0.0, 0.0).T @ up_n  # in the level axes of that heading
    # Pitch and roll that turn the measured force into it, to first order in the lean of the force itself.
    g = float(np.linalg.norm(f))
    roll = math.asin(max(-1.0, min(1.0, (level[0] - f[0]) / g)))
    pitch = math.asin(max(-1.0, min(1.0, (f[1] - level[1]) / g)))
    return np.asarray(dcm_from_euler(heading, pitch, roll))


def sigma_of_mounting(P: Array, at: slice | None, C_mb: Array) -> Array:
    """(3,) sigmas about the slave's z, x and y: those of heading, pitch and roll where these are small."""
    if at is None:
        return np.zeros(3)
    return np.asarray(np.sqrt(np.diag(C_mb.T @ P[at, at] @ C_mb))[[2, 0, 1]])


def misalignment_covariance(P: Array) -> tuple[Array, Array]:
    """Covariance of phi, and the part of it that goes along with what does not change: biases, delay, lever arm, mounting.

    That part (the regression on those states) is what more time in the same motion does not improve.
    """
    rest = slice(BG.start, P.shape[-1])
    whole, cross, own = P[..., PHI, PHI], P[..., PHI, rest], P[..., rest, rest]
    scale = np.sqrt(np.diagonal(own, axis1=-2, axis2=-1))
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = own / (scale[..., :, None] * scale[..., None, :]) + 1e-10 * np.eye(own.shape[-1])
    c = cross / scale[..., None, :]
    return whole, c @ np.linalg.solve(unit, np.swapaxes(c, -1, -2))
