"""`align`: from a log of a base that stays where it is to attitude, biases and a verdict."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.drift import Drift, detect_drift
from truenorth.alignment.epoch import Epoch, find_epoch
from truenorth.alignment.fine import FineAlignment, attitude_history, fine_align
from truenorth.alignment.bias import bias_prior, spec_variance, true_bias
from truenorth.alignment.inference import LogCheck, infer_spec, walks
from truenorth.alignment.result import UNIFORM_SIGMA, Alignment, History
from truenorth.alignment.verdict import Circumstances, judge
from truenorth.attitude import dcm_from_euler, euler_from_dcm
from truenorth.calibration import Calibration
from truenorth.coarse import CoarseAttitude, analytic, coarse_covariance, dual_vector, means, oba
from truenorth.coarse.analytic import Means, static_jacobian
from truenorth.coarse.uncertainty import base_velocity
from truenorth.earth import EARTH_RATE, earth_rate_n, normal_gravity
from truenorth.errors import AlignmentError, DataError, UsageError
from truenorth.inertial import earth_rotation, integrate
from truenorth.models.static import StaticModel
from truenorth.position import Position
from truenorth.quality.regimes import MotionSummary, motion_summary
from truenorth.records import ImuRecord
from truenorth.specs import ImuSpec, imu_spec

Array = NDArray[np.float64]
Method = Literal["auto", "analytic", "inertial", "oba", "kalman"]

HEADING_LIMIT = math.radians(5.0)
DEFLECTION = math.radians(
    5.0 / 3600.0
)  # of the vertical, one sigma: what gravity's direction differs from the normal
FILTER_INTERVAL = 1.0  # s
FEWEST_EPOCHS, MOST_EPOCHS = 60, 5000
SHORTEST = 1.0  # s: below that no mean is worth its name
SHORTEST_FILTER = 20.0  # s: below that the filter cannot tell the base's motion from tilt
LONGEST_BRIDGE = 4.5  # nominal intervals: up to three lost samples are bridged by the next one's rate
BLIND_RATE = math.radians(5.0) / 3600.0  # rad/s: a mean rate this far from the earth's holds no heading
LOOSE_GYRO, LOOSE_ACCEL = math.radians(10.0) / 3600.0, 0.5  # rad/s, m/s^2: priors that let the log speak
HELD_GYRO, HELD_ACCEL = 1e-3 * LOOSE_GYRO, 1e-3 * LOOSE_ACCEL
LONGEST_BLIND = 120.0  # s: a gyro that does not see the earth turn carries attitude no longer than this


@dataclass(frozen=True)
class _Task:
    """One alignment: the data, where, with what, and for when."""

    record: ImuRecord
    position: Position
    interval: float
    epoch: Epoch
    motion: MotionSummary
    means: Means

    @property
    def lat_rate(self) -> Array:
        """``dw_ie_n/dL``, rad/s a radian."""
        return EARTH_RATE * np.array([0.0, -math.sin(self.position.lat), math.cos(self.position.lat)])

    @property
    def gravity(self) -> float:
        """Normal gravity, m/s^2."""
        return float(normal_gravity(self.position.lat, self.position.alt))

    def bias_prior(self, spec: ImuSpec, C_n_b: Array) -> Array:
        """(6, 6) prior covariance of what acts as gyro and accelerometer bias here."""
        return bias_prior(spec, C_n_b, self.position, self.lat_rate, self.gravity)

    @property
    def deflection(self) -> Array:
        """(3, 3) covariance of phi from the deflection of the vertical: it tilts as an accelerometer bias would."""
        J = static_jacobian(self.position.lat, self.gravity)[:, :2] * (DEFLECTION * self.gravity)
        return J @ J.T

    def in_navigation_axes(self, covariance_n0: Array, time: float) -> Array:
        """Turn a covariance of phi from n0 to n at a time since the start of the log."""
        C = earth_rotation(time, self.position.lat).T
        return C @ covariance_n0 @ C.T


def align(
    record: ImuRecord,
    position: Position,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    method: Method = "auto",
    *,
    at: float | None = None,
    calibration: Calibration | None = None,
    heading_limit: float = HEADING_LIMIT,
    progress: Callable[[str], None] | None = None,
) -> Alignment:
    """Find pitch, roll and true heading of an IMU on a base that stays where it is: still, shaken or swaying.

    Parameters
    ----------
    record : ImuRecord
        Body axes RFU; heading is that of the y axis, clockwise from true north.
    position : Position
    imu : ImuSpec, str, path or mapping, optional
        Specification, a preset's name, or a YAML file. Without one the scale of the errors is inferred from the log.
    method : {"auto", "analytic", "inertial", "oba", "kalman"}
        ``analytic``: TRIAD on mean rate and specific force (still base only). ``inertial``: dual vector in the
        inertial frame. ``oba``: optimisation-based alignment. ``kalman``: coarse (oba), then a Kalman filter on
        velocity, re-linearised. ``auto`` looks at the motion, picks, and says why.
    at : float, s, optional
        Epoch of the answer on the record's clock; the last sample when left out.
    calibration : Calibration, optional
        Known bias, scale factor and misalignment, taken off first.
    heading_limit : float, rad
        Largest one-sigma heading error that still counts as `aligned`.
    progress : callable, optional
        Called with a word about each stage.

    Returns
    -------
    Alignment

    Raises
    ------
    UsageError
        An unknown method, an epoch outside the record, a limit that is not positive.
    DataError
        A gap in the log that cannot be bridged.
    AlignmentError
        Too short a log for any answer.
    """
    tell = progress or (lambda stage: None)
    if method not in get_args(Method):
        raise UsageError(f"method {method!r} is not known; choose one of {', '.join(get_args(Method))}")
    if not heading_limit > 0.0:
        raise UsageError(f"heading limit {np.degrees(heading_limit):g} deg; expected a positive angle")
    spec = None if imu is None else imu_spec(imu)
    if calibration is not None:
        record = calibration.apply(record)
    record = _bridged(record)
    if record.duration < SHORTEST or len(record) < 10:
        raise AlignmentError(
            f"{record.source}: {len(record)} samples over {record.duration:g} s; at least 10 samples and {SHORTEST:g} s "
            "are needed to level, and minutes to find north: record longer"
        )

    tell("looking at the motion")
    motion = motion_summary(record)
    chosen, why = _choose(method, record, motion)
    task = _Task(record, position, _filter_interval(record), find_epoch(record, at), motion, means(record))
    tell(f"aligning: {chosen}")
    if chosen == "analytic":
        answer, check = _align_analytic(task, spec)
        settled, drift = True, None
    else:
        answer, check, settled, drift = _align_inertial(task, spec, chosen)
    answer = replace(answer, method=chosen, method_reason=why)
    status, reasons = judge(answer, Circumstances(heading_limit, check, _moves_from(motion), settled, drift))
    return answer.with_verdict(status, reasons)


def _choose(method: Method, record: ImuRecord, motion: MotionSummary) -> tuple[str, str]:
    if method != "auto":
        return method, "asked for"
    if record.duration < SHORTEST_FILTER:
        return "analytic", (
            f"the log is {record.duration:.1f} s long, too short for a filter ({SHORTEST_FILTER:g} s): mean values only"
        )
    words = {
        "still": "the base is still: the filter weighs sensor noise and bias as it should, from the first second on",
        "disturbed": "the base is disturbed: mean rates would be off, the inertial frame is not",
        "swaying": "the base sways: mean rates mean nothing, the inertial frame follows every motion",
    }
    return "kalman", words.get(
        motion.overall, f"the base is {motion.overall}: only the inertial frame follows it"
    )


def _align_analytic(task: _Task, spec: ImuSpec | None) -> tuple[Alignment, LogCheck]:
    check = _check_means(task.means, task.position.lat, task.gravity)
    used, where = _specification(task, spec, check)
    P = task.bias_prior(used, _level_of(task.means.f_b).T)
    C_nb, covariance, floor = analytic(
        task.means,
        task.position.lat,
        task.position.alt,
        float(np.sqrt(P[0, 0])),
        float(np.sqrt(P[3, 3])),
    )
    T = task.record.duration
    walk = static_jacobian(task.position.lat, task.gravity) * np.repeat(
        [used.accel_random_walk, used.gyro_random_walk], 3
    )
    covariance = covariance + walk @ walk.T / T
    answer = _assemble(task, used, where, C_nb, covariance, floor)
    return answer, check


def _align_inertial(
    task: _Task, spec: ImuSpec | None, method: str
) -> tuple[Alignment, LogCheck, bool, Drift | None]:
    lat, alt = task.position.lat, task.position.alt
    check = _check_means(task.means, lat, task.gravity)
    pre_bias = np.zeros(6)
    blind = _is_blind(task.motion, check)
    if blind:
        task = _last_part(task)
        check = _check_means(task.means, lat, task.gravity)
        # The earth's rate is lost in the gyro bias: take off all of the mean rate but what level and latitude tell.
        up_b = task.means.f_b / np.linalg.norm(task.means.f_b)
        pre_bias[:3] = task.means.w_ib_b - EARTH_RATE * math.sin(lat) * up_b

    rows = np.array([task.epoch.row])
    integrals = integrate(task.record, task.interval, pre_bias[:3], rows_at=rows)
    coarse = _coarse(task, integrals, method, blind)
    if not blind:
        check = _check_filter(task, coarse.C_n0_i)
    used, where = _specification(task, spec, check)
    P = task.bias_prior(used, coarse.C_n0_i.T)
    model = StaticModel(*walks(used))

    if method != "kalman":
        disturbance = np.sqrt(np.mean(base_velocity(integrals, coarse.C_n0_i, lat, alt) ** 2, axis=0))
        covariance, floor = coarse_covariance(coarse, integrals, model, P, disturbance)
        C_ib = task.epoch.attitude(integrals.C_ib_at[0])
        C_n0_b = coarse.C_n0_i @ C_ib
        answer = _at_epoch(task, used, where, C_n0_b, covariance, floor, blind)
        return replace(answer, disturbance=disturbance), check, True, None

    P_run = P.copy()
    if blind:
        off = float(np.hypot(*check.rate_residual)) + EARTH_RATE
        P_run[:3, :3] += off**2 * np.eye(3)
    fine = fine_align(
        task.record,
        coarse.C_n0_i,
        task.position,
        model,
        P_run,
        interval=task.interval,
        nominal_bias=pre_bias,
        rows_at=rows,
        heading_known=blind,
    )
    C_ib = task.epoch.attitude(fine.integrals.C_ib_at[0])
    C_n0_b, covariance, floor = fine.misalignment_at(C_ib, task.epoch.elapsed)
    answer = _at_epoch(task, used, where, C_n0_b, covariance, floor, blind)
    history = _history(task, fine, used, blind)
    bias, sigma = true_bias(fine.bias, np.diag(fine.P)[6:], np.diag(P_run), spec_variance(used))
    answer = replace(
        answer,
        gyro_bias=bias[:3],
        gyro_bias_sigma=sigma[:3],
        accel_bias=bias[3:],
        accel_bias_sigma=sigma[3:],
        disturbance=fine.disturbance,
        history=history,
        pays_until=None if blind else _pays_until(history, answer, fine, task),
    )
    return answer, check, fine.settled, None if blind else detect_drift(fine)


def _coarse(task: _Task, integrals: Any, method: str, blind: bool) -> CoarseAttitude:
    lat, alt = task.position.lat, task.position.alt
    coarse = dual_vector(integrals, lat, alt) if method == "inertial" else oba(integrals, lat, alt)
    if not blind:
        return coarse
    # No heading to be had: level as found from the mean specific force, heading zero by convention.
    return replace(coarse, C_n0_i=_level_of(integrals.velocity[-1]))


def _level_of(f_b: Array) -> Array:
    """``C_nb`` with the pitch and roll that a specific force tells, and heading zero."""
    up = f_b / np.linalg.norm(f_b)
    return dcm_from_euler(0.0, math.asin(float(np.clip(up[1], -1.0, 1.0))), math.atan2(-up[0], up[2]))


def _check_means(m: Means, lat: float, g: float) -> LogCheck:
    """What the means of a still base tell of the biases."""
    f = float(np.linalg.norm(m.f_b))
    up = m.f_b / f
    w_up = float(m.w_ib_b @ up)
    level = m.w_ib_b - w_up * up
    w_level = float(np.linalg.norm(level))
    north = level / w_level if w_level > 0 else np.zeros(3)
    return LogCheck(
        rate_residual=np.array([w_level - EARTH_RATE * math.cos(lat), w_up - EARTH_RATE * math.sin(lat)]),
        rate_noise=np.sqrt([north @ m.w_covariance @ north, up @ m.w_covariance @ up]),
        force_residual=f - g,
        force_noise=float(np.sqrt(up @ m.f_covariance @ up)),
    )


def _check_filter(task: _Task, C_n0_i: Array) -> LogCheck:
    """What the inertial frame tells of the biases: a filter that believes in no specification."""
    # Loose where the log can answer, held where tilt or heading would take the blame.
    C_n_b = C_n0_i.T
    P = np.zeros((6, 6))
    P[:3, :3] = C_n_b @ np.diag([HELD_GYRO**2, LOOSE_GYRO**2, LOOSE_GYRO**2]) @ C_n_b.T
    P[3:, 3:] = C_n_b @ np.diag([HELD_ACCEL**2, HELD_ACCEL**2, LOOSE_ACCEL**2]) @ C_n_b.T
    best = imu_spec("navigation")
    model = StaticModel(best.gyro_random_walk, best.accel_random_walk)
    fine = fine_align(task.record, C_n0_i, task.position, model, P, interval=task.interval)
    C = earth_rotation(fine.integrals.time[-1], task.position.lat).T @ fine.C_n0_i @ fine.integrals.C_ib[-1]
    bias, cov = fine.bias, fine.P
    rate, rate_P = C @ bias[:3], C @ cov[6:9, 6:9] @ C.T
    force, force_P = C @ bias[3:], C @ cov[9:, 9:] @ C.T
    slope = float(normal_gravity(task.position.lat, task.position.alt + 1.0)) - task.gravity
    return LogCheck(
        rate_residual=rate[1:],
        rate_noise=np.sqrt(np.diag(rate_P)[1:]),
        force_residual=float(force[2]),
        force_noise=float(np.hypot(np.sqrt(force_P[2, 2]), slope * task.position.vertical_sigma)),
    )


def _is_blind(motion: MotionSummary, check: LogCheck) -> bool:
    """Whether the mean rate of a base that does not turn is so far from the earth's that it holds no heading."""
    if motion.overall not in ("still", "disturbed"):
        return False
    noise = 5.0 * float(np.max(check.rate_noise))
    return float(np.hypot(*check.rate_residual)) > max(BLIND_RATE, noise)


