"""From a log of a base that stays where it is to attitude, biases and a verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.against import against
from truenorth.alignment.answer import answer_of, at_epoch, of_level_alone
from truenorth.alignment.assumptions import FADING, STATIONARY, STAYING, Published, reason, refuse
from truenorth.alignment.bad_stretches import bad_stretches
from truenorth.alignment.bias import true_bias
from truenorth.alignment.bias_step import gravity_evidence, matrix_signatures, turn_evidence
from truenorth.alignment.brief_sway import bent_by_heading, may_swing_on_lines
from truenorth.alignment.by_heave import weighed_by_heave
from truenorth.alignment.check import LogCheck, check_filter, check_means, implied, is_blind, is_lost, sharper
from truenorth.alignment.drift import Drift
from truenorth.alignment.fine import BEND, CoarseStart, FineAlignment, fine_align
from truenorth.alignment.form import pick_form
from truenorth.alignment.from_means import SHORTEST_FILTER, from_means, level_from_means, turned_by
from truenorth.alignment.gyro_matrix import gyro_matrix_evidence
from truenorth.alignment.handover import go_on
from truenorth.alignment.heave import Heave
from truenorth.alignment.inference import INFERRED, allan_noise, infer_spec, specification, usual_noise
from truenorth.alignment.late_gyro import late_gyro_evidence
from truenorth.alignment.late_gyros import late_gyros_evidence
from truenorth.alignment.listing import LISTS, as_listing
from truenorth.alignment.put_right import aligned_anew
from truenorth.alignment.rate_step import rate_step_evidence
from truenorth.alignment.result import Alignment
from truenorth.alignment.rivals import rival_evidence
from truenorth.alignment.scale_on_sway import scale_on_sway_evidence
from truenorth.alignment.setting_off import away_notes, end_evidence
from truenorth.alignment.signatures import level_step_evidence, what_begins
from truenorth.alignment.sway_inference import sway_inferred
from truenorth.alignment.swaying import SwayAlignment, farthest, sway_align
from truenorth.alignment.swung_bias import swung_biases
from truenorth.alignment.task import Task, bridged, last_part, make_task, noise_in
from truenorth.alignment.turning import (
    coloured_level,
    infer_turning,
    rocks_all_along,
    strays,
    turning_align,
    turning_noise,
    turns_blindly,
    was_blind,
    with_usual,
)
from truenorth.alignment.verdict import base_evidence, judged, leaves, no_attitude
from truenorth.coarse import coarse_covariance, dual_vector, oba
from truenorth.coarse.uncertainty import own_motion
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.errors.staying import BG, StaticModel, gained_velocity
from truenorth.estimate.cells import cell_of, in_few_cells
from truenorth.quality.density import specification_evidence
from truenorth.quality.record_evidence import record_evidence, staying_evidence
from truenorth.quality.regimes import MotionSummary
from truenorth.records import ImuRecord
from truenorth.records.calibration import Calibration
from truenorth.records.specified import corrected
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import integrate

Array = NDArray[np.float64]
Method = Literal["auto", "analytic", "inertial", "oba", "kalman", "swaying", Published]
METHODS = get_args(Method)

HEADING_LIMIT = math.radians(5.0)
SHORTEST = 1.0  # s: below that no mean is worth its name
NO_NORTH = "the gyros do not see the earth turn: the mean force levels, nothing finds north"
NO_FORCE = 1e-6  # m/s^2, mean specific force that shows no vertical: accelerometers that are dead
SIMPLER = ("analytic", "inertial", "oba", *FADING, *STATIONARY)  # than the filters of this library
STILL = ("analytic", *STATIONARY)  # take the base for one that does not turn: one that lists contradicts them
GOES = 10.0  # m: of the way from where a base was in the mean, that still passes for sway
STAYS = 0.5  # m/s: of a base's own level velocity, one sigma, that still passes for sway
RECENT = 60.0  # s: whose own motion of the base is that of the epoch
SHORTEST_SWAYING = 60.0  # s: below that the sway's periods cannot be found
POSITIONS = " (where a turntable does it, the aid `Positions()` shows more)"
TURNS_BLINDLY = (
    "the IMU turns, and its gyros do not see the earth turn: scale factors, misalignments and the arm from the axis are fitted, "
    f"nothing finds north{POSITIONS}"
)
TURNED = math.radians(30.0)  # less in a short log may be part of a sway


def align_base(
    record: ImuRecord,
    position: Position,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    method: Method = "auto",
    *,
    at: float | None = None,
    calibration: Calibration | None = None,
    heading_limit: float = HEADING_LIMIT,
    progress: Callable[[str], None] | None = None,
    sound: bool = False,
    goes_on: bool = True,
    causes: bool = True,
) -> Alignment:
    """Find pitch, roll and true heading of an IMU on a base that stays where it is: still, shaken or swaying.

    Parameters
    ----------
    record : ImuRecord
        Body axes RFU; heading is that of the y axis, clockwise from true north.
    position : Position
    imu : ImuSpec, str, path or mapping, optional
        Specification, a preset's name, or a YAML file. Without one the scale of the errors is inferred from the log.
    method : {"auto", "analytic", "inertial", "oba", "kalman", "swaying", ...}
        ``analytic``: TRIAD on mean rate and specific force (still base only). ``inertial``: dual vector in the
        inertial frame. ``oba``: optimisation-based alignment. ``kalman``: coarse (oba), then a Kalman filter on
        velocity, re-linearised. ``swaying``: the same with the base's motion and the IMU's lever arm as states.
        ``auto`` looks at the motion, picks, and says why. Published filters, to be compared (:mod:`truenorth.alignment.published`):
        ``kf``, ``sakf``, ``makf``, ``imakf``; ``states10``, ``states8``.
    at, calibration, heading_limit, progress
        As of :func:`truenorth.align`.
    sound : bool
        Whether the log is known to be without faults of clock, logging, range and the gyros' units and axes, and its noise to be
        one all along, as a simulated one is: then it is not looked at for them.
    goes_on : bool
        Whether rows that follow, or navigation, may go on from the answer: what only they need is made then.
    causes : bool
        Whether gyros that are turned or scaled are searched for where the log does not fit, which may take ten seconds.

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
    if method not in METHODS:
        refuse(method, METHODS)
    if not heading_limit > 0.0:
        raise UsageError(f"heading limit {np.degrees(heading_limit):g} deg; expected a positive angle")
    spec = None if imu is None else noise_in(record, imu_spec(imu)).with_coning_of(record)
    as_written, right = record, corrected(record, spec, calibration)
    record = bridged(right)
    written = record if right is as_written else bridged(as_written)  # counts, and rows that repeat, are as written
    if record.duration < SHORTEST or len(record) < 10:
        raise AlignmentError(
            f"{record.source}: {len(record)} samples over {record.duration:g} s; at least 10 samples and {SHORTEST:g} s "
            "are needed to level, and minutes to find north: record longer"
        )

    tell("looking at the motion")
    task = make_task(record, position, at)
    if np.linalg.norm(task.means.f_b) < NO_FORCE:
        raise no_attitude(record.source)
    seen, task = task, task if method in STILL else as_listing(task, spec)
    chosen, why = _choose(method, task)
    why = LISTS if method == "auto" and task is not seen else why
    tell(f"aligning: {chosen}")
    means = check_means(task.means, position.lat, task.gravity)
    if is_blind(task.motion, means) or is_lost(task, means, spec, heading_limit):
        asked = "" if method == "auto" else f"{method} was asked for, but "
        chosen, why, found = "analytic", f"{asked}{NO_NORTH}", _Found(*level_from_means(task, spec))
    elif method == "auto" and chosen != "analytic" and turns_blindly(task, spec):
        chosen, why, found = "kalman", TURNS_BLINDLY, _align_turning(task, spec)
    elif chosen == "analytic":
        found = _Found(*from_means(task, spec))
    else:
        found = _align_inertial(task, spec, chosen, means, sound, goes_on, causes)
        if method == "auto" and spec is None and is_lost(task, means, found.answer.imu, heading_limit, inferred=True):
            chosen, why, found = "analytic", NO_NORTH, _Found(*level_from_means(task, spec))
        elif method == "auto" and spec is None and was_blind(task, found.answer.imu):
            chosen, why, found = "kalman", TURNS_BLINDLY, _align_turning(task, spec)
    why = reason(method, found.acted) if chosen in STAYING else f"{why}; {found.form}" if found.form else why
    answer = replace(found.answer, method=chosen, method_reason=why)
    moves = None if math.isfinite(found.way) and _explained(task.motion, found) else task.motion.moves_at
    evidence = record_evidence(written, task.motion, sound=sound, imu=answer.imu) + leaves(moves)
    evidence += [*base_evidence(answer, found.check, found.drift, settled=found.settled), *found.steps]
    evidence += turn_evidence(task) + gravity_evidence(task, answer.C_nb, answer.imu)
    evidence += rate_step_evidence(task, answer.C_nb, answer.imu)
    evidence += [] if sound else staying_evidence(written, position.lat, spec)
    if method in SIMPLER and task.motion.fraction("rotating") > 0.0:  # they know no scale factors and no misalignments
        known: dict[str, Any] = {"calibration": calibration, "heading_limit": heading_limit, "sound": sound}
        own = align_base(as_written, position, imu, at=at, progress=progress, **known)
        evidence += against(own, answer)
    evidence = weighed_by_heave(found.heave, evidence, task.record)
    evidence += [] if spec is None else specification_evidence(task.record, task.motion, spec, position.lat)
    answer = judged(answer, evidence, heading_limit)
    return answer if found.moved is None else replace(answer, disturbance=np.maximum(answer.disturbance, found.moved))


