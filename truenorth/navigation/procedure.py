"""`navigate`: from an alignment onward, free inertial or aided, with a verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid, Barometer, Gnss, Odometer, VelocityLog
from truenorth.aiding.fixes import Fixes
from truenorth.alignment.rest_shift import shift_evidence
from truenorth.core.errors import UsageError
from truenorth.errors.axes import axis_sigma
from truenorth.errors.deflection import Deflection
from truenorth.errors.group import Group, groups_of
from truenorth.errors.model import InsModel
from truenorth.estimate.gaps import bridge_gaps
from truenorth.estimate.height_drift import height_evidence
from truenorth.estimate.height_step import height_step_evidence
from truenorth.estimate.latency import counted_whole
from truenorth.estimate.led_by import led_by_evidence
from truenorth.estimate.noisier import as_noisy_as_its_rows
from truenorth.estimate.own_clock import on_its_clock
from truenorth.estimate.poorer import growth_along, poorer_rivals, poorer_tracks
from truenorth.estimate.rivals import Rival, counted_once, jump_evidence, noise_evidence, wandering_evidence
from truenorth.estimate.spiked import spike_evidence
from truenorth.estimate.warming import warming_rivals
from truenorth.navigation.arm import filtered_by_possible_arm, looser_track
from truenorth.navigation.by_start import start_evidence
from truenorth.navigation.curve import with_curve
from truenorth.navigation.first_row import from_start
from truenorth.navigation.given import (
    arm_as_begun,
    by_key,
    kept_altitude,
    kind_of_log,
    late_rows,
    logs_of_speed,
    looked_at,
    record_of,
    said_of,
    said_to_sit,
    taken_over,
    with_rows,
)
from truenorth.navigation.gyro_moment import gyros_of_another_moment
from truenorth.navigation.passes import filtered, quick_swing
from truenorth.navigation.plan import Plan
from truenorth.navigation.restarted import about_its_start
from truenorth.navigation.result import Altitude, Navigation, judged_navigation, last_sigma, with_others
from truenorth.navigation.second_look import SENSORS, second_look
from truenorth.navigation.start import acting_at_rest, force_at_rest, of_poorer, start_of
from truenorth.navigation.start_check import check_start, check_start_at_rest
from truenorth.navigation.stops import while_it_stands, zero_updates
from truenorth.navigation.under_way import COARSE
from truenorth.navigation.velocity_axes import check_velocities
from truenorth.navigation.whereabouts import check_overlap, check_places
from truenorth.quality.density import burst_evidence
from truenorth.quality.gnss import gnss_evidence
from truenorth.quality.heights import either_level, level_evidence
from truenorth.quality.held import as_sampled
from truenorth.quality.innovations import innovation_evidence
from truenorth.quality.mounting import mounting_evidence
from truenorth.quality.record_evidence import moving_evidence
from truenorth.quality.rounding import with_rounding
from truenorth.quality.slow_aids import Slow, one_less
from truenorth.quality.wheel_unit import check_unit
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specified import corrected, seen_in
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, note
from truenorth.state.layout import SLOW_ACCEL, SLOW_GYRO
from truenorth.state.state import Start
from truenorth.state.track import Track

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.damping.options import Damper
    from truenorth.records.calibration import Calibration

Array = NDArray[np.float64]

LONG = 3600.0  # s, up to which the filter predicts every FINE seconds, then every COARSE
FINE = 0.2
DAMPED = 8.0  # s: rows of a track that damping goes on from are no farther apart
PLUMB_LINE = Deflection()


def navigate(
    record: ImuRecord,
    start: Alignment | Start | str | PathLike[str],
    *,
    aid: Aid | Sequence[Aid] = (),
    altitude: Altitude | None = None,
    zupt: str | Sequence[tuple[float, float]] | None = None,
    smooth: bool = False,
    imu: ImuSpec | str | None = None,
    scale_factors: bool = False,
    errors: Sequence[Group | str] = (),
    deflection: Deflection = PLUMB_LINE,
    calibration: Calibration | None = None,
    check_clocks: bool = True,
    interval: float | None = None,
    output: float | None = None,
    damping: Damper | None = None,
    progress: Callable[[str], None] | None = None,
) -> Navigation:
    """Carry a log on from an alignment.

    Parameters
    ----------
    record : ImuRecord or DataFrame
        Holds the alignment's epoch, or begins there.
    start : Alignment, Start, or path
        Of the alignment, or the folder it was saved in.
    aid : aid or sequence of aids
        :class:`Gnss`, :class:`Odometer`, :class:`VelocityLog`, :class:`Barometer`, or one of your own. An odometer without a
        mounting has that which an alignment on the move has found.
    altitude : {"fixed", "free", "baro", "gnss"}, optional
        How height is kept; by default what the aids allow, and fixed (at sea) where there is none.
    zupt : "auto" or pairs of seconds, optional
        Stops, with zero velocity (and zero rotation where nothing moves at all).
    smooth : bool
        Estimate each epoch from the whole log.
    imu : ImuSpec or str, optional
        Specification; the alignment's own when left out.
    scale_factors : bool
        Estimate the IMU's scale factors and misalignments even where they seem too small to matter.
    errors : sequence of Group or str
        Further error states of the INS, or names of plug-ins that make them.
    deflection : Deflection
        Of the vertical along the way, a property of the earth; ``Deflection(0.0)``: there is none, as in a simulation.
    calibration : Calibration, optional
        Known errors, taken off first.
    check_clocks : bool
        Look for a clock offset, a wrong lever arm, scale or mounting in a second pass; what is found is a warning.
    interval : float, s, optional
        Of the filter; .2 s, and 1 s for logs beyond an hour.
    output : float, s, optional
        Of the track; 1 s, more for very long logs.
    damping : Damper, optional
        Damp the oscillations of a free INS at sea; a :class:`VelocityLog` is then the reference, and there is no other aid.
    progress : callable, optional
        Called with a word about each stage.

    Raises
    ------
    UsageError
        Contradicting options, or numbers that cannot be.
    DataError
        The log does not hold the alignment's epoch; a gap too long to bridge; an aiding log that does not overlap, or in
        other axes.
    AlignmentError
        The alignment has no usable heading.
    """
    by = partial(
        _by_specification,
        record,
        start,
        altitude=altitude,
        zupt=zupt,
        smooth=smooth,
        scale_factors=scale_factors,
        errors=errors,
        deflection=deflection,
        calibration=calibration,
        check_clocks=check_clocks,
        interval=interval,
        output=output,
        damping=damping,
        progress=progress,
    )

    given, log = by_key(aid), as_sampled(record)

    def navigated(rows: GnssRecord | None) -> Navigation:
        aids = with_rows(given, rows)
        answer = by(imu=imu, aid=aids)
        if damping is not None or answer.status != "inconsistent":
            return answer
        spec = start_of(start, imu)[1]
        spec = seen_in(with_rounding(spec, log, aided=bool(aids)), log)
        return as_noisy_as_its_rows(answer, log, spec, lambda x: by(imu=x, aid=aids))

    return on_its_clock(navigated, log, record_of(given, Gnss))


def _by_specification(
    record: ImuRecord,
    start: Alignment | Start | str | PathLike[str],
    *,
    aid: Aid | Sequence[Aid],
    altitude: Altitude | None,
    zupt: str | Sequence[tuple[float, float]] | None,
    smooth: bool,
    imu: ImuSpec | str | None,
    scale_factors: bool,
    errors: Sequence[Group | str],
    deflection: Deflection,
    calibration: Calibration | None,
    check_clocks: bool,
    interval: float | None,
    output: float | None,
    damping: Damper | None,
    progress: Callable[[str], None] | None,
) -> Navigation:
    """:func:`navigate` by one specification."""
    tell = progress or (lambda stage: None)
    given = by_key(aid)
    begin, spec, imu_source = start_of(start, imu)
    check_start(begin)
    record, begin = from_start(corrected(log := as_sampled(record), spec, calibration), begin)
    check_start_at_rest(begin, record)
    record, gaps, disturbances = bridge_gaps(record)
    noise = seen_in(with_rounding(spec, log, aided=bool(given) and damping is None), record)
    said, late = said_of(given, spec), late_rows(given)
    reference = given.pop(VelocityLog.key, None) if damping is not None else None
    fixes = given.pop(Fixes.key, Fixes()) if damping is not None else Fixes()
    begin = arm_as_begun(begin, getattr(given.get(Gnss.key), "mounting", None))
    seated = [SENSORS[key][0] for key in said_to_sit(given, begin) if key in SENSORS]
    taken = taken_over(given, begin) + kind_of_log(given)
    height, why = kept_altitude(altitude, given)
    modelled = partial(_model, begin, (*errors, *deflection.groups), scale_factors, height)
    times = _intervals(record, interval, output, damping is not None)
    plan = Plan(record, begin, modelled(noise), height, disturbances, *times, axis_sigma(noise)[0].max())
    check_overlap(record, aiding := plan.sources(given))
    check_places(given, begin, height)
    if zupt is not None:
        tell("looking for stops")
        stops = zero_updates(record, zupt, *(logs := logs_of_speed(given)))
        if stops and isinstance(zupt, str) and logs == (None, None, None):
            stops = while_it_stands(stops, plan.run([]))
        plan = replace(plan, always=[*stops, *disturbances])
    check_velocities(plan.record, plan.start, plan.model, given.values(), FINE)
    if isinstance(wheel := given.get(Odometer.key), Odometer):
        check_unit(plan.record, wheel.record, record_of(given, Gnss), wheel.mounting or wheel.usual)
    tell("navigating")
    plan = about_its_start(plan, given)
    done, loose = (
        filtered_by_possible_arm(plan, given, smooth) if check_clocks else (filtered(plan, given, smooth), None)
    )
    plan, used, track, wanders = done
    evidence = [*_seen(plan, track, used, noise), *taken, *wanders, *why, *said, *mounting_evidence(track, seated)]
    levels, least = _other_level(plan, track, used)
    evidence += levels
    if check_clocks and aiding:
        tell("checking biases, clocks and mountings")
        seen, grows = _rivals(plan, track, used, noise, modelled, smooth, loose)
        evidence, least = evidence + seen, np.maximum(with_others(least, grows.shape[-1]), grows)
    else:
        evidence += burst_evidence(record)
    force, acting = acting_at_rest(plan.start, noise)
    result = Navigation(
        status="navigated",
        evidence=(),
        track=_counted_whole(with_curve(track, [*plan.sources(used), *plan.always]), given),
        altitude=height,
        smoothed=smooth,
        gaps=gaps,
        stops=sum(len(r.time) for r in track.residuals if r.name == "zero velocity"),
        imu_source=imu_source,
        source=record.source,
        late=late,
        force=force,
        acting=acting,
    )
    if damping is None:
        return judged_navigation(result, counted_once(evidence), least)
    tell(f"damping: {damping.method}")
    return _damped(replace(result, evidence=tuple(evidence)), plan, reference, noise, damping, fixes)


def _damped(
    result: Navigation,
    plan: Plan,
    reference: VelocityLog | None,
    noise: ImuSpec,
    damping: Damper,
    fixes: Fixes,
) -> Navigation:
    """A free navigation damped, with the error states that go on."""
    from truenorth.damping.navigation import damp_navigation

    fine = plan.finest() if reference is not None and plan.every > 1 else None
    known = [group for group in plan.model.groups if group.name not in (SLOW_GYRO, SLOW_ACCEL)]
    return damp_navigation(result, reference, noise, damping, known, fixes, fine)


def _counted_whole(track: Track, asked: Mapping[str, Any]) -> Track:
    """The track with latencies and arms as they are; `asked` are the aids as they were given."""
    for key, (name, _) in SENSORS.items():
        if (mounting := getattr(asked.get(key), "mounting", None)) is not None:
            track = counted_whole(track, name, mounting)
    return track


def _model(begin: Start, further: Sequence[Group | str], every_axis: bool, height: Altitude, spec: ImuSpec) -> InsModel:
    """The INS of a specification, with further groups, as it stands at the start."""
    force, fixed, groups = force_at_rest(begin), height == "fixed", groups_of(further, spec)
    return InsModel.from_spec(spec, standing=force, every_axis=every_axis, groups=groups, fixed_altitude=fixed)


def _seen(plan: Plan, track: Track, given: Mapping[str, Any], spec: ImuSpec) -> list[Evidence]:
    """What the measurements and the log show."""
    evidence = innovation_evidence(track.residuals, last_sigma(track)) + moving_evidence(plan.record)
    receiver = record_of(given, Gnss)
    evidence += [] if receiver is None else gnss_evidence(receiver)
    evidence += shift_evidence(plan.record, spec, track, *logs_of_speed(given))
    if plan.altitude == "baro" and isinstance(barometer := given.get(Barometer.key), Barometer):
        heights = given.get(Gnss.key)
        evidence += level_evidence(barometer, heights if isinstance(heights, Gnss) else None, track)
    unused = "baro" in given and plan.altitude != "baro"
    return [*evidence, *([note("height.barometer_unused", "use_barometer", altitude=plan.altitude)] if unused else [])]


def _other_level(plan: Plan, track: Track, given: Mapping[str, Any]) -> tuple[list[Evidence], Array]:
    """Whether a barometer that keeps no height has another level than the receiver, and by how much sigmas grow for it."""
    barometer, receiver = given.get(Barometer.key), given.get(Gnss.key)
    if plan.altitude == "baro" or not isinstance(barometer, Barometer) or not isinstance(receiver, Gnss):
        return [], np.ones((len(track), 9))
    return either_level(barometer, receiver, track)


def _rivals(
    plan: Plan,
    track: Track,
    given: Mapping[str, Any],
    spec: ImuSpec,
    modelled: Callable[[ImuSpec], InsModel],
    smooth: bool,
    loose: Track | None,
) -> tuple[list[Evidence], Array]:
    """What other biases, a poorer IMU, other clocks and mountings explain better; growth by poorer IMUs and other starts."""
    aiding = plan.sources(given)

    def again(slow: Slow, model: InsModel) -> Track:
        other = replace(plan, model=model, slow=slow)
        return other.run(other.sources(given), smooth=smooth)

    def of_record(record: ImuRecord) -> Track:
        return replace(plan, record=record).run(aiding, smooth=smooth)

    def of_start(start: Start, model: InsModel = plan.model) -> Track:
        return replace(plan, start=start, model=model).run(aiding, smooth=smooth)

    def of_another_imu(other: ImuSpec) -> Track:
        return of_start(of_poorer(plan.start, spec, other), modelled(other))

    others = poorer_tracks(of_another_imu, track, spec)
    usual, without = partial(again, plan.slow), [partial(again, less) for less in one_less(plan.slow)]
    found = noise_evidence(usual, track, plan.model, plan.record)
    found += spike_evidence(of_record, track, plan.record)

    def of_another_course() -> list[Rival]:
        return warming_rivals(of_record, track, plan.record, spec) + poorer_rivals(track, others)

    found += wandering_evidence(usual, track, plan.model, spec, plan.record.duration, without, of_another_course)
    found += jump_evidence(lambda record: replace(plan, record=record).run(aiding), track, plan.record)
    found += _led_away(plan, track, given, smooth)
    found += gyros_of_another_moment(plan, given)
    loose = looser_track(plan, given) if loose is None else loose
    found += second_look(loose, track, looked_at(given), quick_swing(plan, given))
    unsure, growth = start_evidence(of_start, plan.start, track)
    return found + unsure, np.maximum(with_others(growth_along(track, others), growth.shape[-1]), growth)


def _led_away(plan: Plan, track: Track, given: Mapping[str, Any], smooth: bool) -> list[Evidence]:
    """Whether the receiver's velocity steps where the IMU's does not, or its heights step or drift away from it."""
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss):
        return []

    def with_log(slow: Slow, log: GnssRecord) -> Track:
        other = replace(plan, slow=slow)
        return other.run(other.sources({**given, Gnss.key: replace(receiver, record=log)}), smooth=smooth)

    usual, without = partial(with_log, plan.slow), [partial(with_log, less) for less in one_less(plan.slow)]
    found = led_by_evidence(usual, track, receiver.record, without)
    if plan.altitude == "fixed":
        return found
    stepped = height_step_evidence(usual, track, receiver.record, without)
    return found + (stepped or height_evidence(usual, track, receiver.record, without))


def _intervals(
    record: ImuRecord, interval: float | None, output: float | None, damped: bool = False
) -> tuple[float, int]:
    """Interval of the filter (s), and how many of them to a row of the track."""
    interval = (FINE if record.duration <= LONG else COARSE) if interval is None else interval
    usual = max(1.0, record.duration / 20_000.0)
    output = (min(usual, DAMPED) if damped else usual) if output is None else output
    if not (interval > 0.0 and output > 0.0):
        raise UsageError(f"interval {interval:g} s, output {output:g} s; expected both above zero")
    return interval, max(1, round(output / interval))
