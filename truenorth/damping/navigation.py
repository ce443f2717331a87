"""A free navigation, damped: its track corrected, its bands, what the log did, spectra before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.fixes import Fixes
from truenorth.core.errors import DataError, UsageError
from truenorth.damping.answer import (
    LogOn,
    corrected,
    even,
    history_of,
    lines_of,
    residuals_of,
    spectrum_of,
    switched,
)
from truenorth.damping.course import without_errors
from truenorth.damping.drift import likely_drifts
from truenorth.damping.filters import Filter
from truenorth.damping.fix_rows import fixes_on
from truenorth.damping.log_arm import at_the_imu
from truenorth.damping.loop import LONGEST_STEP, eigenvalues
from truenorth.damping.methods import found_by, loop_of
from truenorth.damping.options import Damper
from truenorth.damping.reference import LEAST_NOISE, Reference, reference_of
from truenorth.damping.result import Damping
from truenorth.damping.waves import over_waves
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.errors.group import Group
from truenorth.errors.log import LogErrors, log_errors, log_rows
from truenorth.errors.marine import OF_INS, STATES, MarineModel
from truenorth.navigation.result import Navigation, judged_navigation, last_sigma
from truenorth.quality.innovations import innovation_evidence, residual_evidence
from truenorth.records import VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, contradiction, note
from truenorth.state.layout import ACCEL_AXES, DV, GYRO_AXES
from truenorth.state.limits import limit

if TYPE_CHECKING:
    from truenorth.aiding.aids import VelocityLog
    from truenorth.state.mounting import Mounting
    from truenorth.state.track import Track

Array = NDArray[np.float64]

OF_COURSE = (DEFLECTION, GYRO_AXES, ACCEL_AXES)  # groups of the free INS that go on


def damp_navigation(
    result: Navigation,
    velocity: VelocityLog | None,
    spec: ImuSpec,
    damper: Damper,
    others: Sequence[Group],
    fixes: Fixes,
    fine: Track | None = None,
) -> Navigation:
    """Damp a free inertial navigation afterwards.

    Parameters
    ----------
    result : Navigation
        Without aiding, its height held. Its track's covariances are overwritten by those of the damped one.
    velocity : VelocityLog, optional
        Needed by all methods but ``none`` and ``internal``. Of its mounting, the angles of a log in body axes, its arm and its
        latency.
    spec : ImuSpec
        Of the IMU: noise of the filters and of the bands.
    damper : Damper
    others : sequence of Group
        Further error states of the navigation; of these the deflection of the vertical and the IMU's axes are known here.
    fixes : Fixes
        From outside. The filter of ``augmented`` weighs them; of all other methods place and heading begin anew with them.
    fine : Track, optional
        The same navigation with more epochs, by which the log's rows are compared.

    Returns
    -------
    Navigation
        With `damping`.

    Raises
    ------
    UsageError
        No velocity log where one is needed; a navigation that was aided, whose height was free, or whose epochs are far apart;
        a mounting of which more than the arm is to be estimated.
    DataError
        Uneven epochs; a log that does not overlap; a switch after the end.
    """
    if result.residuals or result.smoothed:
        raise UsageError("damping corrects a free INS; expected no aiding sensor, no stops and no smoothing besides it")
    if result.altitude != "fixed":
        raise UsageError(f"damping with altitude {result.altitude!r}; expected 'fixed': the height is held at sea")
    if velocity is None and damper.needs_reference:
        raise UsageError(f"damping {damper.method} needs a reference velocity; expected velocity=record")
    if (fixes.positions or fixes.azimuths) and damper.method == "none":
        raise UsageError(
            "fixes with damping none; expected another method, or a navigation without damping, which takes them"
        )
    if strange := [group.name for group in others if group.name not in OF_COURSE]:
        raise UsageError(f"damping with error states {', '.join(strange)}; expected {', '.join(OF_COURSE)} alone")
    course = even(result.track)
    if course.interval > LONGEST_STEP * 1.01:
        raise UsageError(
            f"damping with a track of {course.interval:g} s from row to row; expected {LONGEST_STEP:g} s at most: "
            f"say so by `output`, seconds between rows"
        )
    start = round(damper.start / course.interval)
    if start >= len(course) - 2:
        raise DataError(
            f"damping begins {damper.start:g} s after {course.time[0]:.1f} s, the log ends at {course.time[-1]:.1f} s; expected an "
            "earlier start"
        )
    finest = course if fine is None else even(fine)
    log = LogOn(None, LogErrors(0.0), False, None) if velocity is None else _log_on(course, velocity, finest, spec)
    drifts, evidence = _with_drift(course, log, spec, others, start)
    fixed = fixes_on(course, finest, fixes, start, anew=damper.method != "augmented")
    wholes = [_whole(course, log, errors, spec, others, start) for errors in drifts]
    whole = wholes[0]
    found = found_by(course, log.reference, spec, damper, start, wholes, drifts[0], fixed)
    damped = without_errors(course, found.x)
    seen = slice(start, None)
    base = 0.0 if log.reference is None else log.reference.velocity[seen]
    spectra = [spectrum_of(c.v_n[seen, :2] - base, course.interval) for c in (course, damped)]
    network = damper.method in ("none", "internal", "external")
    report = Damping(
        damper=damper,
        switch=float(course.time[start]),
        reference=log.reference,
        before=spectra[0],
        after=spectra[1],
        lines=lines_of(course.v_n[seen, :2] - base, course.interval),
        modes=tuple(eigenvalues(course, loop_of(damper), (len(course) - 1) // 2)) if network else (),
        rejected=0 if found.estimate is None else found.estimate.rejected,
        length=float(course.time[-1] - course.time[start]),
        time=course.time[start:],
        switching=found.switching,
        log=history_of(course, found.estimate, whole.model.groups) if damper.method == "augmented" else None,
        weight=None if found.estimate is None else found.estimate.weight,
    )
    residuals = residuals_of(course, log, damped, found, start)
    evidence = [*result.evidence, *evidence]
    if log.reference is not None:
        evidence += log.reference.evidence()
        evidence += [] if log.arm is None else log.arm.evidence()
        if damper.needs_reference:
            evidence += _contradiction(course, log.reference, log.errors, start)
    evidence += [] if not report.rejected else [note("log.rejected", count=report.rejected)]
    if found.switching is not None and found.switching.switches:
        evidence.append(switched(found.switching, course.time))
    of_fixes = [] if found.fixes is None else found.fixes.residuals()
    track = course
    if damper.method != "none":
        track = corrected(damped, found, start)
        track = replace(track, residuals=(*residuals, *of_fixes))
    sigma = last_sigma(track)
    if damper.method == "augmented":
        evidence += innovation_evidence(residuals, sigma)
    else:
        evidence += residual_evidence(residuals, sigma, log.errors.time)
    evidence += innovation_evidence(of_fixes, sigma, given=True)
    return judged_navigation(replace(result, track=track, damping=report), evidence)


def _log_on(course: Track, velocity: VelocityLog, seen: Track, spec: ImuSpec) -> LogOn:
    record = _mounted(velocity.record, velocity.mounting)
    errors = log_errors(velocity.errors, record.frame)
    record, arm = at_the_imu(seen, record, velocity.mounting, errors, spec)
    return LogOn(reference_of(course, record, errors, seen), errors, record.frame == "body", arm)


def _with_drift(
    course: Track, log: LogOn, spec: ImuSpec, others: Sequence[Group], start: int
) -> tuple[tuple[LogErrors, ...], list[Evidence]]:
    """Errors of the log; a drift of which nobody knows how long it lasts is found, in one reading of it or two."""
    errors = log.errors
    if log.reference is None or errors.drift == 0.0 or errors.drift_time is not None:
        return (errors,), []
    kind = _whole(course, log, errors, spec, others, start)
    calm = over_waves(course, log.reference.velocity, log.reference.noise, start)
    found = likely_drifts(course, calm.velocity, start, replace(kind, sigma=calm.noise), errors, calm.course)
    if math.isinf(found[0].time):
        return found, [note("log.constant")]
    return found, [note("log.drifts", drift=found[0].drift, hours=found[0].time / 3600.0)]


def _whole(course: Track, log: LogOn, errors: LogErrors, spec: ImuSpec, others: Sequence[Group], start: int) -> Filter:
    """All errors of INS and log at the switch."""
    model = MarineModel.from_spec(spec, (*errors.groups(), *others))
    places, rows = list(range(STATES)), OF_INS.tolist()
    for name in OF_COURSE:
        own, there = model.slice_of(name), course.layout.slice_of(name)
        if own is not None and there is not None:
            places += range(own.start, own.stop)
            rows += range(there.start, there.stop)
    P = model.prior(np.zeros((STATES, STATES)))
    P[np.ix_(places, places)] = course.P[start][np.ix_(rows, rows)]
    noise = LEAST_NOISE if log.reference is None else log.reference.noise
    return Filter(model, P, noise, relinearise=True, turned=log.turned)


def _contradiction(course: Track, reference: Reference, errors: LogErrors, start: int) -> list[Evidence]:
    """That a log cannot be this vehicle's.

    For more than half of the log it differs from the free INS by more than both can be wrong. A log that is dead or in other
    units does; outliers, jumps and silences do not.
    """
    off = np.abs(course.v_n[start:, :2] - reference.velocity[start:])
    rows = log_rows(errors.groups(), course.C_nb[start:], course.v_n[start:])
    own = np.concatenate([np.zeros(0), *(group.prior for group in errors.groups())])
    expected = np.sqrt(course.sigma[start:, DV][:, :2] ** 2 + (rows**2 @ own**2) + reference.noise**2)
    there = np.isfinite(off).all(axis=1)
    if not there.any() or np.median((off / expected)[there].max(axis=1)) <= limit("log"):
        return []
    east, north = (float(x) for x in np.median(off[there], axis=0))
    allowed = float(np.median(expected[there]))
    return [contradiction("log.contradicts", "log", "log_error", east=east, north=north, allowed=allowed)]


def _mounted(velocity: VelocityRecord, mounting: Mounting | None) -> VelocityRecord:
    """The log along the IMU's axes, on its clock."""
    if mounting is None:
        return velocity
    if any((mounting.angle_sigma, mounting.scale_sigma, mounting.latency_sigma)):
        raise UsageError(
            "damping estimates of a log's mounting its arm alone; expected angles, scale and latency that are known: what is not "
            "known of a log is said by LogErrors"
        )
    if velocity.frame == "body" and not np.array_equal(mounting.C_mb, np.eye(3)):
        turned = np.nan_to_num(velocity.velocity) @ mounting.C_mb
        turned[np.isnan(velocity.velocity[:, 1])] = np.nan
        velocity = replace(velocity, velocity=turned, sigma=None)
    return velocity.shifted(-mounting.latency) if mounting.latency else velocity
