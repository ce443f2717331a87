"""`align_in_motion`: attitude of a vehicle that moves from the first second on, from an odometer, GNSS, or both."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.alignment.against import against
from truenorth.alignment.assumptions import reason, refuse
from truenorth.alignment.azimuth import AZIMUTH_METHODS, azimuth_track
from truenorth.alignment.in_motion_answer import moving_answer
from truenorth.alignment.in_motion_axes import half_turn_evidence
from truenorth.alignment.in_motion_clocks import clock_evidence, on_another_clock
from truenorth.alignment.in_motion_constants import as_specified
from truenorth.alignment.in_motion_hidden import HIDDEN, hidden_from, of_level
from truenorth.alignment.in_motion_latitude import NARROWED, PRIOR, find_latitude
from truenorth.alignment.in_motion_learnt import learnt_evidence
from truenorth.alignment.in_motion_moments import of_the_shake, two_moments, with_smoothed_motion, with_swing_apart
from truenorth.alignment.in_motion_open import open_track
from truenorth.alignment.in_motion_passes import MORE_PASSES, Pass, begun, once_more
from truenorth.alignment.in_motion_spread import Spread
from truenorth.alignment.in_motion_start import COARSE_HEADING, Guess, guesses_all_round
from truenorth.alignment.in_motion_task import NO_LOG_ERRORS, MovingTask, has_fixes, in_body_axes, moving_task
from truenorth.alignment.in_motion_verdict import judge_moving
from truenorth.alignment.led_at_rest import led_at_rest_evidence
from truenorth.alignment.rest_rate import rest_evidence
from truenorth.alignment.rest_shift import shift_evidence
from truenorth.alignment.result import Alignment
from truenorth.alignment.suspect import name_specification
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import METRES_PER_RADIAN, Position
from truenorth.core.units import significant
from truenorth.errors.group import Group
from truenorth.errors.log import LogErrors
from truenorth.errors.model import InsModel
from truenorth.estimate.latency import rate_evidence
from truenorth.estimate.led_by import led_by_evidence
from truenorth.estimate.noisier import as_noisy_as_its_rows
from truenorth.estimate.poorer import ALONE, BIASES, poorer_evidence, poorer_rivals, poorer_tracks
from truenorth.estimate.rivals import Rival, jump_evidence, misfit, noise_evidence, wandering_evidence
from truenorth.estimate.spiked import spike_evidence
from truenorth.estimate.stepping import stepping_rivals
from truenorth.estimate.warming import warming_rivals
from truenorth.quality.aid_noise import LOUD, noise_factors
from truenorth.quality.gnss import gnss_evidence
from truenorth.quality.record_evidence import moving_evidence
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.calibration import Calibration
from truenorth.records.specs import ImuSpec
from truenorth.records.stale import without_stale
from truenorth.state.evidence import Evidence, note, notes
from truenorth.state.layout import DP, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]
Method = Literal["auto", "gyrocompass", "motion"]

HEADING_LIMIT = math.radians(5.0)
GYROCOMPASS = math.radians(20.0)  # of heading by bias, up to which the gyros are asked for north first
BANK_TIME = 300.0  # s of log by which the headings of the bank compete
# Passes over the log, and more where what was learnt of the sensors still changes, or heading by more than a part of its sigma.
PASSES = 2
# One sigma of heading up to which axes of the gyros may be constants for the filter, a quarter of the bank's step: with no noise in
# turns the products of a larger error with tilts, biases and axes pass for knowledge, and level was up to seven sigmas off.
SURE = math.radians(7.5)
SURELY = 3.0  # sigmas of heading, within which guesses of the bank are those of one track
# One sigma of heading from which on a closed loop is too sure of what the earth's rate shows: with each correction the axes of
# the gyros turn against north, and biases seem to come apart from it. Where a bias leaves 7.4 deg it was sure of 2.9, 40 off.
UNSURE = math.radians(2.0)
# Once it has settled: with slow errors that the aids' innovations show; one sensor's may hide another's
SLOW_PASSES = 2


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
    body, gnss = in_body_axes(odometer, velocity), None if gnss is None else without_stale(gnss)
    task = moving_task(record, imu, body, gnss, position, wheel, antenna, sources, zupt, calibration, offset)
    task = replace(task, slow=velocity_errors, errors=errors).with_spec(task.spec)
    if method not in (choices := (*get_args(Method), *AZIMUTH_METHODS)):
        refuse(method, choices)
    if not heading_limit > 0.0 or passes < 1:
        raise UsageError(
            f"heading limit {math.degrees(heading_limit):g} deg, {passes} passes; expected a positive angle, one or more"
        )
    unknown = position is None and not has_fixes(gnss)
    if method in AZIMUTH_METHODS:
        tell(f"aligning: {method}")
        return _published(task, method, heading_limit, unknown, tell)

    def aligned(spec: ImuSpec) -> Alignment:
        return _aligned(task.with_spec(spec), method, heading_limit, passes, unknown, tell)

    answer = _aligned(task, method, heading_limit, passes, unknown, tell)
    answer = as_noisy_as_its_rows(answer, task.record, task.spec, aligned)
    return name_specification(answer, aligned)


def _aligned(
    task: MovingTask, method: str, heading_limit: float, passes: int, unknown: bool, tell: Callable[[str], None]
) -> Alignment:
    """Coarse alignment or a bank, passes over the log, verdict; `unknown`: nobody gave the latitude."""
    bias, able = _north_by_gyros(task)
    if unknown and able:
        tell("latitude")
        task = replace(task, position=find_latitude(lambda lat: _cost_at(task, lat)))
    if method == "auto":
        method = "gyrocompass" if able else "motion"
        why = f"gyro errors of {significant(math.degrees(bias) * 3600)} deg/h " + (
            "let the earth's rate tell heading" if able else "hide the earth's rate: motion has to tell heading"
        )
    else:
        why = "asked for"
    found, spread = _begun(task, method, tell)
    louder = noise_factors(found.track, task.aiding(gated=False), task.factors, tails=True)
    if any(float(factor.max()) > LOUD for factor in louder.values()):  # what it found was made of noise
        task = replace(task, factors=louder)
        found, spread = _begun(task, method, tell)
    task, found, one_of_several = of_the_shake(task, found)
    task, found, unsure = on_another_clock(task, found)
    first, bank, number, much = found.guess, spread, 1, False
    while number < passes or ((much or not found.settled) and passes > 1 and number < passes + MORE_PASSES):
        task, much = task.learnt(found.track)
        if number < passes or much or not found.settled:
            tell(f"pass {number + 1}")
            found = once_more(task, found, first)
        number += 1
    if passes > 1:
        task, found = with_swing_apart(*two_moments(task, found, first), first)
    for _ in range(SLOW_PASSES if passes > 1 else 0):
        slower = task.with_slow_errors(found.track)
        if slower is task:
            break
        tell(f"pass {(number := number + 1)}")
        task = slower
        found = once_more(task, found, first)
    if passes > 1 and spread.and_more(found.sigma, found.used_twice, found.unsettled).heading < SURE:
        tell(f"pass {(number := number + 1)}")
        task, found = as_specified(task, found, first)
    if passes > 1:
        task, found = with_smoothed_motion(task, found, first, tell)
    if number > 1:
        spread = spread.and_more(found.used_twice, found.unsettled)
    guess, track, last = found.guess, found.track, None
    closed = spread.and_more(found.sigma).heading
    roughly = method == "gyrocompass" and closed > UNSURE
    if passes > 1 and (roughly or (method == "motion" and has_fixes(task.gnss))):
        tell(f"pass {number + 1}")
        last = open_track(task, first, track)
    if roughly and last is not None and last.sigma[-1, PHI][2] < closed:  # one that feeds nothing back knows no more
        last = None
    if last is not None:
        spread = bank.beyond(SURELY * float(last.sigma[-1, PHI][2]))
    elif method == "motion" and (hidden_from(task) or spread.and_more(found.sigma).heading > HIDDEN):
        tell(f"pass {number + 1}")
        task, guess, track, spread = of_level(task, found, first, spread)
    answer = moving_answer(task, task.with_lasting_fixes(last or track), method, why, spread, track)
    more = [item for log in (task.odometer, task.gnss) if log is not None for item in notes(log.notes)]
    more += [_of_latitude(answer, able)] if unknown else []
    more += [note("aids.late", waited=task.waited)] if task.waited else []
    if (of := answer.moving) is not None:
        more += learnt_evidence(task.factors, of.delays, task.scatter, task.swings)
        more += rate_evidence(of.clocks, of.track, task.record)
    more += [*task.wanders, *one_of_several, *unsure]
    more += _seen(task, track, guess, first, gated=passes > 1, gyrocompassed=method == "gyrocompass")
    return judge_moving(answer, last or track, heading_limit, more)


def _begun(task: MovingTask, method: str, tell: Callable[[str], None]) -> tuple[Pass, Spread]:
    """The first pass, and how far guesses lie apart that explain the log as well."""
    tell("coarse alignment")
    if method == "gyrocompass":
        guess = task.by_the_earth()
        # Where the earth's rate is lost in the noise of the aids at first, all headings compete.
        if guess.heading_sigma <= COARSE_HEADING:
            tell("first pass")
            return begun(task, guess, task.run(guess, gated=False)), Spread()
    guesses = guesses_all_round(task.record, task.odometer, task.gnss, task.wheel, task.antenna)
    best, track, spread = _best_of_bank(task, guesses, tell)
    return begun(task, guesses[best], track), spread


def _seen(
    task: MovingTask, track: Track, guess: Guess, first: Guess, *, gated: bool, gyrocompassed: bool
) -> list[Evidence]:
    """What the receiver, the log itself, the earth's rate at rest and biases that wander say."""
    found = [] if task.gnss is None else gnss_evidence(task.gnss)
    found += moving_evidence(task.record)
    found += shift_evidence(task.record, task.spec, track, task.odometer, task.gnss)
    if gyrocompassed:
        found += [*rest_evidence(task, track), *led_at_rest_evidence(task, track)]
        found += half_turn_evidence(task, track, gated=gated)

    other = partial(_of_record, task, guess, gated)
    found += jump_evidence(other, track, task.record)
    if task.gnss is not None:
        led = [partial(_of_receiver, less, guess, gated) for less in (task, *task.without_slow_errors())]
        found += led_by_evidence(led[0], track, task.gnss, led[1:])
    found += clock_evidence(task, track, guess, first, gated=gated)

    again = partial(_of_model, task, guess, gated)
    without = [partial(_of_model, less, guess, gated) for less in task.without_slow_errors()]
    found += noise_evidence(again, track, task.model, task.record)
    found += spike_evidence(other, track, task.record)

    def of_another_imu(spec: ImuSpec) -> Track:
        return task.with_spec(spec).run(guess, gated=gated)

    def of_another_course() -> list[Rival]:
        courses = warming_rivals(other, track, task.record, task.spec)
        # By motion heading is not what a gyro's bias makes of it; of logs one in six sound vehicles seemed to have a step.
        if gyrocompassed and isinstance(task.odometer, OdometerRecord) and task.gnss is None:
            less = [partial(_of_record, fewer, guess, gated) for fewer in task.without_slow_errors()]
            courses += stepping_rivals([other, *less], track, task.record, task.spec)
        kinds = ALONE | BIASES if gyrocompassed else ALONE
        return courses + poorer_rivals(track, poorer_tracks(of_another_imu, track, task.spec, kinds))

    found += poorer_evidence(of_another_imu, track, task.spec)
    span = task.record.duration
    return found + wandering_evidence(again, track, task.model, task.spec, span, without, of_another_course)