def _last_part(task: _Task) -> _Task:
    """The last two minutes before the epoch: level needs no more, and a poor gyro's bias changes over longer."""
    record, at = task.record, task.epoch.time
    if record.duration <= LONGEST_BLIND:
        return task
    stop = max(at, record.time[0] + LONGEST_BLIND)
    record = record.between(stop - LONGEST_BLIND, stop)
    return replace(
        task,
        record=record,
        interval=_filter_interval(record),
        epoch=find_epoch(record, at),
        means=means(record),
    )


def _moves_from(motion: MotionSummary) -> float | None:
    """When the base first goes somewhere, s on the record's clock; None if it stays."""
    return next((float(stretch.start) for stretch in motion.regimes if stretch.kind == "moving"), None)


def _specification(task: _Task, spec: ImuSpec | None, check: LogCheck) -> tuple[ImuSpec, str]:
    if spec is not None:
        return spec, f"specification {spec.name!r}"
    return infer_spec(task.record, check, task.motion.overall == "still"), "inferred from the log"


def _at_epoch(
    task: _Task,
    spec: ImuSpec,
    where: str,
    C_n0_b: Array,
    covariance: Array,
    floor: Array,
    blind: bool,
) -> Alignment:
    """An answer given in n0, turned into navigation axes at the epoch asked for."""
    time = task.epoch.elapsed
    covariance, floor = task.in_navigation_axes(covariance, time), task.in_navigation_axes(floor, time)
    if blind:
        covariance, floor = _without_heading(covariance), _without_heading(floor)
    C_nb = earth_rotation(time, task.position.lat).T @ C_n0_b
    return _assemble(task, spec, where, C_nb, covariance, floor)


