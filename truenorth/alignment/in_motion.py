"""`align_in_motion`: attitude of a vehicle that moves from the first second on, from an odometer, GNSS, or both."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Literal, TypeGuard, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import BASELINE
from truenorth.aiding.sensors import from_gnss, from_odometer, from_velocity
from truenorth.aiding.source import Aiding
from truenorth.alignment.azimuth import AZIMUTH_METHODS, azimuth_track
from truenorth.alignment.in_motion_latitude import NARROWED, PRIOR, find_latitude
from truenorth.alignment.in_motion_start import (
    Guess,
    backtracked,
    coarse_guess,
    departures,
    guesses_all_round,
    start_at,
)
from truenorth.alignment.in_motion_verdict import judge_moving
from truenorth.alignment.moving import fifteen, moving_of
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.task import deflection_covariance
from truenorth.core.attitude import UNIFORM_SIGMA
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import METRES_PER_RADIAN, Position
from truenorth.core.units import significant
from truenorth.errors.group import Group, groups_of
from truenorth.errors.log import LogErrors
from truenorth.errors.model import InsModel
from truenorth.estimate.rivals import jump_evidence, misfit, wandering_evidence
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation.procedure import bridge_gaps
from truenorth.navigation.stops import seconds_at_rest, updates_at
from truenorth.navigation.whereabouts import check_fixes
from truenorth.quality.gnss import gnss_evidence
from truenorth.quality.record_evidence import moving_evidence
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.calibration import Calibration
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence, note, notes
from truenorth.state.layout import BA, BG, DP, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]
Method = Literal["auto", "gyrocompass", "motion"]

HEADING_LIMIT = math.radians(5.0)
SHORTEST = 10.0  # s
INTERVAL = 0.5  # s, of the filter's prediction
OUTPUT = 1.0  # s, of the history
GYROCOMPASS = math.radians(20.0)  # of heading by bias, up to which the gyros are asked for north first
BANK_TIME = 300.0  # s of log by which the headings of the bank compete
NO_LOG_ERRORS = LogErrors()
WHEEL = Mounting(scale_sigma=0.03, angle_sigma=math.radians(3.0), lever_arm_sigma=1.0)
PASSES = 2
SOMEWHERE = math.radians(45.0)  # where the latitude is not known (yet)
POSITION_FLOOR, VELOCITY_FLOOR = 0.05, 0.05  # m, m/s
RECEIVER_BIAS, RECEIVER_TIME = 2.0, 60.0  # m, s: multipath and atmosphere, alike from fix to fix
LATENCY_SIGMA = 0.2  # s, of a receiver of which nothing is said


@dataclass(frozen=True)
class _Task:
    """What all passes share."""

    record: ImuRecord
    spec: ImuSpec
    model: InsModel
    position: Position
    odometer: OdometerRecord | VelocityRecord | None  # what shows velocity in body axes
    gnss: GnssRecord | None
    wheel: Mounting
    antenna: Mounting
    stops: Sequence[Aiding]  # and gaps of the log
    more: Sequence[Aiding]
    slow: LogErrors = NO_LOG_ERRORS

    def aiding(self, *, gated: bool) -> list[Aiding]:
        """Of all sensors; without gates as long as the filter may be wrong itself."""
        wheel, antenna = (m if gated else replace(m, gate=0.0) for m in (self.wheel, self.antenna))
        found = list(self.stops)
        if self.odometer is not None:
            log = self.odometer
            found += (
                from_odometer(log, wheel) if isinstance(log, OdometerRecord) else from_velocity(log, wheel, self.slow)
            )
        if self.gnss is not None:
            found += from_gnss(self.gnss, antenna)
        return found + [source if gated else replace(source, gate=0.0) for source in self.more]

    def run(self, guess: Guess, *, gated: bool, until: float | None = None) -> Track:
        """One pass from a guess of the attitude at the start."""
        record = self.record if until is None else self.record.between(self.record.time[0], until)
        used = self.aiding(gated=gated)
        start = start_at(self.record, guess, self.position, self.spec, self.odometer, self.gnss, self.wheel)
        return navigate_track(
            record,
            start,
            with_states(self.model, used),
            used,
            interval=INTERVAL,
            every=max(1, round(OUTPUT / INTERVAL)),
            invariant=self.odometer is not None,
        )

    def by_the_earth(self) -> Guess:
        """Coarse alignment."""
        return coarse_guess(self.record, self.position, self.odometer, self.gnss, self.wheel, self.antenna)


def align_in_motion(
    record: ImuRecord,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any],
    *,
    odometer: OdometerRecord | None = None,
    gnss: GnssRecord | None = None,
    velocity: VelocityRecord | None = None,
    velocity_errors: LogErrors = NO_LOG_ERRORS,
    position: Position | None = None,
    wheel: Mounting | None = None,
    antenna: Mounting | None = None,
    sources: Sequence[Aiding] = (),
    errors: Sequence[Group | str] = (),
    zupt: bool = True,
    method: str = "auto",
    heading_limit: float = HEADING_LIMIT,
    calibration: Calibration | None = None,
    offset: float = 0.0,
    passes: int = PASSES,
    progress: Callable[[str], None] | None = None,
) -> Alignment:
    """Find pitch, roll and heading of a vehicle under way, from no knowledge of its heading.

    Coarse alignment in the inertial frame (:mod:`truenorth.coarse.odometer`), or a bank of headings all round where the gyros
    are too poor to find north; a closed loop with invariant errors over the whole log; and the log once more from its
    beginning, from where the first pass says it began (backtracking).

    Parameters
    ----------
    record : ImuRecord
        Body axes RFU, about: heading is that of the y axis.
    imu : ImuSpec, str, path or mapping
        Specification of the IMU; a log on the move cannot be asked for it.
    odometer, gnss, velocity : records, one at least
        On the IMU's clock. `velocity` is a Doppler or speed log in body axes, in the place of an odometer.
    velocity_errors : LogErrors
        Its slow errors besides those of its mounting; none when left out.
    position : Position, optional
        At the start; not needed with GNSS positions. Without either the latitude is found from the log by gyros that see the
        earth turn, and said among the reasons.
    wheel, antenna : Mounting, optional
        How they sit; `wheel` is that of a velocity log, too. Left out, scale (3 %), mounting angles (3 deg) and lever arm (1 m)
        of wheel or log are estimated.
    sources : sequence of Aiding
        Further measurements, such as rows of one's own.
    errors : sequence of Group or str
        Further error states of the INS, or names of plug-ins that make them.
    zupt : bool
        Use stops: seconds in which the wheel, or GNSS, says that nothing moves.
    method : {"auto", "gyrocompass", "motion", ...}
        Where the heading begins: coarse alignment by the earth's rate, or a bank of headings that motion decides between. Published
        filters, to be compared (:mod:`truenorth.alignment.azimuth`): ekf, ukf, ckf, gh3, gh5, gh7, sgkf3, sgkf7, sgkf.
    offset : float, s
        Added to the times of the aiding logs.
    passes : int
        Over the log, two or more with backtracking.
    calibration, heading_limit, progress
        As of :func:`truenorth.align`.

    Returns
    -------
    Alignment
        At the last sample, with `moving`: velocity, covariance, the wheel's scale and mounting.

    Raises
    ------
    UsageError
        Neither odometer, velocity log nor GNSS; an option out of range.
    DataError
        Aiding logs that do not overlap; a gap that cannot be bridged.
    AlignmentError
        Too short a log.
    """
    tell = progress or (lambda stage: None)
    body = _in_body_axes(odometer, velocity)
    task = _task(record, imu, body, gnss, position, wheel, antenna, sources, zupt, calibration, offset)
    model = replace(task.model, groups=(*task.model.groups, *groups_of(errors, task.spec)))
    task = replace(task, model=model, slow=velocity_errors)
    if method not in (choices := (*get_args(Method), *AZIMUTH_METHODS)):
        raise UsageError(f"method {method!r} is not known; choose one of {', '.join(choices)}")
    if not heading_limit > 0.0 or passes < 1:
        raise UsageError(
            f"heading limit {math.degrees(heading_limit):g} deg, {passes} passes; expected a positive angle, one or more"
        )
    if method in AZIMUTH_METHODS:
        tell(f"aligning: {method}")
        return _published(task, method, heading_limit, [n for log in (body, gnss) if log for n in notes(log.notes)])
    bias = float(np.sqrt(task.spec.bias_variance[0]))
    level_rate = EARTH_RATE * math.cos(task.position.lat)
    able = bias < level_rate * math.sin(GYROCOMPASS)
    unknown = position is None and not _has_fixes(gnss)
    if unknown and able:
        tell("latitude")
        task = replace(task, position=find_latitude(lambda lat: _cost_at(task, lat)))
    if method == "auto":
        method = "gyrocompass" if able else "motion"
        why = f"gyro biases of {significant(math.degrees(bias) * 3600)} deg/h " + (
            "let the earth's rate tell heading" if able else "hide the earth's rate: motion has to tell heading"
        )
    else:
        why = "asked for"
    tell("coarse alignment")
    spread = 0.0
    if method == "gyrocompass":
        guess = task.by_the_earth()
        tell("first pass")
        track = task.run(guess, gated=False)
    else:
        guesses = guesses_all_round(task.record, task.position, task.odometer, task.wheel)
        best, track, spread = _best_of_bank(task, guesses, tell)
        guess = guesses[best]
    for number in range(1, passes):
        tell(f"pass {number + 1}")
        guess = replace(guess, C_nb=backtracked(task.record, track))
        track = task.run(guess, gated=True)
    answer = _answer(task, track, method, why, spread)
    more = [item for log in (body, gnss) if log is not None for item in notes(log.notes)]
    more += [_of_latitude(answer, able)] if unknown else []
    more += _seen(task, track, guess, gated=passes > 1)
    return judge_moving(answer, track, heading_limit, more)


def _seen(task: _Task, track: Track, guess: Guess, *, gated: bool) -> list[Evidence]:
    """What the receiver, the log itself and biases that wander say."""
    found = [] if task.gnss is None else gnss_evidence(task.gnss)
    found += moving_evidence(task.record)
    found += jump_evidence(lambda record: replace(task, record=record).run(guess, gated=gated), track, task.record)
    return found + wandering_evidence(
        lambda model: replace(task, model=model).run(guess, gated=gated),
        track,
        task.model,
        task.spec,
        task.record.duration,
    )


def _published(task: _Task, method: str, heading_limit: float, more: list[Evidence]) -> Alignment:
    """By a published filter of an odometer."""
    if not isinstance(task.odometer, OdometerRecord):
        raise UsageError(f"method {method!r} is that of an odometer; expected one, or auto, gyrocompass, motion")
    track = azimuth_track(task.record, task.odometer, task.position, task.spec, task.wheel, method)
    answer = _answer(task, track, method, "asked for; a published filter, to be compared", 0.0)
    return judge_moving(answer, track, heading_limit, more)


def _cost_at(task: _Task, lat: float) -> float:
    """Minus twice the log-likelihood of the log at a latitude."""
    task = replace(task, position=Position(lat, horizontal_sigma=0.0))
    try:
        return misfit(task.run(task.by_the_earth(), gated=False).residuals)
    except DataError:  # so far off that the filter breaks down
        return math.inf


def _of_latitude(answer: Alignment, able: bool) -> Evidence:
    """What stands for a latitude that nobody gave."""
    lat = answer.position.lat
    if able and answer.moving is not None:
        sigma = float(answer.moving.track.sigma[-1, DP][1]) / METRES_PER_RADIAN
        if sigma < NARROWED * PRIOR:
            return note("latitude.found", lat=lat, sigma=sigma)
    return note("latitude.assumed", lat=lat)


def _in_body_axes(
    odometer: OdometerRecord | None, velocity: VelocityRecord | None
) -> OdometerRecord | VelocityRecord | None:
    """The one sensor that shows velocity in body axes."""
    if odometer is not None and velocity is not None:
        raise UsageError("an odometer and a velocity log; expected one of them, and the other as a further source")
    if velocity is not None and velocity.frame != "body":
        raise UsageError(
            f"{velocity.source}: velocities east, north, up; alignment on the move takes those of a GNSS log, with positions, or "
            "velocities in body axes (v_right, v_forward, v_up)"
        )
    return odometer or velocity


def _task(
    record: ImuRecord,
    imu: Any,
    odometer: OdometerRecord | VelocityRecord | None,
    gnss: GnssRecord | None,
    position: Position | None,
    wheel: Mounting | None,
    antenna: Mounting | None,
    more: Sequence[Aiding],
    zupt: bool,
    calibration: Calibration | None,
    offset: float,
) -> _Task:
    if odometer is None and gnss is None:
        raise UsageError(
            "alignment on the move without an odometer, a velocity log and GNSS; expected odometer= or velocity=, gnss= or both"
        )
    if imu is None:
        raise UsageError("alignment on the move needs the IMU's specification: imu='navigation', a file or an ImuSpec")
    if calibration is not None:
        record = calibration.apply(record)
    record, _, gaps = bridge_gaps(record)
    if record.duration < SHORTEST:
        raise AlignmentError(f"{record.source}: {record.duration:g} s; at least {SHORTEST:g} s are needed on the move")
    odometer = None if odometer is None else odometer.shifted(offset)
    gnss = None if gnss is None else _with_floors(gnss.shifted(offset))
    if position is None:
        position = first_fix(record, gnss) if _has_fixes(gnss) else Position(SOMEWHERE)
    elif gnss is not None:
        check_fixes(gnss, position, float(record.time[0]))
    spec = imu_spec(imu).seen_in(record)
    stops: list[Aiding] = list(gaps)
    if zupt:
        still, disturbed = seconds_at_rest(record, odometer, gnss)
        stops += updates_at(record, still, disturbed, INTERVAL)
    return _Task(
        record,
        spec,
        InsModel.from_spec(spec),
        position,
        odometer,
        gnss,
        WHEEL if wheel is None else wheel,
        usual_antenna(gnss) if antenna is None else antenna,
        stops,
        more,
    )


def _with_floors(gnss: GnssRecord) -> GnssRecord:
    """A receiver's own sigma leaves out clocks, and what moves between its antenna and the IMU."""

    def floored(sigma: Array | None, floor: float) -> Array | None:
        return None if sigma is None else np.where(np.isfinite(sigma), np.hypot(sigma, floor), sigma)

    return replace(
        gnss,
        position_sigma=floored(gnss.position_sigma, POSITION_FLOOR),
        velocity_sigma=floored(gnss.velocity_sigma, VELOCITY_FLOOR),
    )