def _of_model(task: MovingTask, guess: Guess, gated: bool, model: InsModel) -> Track:
    return replace(task, model=model).run(guess, gated=gated)


def _of_record(task: MovingTask, guess: Guess, gated: bool, record: ImuRecord) -> Track:
    return replace(task, record=record).run(guess, gated=gated)


def _of_receiver(task: MovingTask, guess: Guess, gated: bool, log: GnssRecord) -> Track:
    return replace(task, gnss=log).run(guess, gated=gated)


def _published(
    task: MovingTask, method: str, heading_limit: float, unknown: bool, tell: Callable[[str], None]
) -> Alignment:
    """By a published filter of an odometer, held against the closed loop on the same logs."""
    if not isinstance(task.odometer, OdometerRecord):
        raise UsageError(f"method {method!r} is that of an odometer; expected one, or auto, gyrocompass, motion")
    bias, able = _north_by_gyros(task)
    if not able:
        raise AlignmentError(
            f"{task.record.source}: the filter {method} begins near the heading that the earth's rate gives, which gyro errors of "
            f"{significant(math.degrees(bias) * 3600)} deg/h hide: choose auto or motion, or use better gyros"
        )
    track, acted = azimuth_track(task.record, task.odometer, task.position, task.spec, task.wheel, method)
    answer = moving_answer(task, track, method, reason(method, acted), Spread())
    own = _aligned(task, "auto", heading_limit, PASSES, unknown, tell)
    more = [item for log in (task.odometer, task.gnss) if log is not None for item in notes(log.notes)]
    return judge_moving(answer, track, heading_limit, more + against(own, answer))


def _north_by_gyros(task: MovingTask) -> tuple[float, bool]:
    """Bias of a gyro by its specification, with its noise over the log, rad/s; whether the earth's rate tells heading."""
    noise = task.spec.gyro_random_walk / math.sqrt(task.record.duration)
    bias = math.hypot(float(np.sqrt(task.spec.bias_variance[0])), noise)
    return bias, bias < EARTH_RATE * math.cos(task.position.lat) * math.sin(GYROCOMPASS)


def _cost_at(task: MovingTask, lat: float) -> float:
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


def _best_of_bank(task: MovingTask, guesses: Sequence[Guess], tell: Callable[[str], None]) -> tuple[int, Track, Spread]:
    """Which heading explains the measurements best, its track, and the spread of those that explain them as well."""
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
    return best, tracks[best], Spread.of([track.C_nb[-1] for track in tracks], best, weight)