def _assemble(
    task: _Task, spec: ImuSpec, where: str, C_nb: Array, covariance: Array, floor: Array
) -> Alignment:
    prior = np.sqrt(spec_variance(spec))
    return Alignment(
        status="not_converged",
        reasons=(),
        method="",
        method_reason="",
        time=task.epoch.time,
        C_nb=C_nb,
        phi_covariance=covariance + task.deflection,
        phi_floor=floor + task.deflection,
        gyro_bias=np.zeros(3),
        gyro_bias_sigma=prior[:3],
        gyro_bias_prior=prior[:3],
        accel_bias=np.zeros(3),
        accel_bias_sigma=prior[3:],
        accel_bias_prior=prior[3:],
        position=task.position,
        imu=spec,
        imu_source=where,
        duration=task.record.duration,
        disturbance=np.full(3, np.nan),
        source=task.record.source,
    )


def _history(task: _Task, fine: FineAlignment, used: ImuSpec, blind: bool) -> History:
    C_nb, covariance, floor = attitude_history(fine, task.position.lat)
    if blind:
        covariance, floor = _without_heading(covariance), _without_heading(floor)
    e, P0 = fine.estimates, np.diag(fine.system.P0)[6:]
    bias, sigma = true_bias(
        fine.nominal_bias + e.x[:, 6:], np.einsum("kii->ki", e.P)[:, 6:], P0, spec_variance(used)
    )
    return History(
        time=fine.integrals.start + fine.integrals.time[1:],
        C_nb=C_nb,
        phi_covariance=covariance + task.deflection,
        phi_floor=floor + task.deflection,
        gyro_bias=bias[:, :3],
        gyro_bias_sigma=sigma[:, :3],
        accel_bias=bias[:, 3:],
        accel_bias_sigma=sigma[:, 3:],
        innovation=e.innovation,
        innovation_sigma=np.sqrt(np.einsum("kii->ki", e.innovation_covariance)),
        nis=e.nis,
    )