def usual_antenna(gnss: GnssRecord | None) -> Mounting:
    """Of an antenna of which nothing is said: late by an unknown time, its fixes off together for minutes.

    By how much: what the receiver says of a fix; it is right about the size, and silent about how its errors are correlated.
    """
    told = None if gnss is None or gnss.position_sigma is None else gnss.position_sigma[:, :2]
    told = None if told is None else told[np.isfinite(told)]
    bias = RECEIVER_BIAS if told is None or not told.size else float(np.median(told))
    return Mounting(latency_sigma=LATENCY_SIGMA, bias_sigma=bias, bias_time=RECEIVER_TIME, angle_sigma=BASELINE)


def _has_fixes(gnss: GnssRecord | None) -> TypeGuard[GnssRecord]:
    return gnss is not None and bool(gnss.has_position.any())


def first_fix(record: ImuRecord, gnss: GnssRecord) -> Position:
    """Where a log begins, by GNSS."""
    fixes = np.flatnonzero(gnss.has_position)
    nearest = fixes[int(np.argmin(np.abs(gnss.time[fixes] - record.time[0])))]
    alt = float(gnss.alt[nearest])
    return Position(float(gnss.lat[nearest]), float(gnss.lon[nearest]), alt if np.isfinite(alt) else 0.0, 10.0, 20.0)