@dataclass(frozen=True)
class _Found:
    """An answer, and what the verdict needs to know of how it was found."""

    answer: Alignment
    check: LogCheck
    settled: bool = True
    drift: Drift | None = None
    form: str = ""
    steps: Sequence[Evidence] = ()
    way: float = math.inf  # m, that a base whose arm was fitted is from its mean place at most
    heave: Heave | None = None  # of a swaying base
    moved: Array | None = None  # (3,) m/s RMS: of an IMU whose motion a fit has explained, and which goes on
    acted: float | None = None  # share of the epochs in which factors of a published filter acted


def _choose(method: Method, task: Task) -> tuple[str, str]:
    if method != "auto":
        return method, "asked for"
    turns = task.motion.fraction("rotating") > 0.0 and turned_by(task) > TURNED  # so far that the biases show
    if task.record.duration < SHORTEST_FILTER and not turns:
        return "analytic", (
            f"the log is {task.record.duration:.1f} s long, too short for a filter ({SHORTEST_FILTER:g} s): mean values only"
        )
    overall = task.motion.overall
    if overall == "still":
        return (
            "kalman",
            "the base is still: the filter weighs sensor noise and bias as it should, from the first second on",
        )
    words = {
        "disturbed": "the base is disturbed: mean rates would be off, the inertial frame is not",
        "swaying": "the base sways: mean rates mean nothing, the inertial frame follows every motion",
    }
    why = words.get(overall, f"the base is {overall}: only the inertial frame follows it")
    if overall == "rotating":
        why += POSITIONS
    # A table does not rock.
    if task.record.duration < SHORTEST_SWAYING or not (overall in words or rocks_all_along(task.motion)):
        return "kalman", why
    return "swaying", f"{why}; its own motion is fitted to the log"