def _pays_until(history: History, answer: Alignment, fine: FineAlignment, task: _Task) -> float | None:
    """Length of data after which the random part of heading's sigma is below half its floor.

    Read off the history, or extrapolated by the power law of its second half.
    """
    floor = math.sqrt(answer.phi_floor[2, 2])
    elapsed = history.time - fine.integrals.start
    random = np.sqrt(np.maximum(history.phi_covariance[:, 2, 2] - history.phi_floor[:, 2, 2], 1e-20))
    below = np.flatnonzero(random < 0.5 * floor)
    if below.size:
        return float(elapsed[below[0]])
    half = len(elapsed) // 2
    slope = math.log(random[-1] / random[half]) / math.log(elapsed[-1] / elapsed[half])
    if slope > -0.2:
        return None
    return float(elapsed[-1] * (0.5 * floor / random[-1]) ** (1.0 / slope))


def _without_heading(covariance: Array) -> Array:
    """The same covariance of level, with nothing known of heading."""
    result = covariance.copy()
    result[..., 2, :] = 0.0
    result[..., :, 2] = 0.0
    result[..., 2, 2] = UNIFORM_SIGMA**2
    return result


def _filter_interval(record: ImuRecord) -> float:
    longest = max(FILTER_INTERVAL, record.duration / MOST_EPOCHS)
    return max(2.0 * record.interval, min(longest, record.duration / FEWEST_EPOCHS))


def _bridged(record: ImuRecord) -> ImuRecord:
    """The record with up to three lost samples in a row bridged; longer gaps are refused."""
    gaps = record.gaps
    if gaps.size == 0:
        return record
    steps = record.steps / record.interval
    worst = int(gaps[np.argmax(steps[gaps])])
    if steps[worst] > LONGEST_BRIDGE:
        raise DataError(
            f"{record.source}: row {worst + 1}, column time: a gap of {record.steps[worst]:.3f} s after "
            f"{record.time[worst - 1]:.3f} s, where samples come every {record.interval:.4f} s; what the base did in it is "
            "not known: align a part without the gap (--from, --to)"
        )
    if record.kind == "rates":
        return record
    scale = np.ones(len(record))
    scale[gaps] = steps[gaps]
    return replace(record, gyro=record.gyro * scale[:, None], accel=record.accel * scale[:, None])