def _best_of_bank(task: _Task, guesses: Sequence[Guess], tell: Callable[[str], None]) -> tuple[int, Track, float]:
    """Which heading explains the measurements best, its track, and the spread of those that explain them as well, rad."""
    until = float(task.record.time[0]) + BANK_TIME
    until = until if until < task.record.time[-1] else None  # type: ignore[assignment]
    costs, tracks = [], []
    for number, guess in enumerate(guesses):
        tell(f"heading {number + 1} of {len(guesses)}")
        track = task.run(guess, gated=False, until=until)
        tracks.append(track)
        costs.append(misfit(track.residuals))
    cost = np.array(costs)
    weight = np.exp(-0.5 * (cost - cost.min()))
    weight /= weight.sum()
    best = int(np.argmin(cost))
    off = [_turn_between(track.C_nb[-1], tracks[best].C_nb[-1]) for track in tracks]
    return best, tracks[best], float(np.sqrt(np.sum(weight * np.square(off))))


def _turn_between(C: Array, D: Array) -> float:
    """About the vertical, rad."""
    R = C @ D.T
    return float(math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))


def _answer(task: _Task, track: Track, method: str, why: str, spread: float) -> Alignment:
    place = track.position[-1]
    sigma = track.sigma[-1]
    position = Position(float(place[0]), float(place[1]), float(place[2]), float(np.max(sigma[6:8])), float(sigma[8]))
    history = _history(track, task)
    covariance = history.phi_covariance[-1].copy()
    covariance[2, 2] = min(covariance[2, 2] + spread**2, UNIFORM_SIGMA**2)
    sensor = "odometer" if isinstance(task.odometer, OdometerRecord) else "velocity log"
    mounting = None if task.odometer is None else (sensor, task.wheel.C_mb, task.wheel.lever_arm)
    speed = np.linalg.norm(track.v_n, axis=1)
    distance = float(np.trapezoid(speed, track.time))
    prior = np.sqrt(task.spec.bias_variance)
    moving = moving_of(track, distance, "motion" if method == "motion" else "the earth's rate", mounting)
    return Alignment(
        status="not_converged",
        evidence=(),
        method=method,
        method_reason=why,
        time=float(track.time[-1]),
        C_nb=track.C_nb[-1],
        phi_covariance=covariance,
        phi_floor=history.phi_floor[-1],
        gyro_bias=track.gyro_bias[-1],
        gyro_bias_sigma=history.gyro_bias_sigma[-1],
        gyro_bias_prior=prior[:3],
        accel_bias=track.accel_bias[-1],
        accel_bias_sigma=history.accel_bias_sigma[-1],
        accel_bias_prior=prior[3:],
        position=position,
        imu=task.spec,
        imu_source=f"specification {task.spec.name!r}",
        duration=task.record.duration,
        disturbance=np.full(3, np.nan),
        history=history,
        source=task.record.source,
        moving=moving,
    )