def _align_turning(task: Task, spec: ImuSpec | None) -> _Found:
    """Level of an IMU that turns, with gyros that do not see the earth; heading zero at the start by convention."""
    task = last_part(task)
    used, where = (infer_turning(task), INFERRED) if spec is None else (spec, f"specification {spec.name!r}")
    fine = turning_align(task, used, np.array([task.epoch.row]))
    answer = answer_of(task, fine, used, where, np.diag(used.bias_variance))
    apart = (fine.scatter + coloured_level(fine, used, task.gravity)) * np.eye(3)
    answer = replace(of_level_alone(answer, apart), pays_until=None, handover=None)
    unchecked = LogCheck(np.zeros(2), np.full(2, math.inf), 0.0, math.inf)
    way = strays(fine, task.position, used.gyro_random_walk)
    steps = level_step_evidence(fine, used) + end_evidence(fine) + away_notes(fine.away)
    return _Found(answer, unchecked, fine.settled, steps=steps, way=way, moved=_moves_on(task, fine))


def _moves_on(task: Task, fine: FineAlignment) -> Array:
    """(3,) RMS velocity of the IMU in the last seconds, m/s: what a fitted arm has explained goes on after the log.

    What is faster than any base is tilt.
    """
    moved = own_motion(fine.integrals, fine.C_n0_i, task.position.lat, task.position.alt, RECENT)
    return np.minimum(moved, limit("fastest base"))


def _align_inertial(
    task: Task, spec: ImuSpec | None, method: str, means: LogCheck, sound: bool, goes_on: bool, causes: bool
) -> _Found:
    lat, alt, rows = task.position.lat, task.position.alt, np.array([task.epoch.row])
    integrals = integrate(task.record, task.interval, rows_at=rows)
    refined = method in ("kalman", "swaying", *FADING, *STATIONARY)
    if method == "inertial":
        coarse = dual_vector(integrals, lat, alt)
    else:
        coarse = oba(integrals, lat, alt, history=False, gains=not refined)
    usual = usual_noise()
    # A rough sea shows as moving, a ship whose engine runs as disturbed: their motion, too, is slower than the noise of sensors.
    smooth = task.motion.overall in ("swaying", "moving") or rocks_all_along(task.motion)
    # Velocities hardly show the noise of sensors in less than a minute: it is taken as their rows show it, and not fitted.
    quiet = task.motion.overall == "still"
    brief = spec is None and (quiet or smooth) and task.record.duration < SHORTEST_SWAYING
    if brief or (spec is None and smooth):
        walks = turning_noise(task.record) if smooth else allan_noise(task.record)
        usual = replace(usual, gyro_random_walk=walks.gyro_random_walk, accel_random_walk=walks.accel_random_walk)
    known = StaticModel.of(spec) if spec is not None else usual if brief else None
    turns = task.motion.fraction("rotating") > 0.0
    shares = method == "kalman" and quiet and not turns and spec is not None and in_few_cells(spec, lat)
    cell = cell_of(coarse.C_n0_i, integrals, lat) if shares else None
    filtered, noise = check_filter(task, integrals, coarse.C_n0_i, usual, known, cell)
    check = sharper(filtered, means, task)
    used, where = specification(spec, check, lambda: turning_noise(task.record) if turns else noise)
    P = task.bias_prior(used, coarse.C_n0_i.T if cell is None else cell.T)
    if method in STATIONARY:
        return _Found(_stationary(task, used, where, coarse.C_n0_i, P, method), check)
    if not refined:
        disturbance = own_motion(integrals, coarse.C_n0_i, lat, alt)
        covariance, floor = coarse_covariance(coarse, integrals, StaticModel.of(used), P, disturbance)
        C_n0_b = coarse.C_n0_i @ task.epoch.attitude(integrals.C_ib_at[0])
        answer = at_epoch(task, used, where, C_n0_b, covariance, floor)
        return _Found(replace(answer, disturbance=disturbance), check)

    sways, turned = method == "swaying", None
    if turns and method not in FADING:
        turned = used = with_usual(used) if spec is None else used
        P = np.diag(used.bias_variance)
    # A table that turns an IMU does not rock with it: its log is fitted as it is, and its IMU sits near the axis.
    swings = task.motion.overall != "still" and (turned is None or rocks_all_along(task.motion))
    model, shared = StaticModel.of(used), cell is not None
    start = CoarseStart(task.record, coarse.C_n0_i, task.position, model, P, task.interval, rows, shares=shared)
    if method in FADING:
        from truenorth.alignment.published import factor_share, faded_align

        fine = faded_align(start, method)
        return _Found(answer_of(task, fine, used, where, P), check, fine.settled, acted=factor_share(fine))
    picked, form = pick_form(gained_velocity(integrals, coarse.C_n0_i, lat, alt), task.motion)
    if sways and spec is None and turned is None:

        def start_of(walks: StaticModel) -> CoarseStart:
            inferred = infer_spec(check, walks)
            P_bias = task.bias_prior(inferred, start.C_n0_i.T)
            return start._replace(model=StaticModel.of(inferred), P_bias=P_bias)

        fine, noise = sway_inferred(start_of, noise, usual)
        start = start_of(noise)
        used, P = infer_spec(check, noise), start.P_bias
    elif sways:
        fine = sway_align(start, turned=turned, axes=spec)
    elif turned is not None:
        fine = fine_align(start, turned=turned, sways=swings)
    else:
        fine = fine_align(start, integrals, picked, sways=swings)
    del integrals, filtered, coarse  # of the first pass; what follows takes memory
    short = swings and not sways and task.record.duration <= BEND
    bent = bent_by_heading(fine, lat) if short else None
    answer = answer_of(task, fine, used, where, P, sways=sways, bent=bent, goes_on=goes_on)
    answer = replace(answer, ongoing=go_on(task, fine, start.model)) if goes_on else answer
    if turned is not None:  # the check knows no scale factors
        check = replace(check, rate_residual=np.zeros(2), rate_noise=np.full(2, math.inf))
    if spec is not None or turned is not None:
        C = answer.C_nb
        check = implied(check, C @ answer.gyro_bias, C @ fine.P[BG, BG] @ C.T, C @ P[:3, :3] @ C.T)
    if short:
        check = may_swing_on_lines(check, task.position)
    swung = sways or swings
    likely = used if spec is not None else with_usual(used)
    others = matrix_signatures(fine, likely) if swung else None
    if swung and not sways and fine.form == "velocity":
        biased = swung_biases(fine, np.sqrt(used.bias_variance[3:]), task.position)
        others = biased if others is None else np.concatenate([others, biased], axis=2)
    drift, steps, hemisphere = what_begins(fine, used, task.position, others, given=spec is not None, sways=swung)
    steps += ([] if sound else bad_stretches(fine, task.record)) + hemisphere + rival_evidence(fine, task.position)
    steps += end_evidence(fine) if turned is not None and not swung else []
    heave = fine.heave if isinstance(fine, SwayAlignment) else None
    if isinstance(fine, SwayAlignment):
        steps += late_gyros_evidence(fine, fine.late, task.record)
        anew = aligned_anew(fine, start, turned=turned, axes=spec)
        steps += late_gyro_evidence(fine, task.record, anew) + scale_on_sway_evidence(fine, task.record, anew)
        steps += gyro_matrix_evidence(fine, task.record, likely, anew, steps) if causes else []
    way = farthest(fine, task.position) if swung else math.inf
    moved = _moves_on(task, fine) if swung else None
    return _Found(answer, check, fine.settled, drift, "" if sways else form, steps, way, heave, moved)