def _history(track: Track, task: _Task) -> History:
    P = fifteen(track)
    sigma = np.sqrt(np.maximum(np.einsum("kii->ki", P), 0.0))
    g = float(normal_gravity(task.position.lat, task.position.alt))
    deflection = deflection_covariance(task.position.lat, g)
    count = len(track.time)
    aided = max((r for r in track.residuals if len(r.time)), key=lambda r: len(r.time), default=None)
    innovation, expected, nis = np.full((count, 3), np.nan), np.full((count, 3), np.nan), np.full(count, np.nan)
    if aided is not None:
        last = np.searchsorted(aided.time, track.time, "right") - 1
        known = last >= 0
        innovation[known], expected[known] = aided.innovation[last[known]], aided.sigma[last[known]]
        nis[known] = aided.nis[last[known]]
    return History(
        time=track.time,
        C_nb=track.C_nb,
        phi_covariance=P[:, PHI, PHI] + deflection,
        phi_floor=np.broadcast_to(deflection, (count, 3, 3)),
        departure=departures(task.record, track),
        gyro_bias=track.gyro_bias,
        gyro_bias_sigma=sigma[:, BG],
        accel_bias=track.accel_bias,
        accel_bias_sigma=sigma[:, BA],
        innovation=innovation,
        innovation_sigma=expected,
        nis=nis,
        innovation_of=aided.name if aided is not None else "nothing",
        innovation_unit=aided.unit if aided is not None else "1",
        innovation_axes=aided.axes if aided is not None else (),
    )