def _stationary(task: Task, used: ImuSpec, where: str, C_n0_i: Array, P: Array, method: str) -> Alignment:
    """The answer of a published filter of ten or eight states."""
    from truenorth.alignment.published import stationary_align

    found = stationary_align(task, C_n0_i, StaticModel.of(used), P, method)
    answer = at_epoch(task, used, where, found.C_n0_b, found.covariance, found.floor)
    known = ~np.isnan(found.bias[3:])
    accel_bias, accel_sigma = true_bias(
        found.bias[3:], found.bias_sigma[3:] ** 2, P.diagonal()[3:], answer.imu.bias_variance[3:]
    )
    return replace(
        answer,
        gyro_bias=found.bias[:3],
        gyro_bias_sigma=found.bias_sigma[:3],
        accel_bias=np.where(known, accel_bias, answer.accel_bias),
        accel_bias_sigma=np.where(known, accel_sigma, answer.accel_bias_sigma),
    )


def _explained(motion: MotionSummary, found: _Found) -> bool:
    """Whether a lever arm and bounded motion explain all that the base does: what moves by its arm goes nowhere.

    A high sea moves a ship by more than a metre a second, and takes it nowhere either. A drift that innovations show has an effect
    of known size, which the judge weighs: of a ship on her lines, whose slow heel looks like one, it is a part of sigma.
    """
    small = float(np.max(found.answer.disturbance[:2])) < STAYS or found.way < GOES
    return rocks_all_along(motion) and found.settled and small
