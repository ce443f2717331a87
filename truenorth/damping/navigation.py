"""A free navigation, damped: its track corrected, its bands, what the log did, spectra before and after."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.fixes import Fixes
from truenorth.core.errors import DataError, UsageError
from truenorth.damping.answer import (
    Found,
    LogOn,
    corrected,
    even,
    history_of,
    lines_of,
    residuals_of,
    spectrum_of,
    switched,
)
from truenorth.damping.bands import Bands, filter_bands, network_bands, widest
from truenorth.damping.course import without_errors
from truenorth.damping.drift import likely_drifts
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.fix_rows import FixRows, fixes_on
from truenorth.damping.log_arm import at_the_imu
from truenorth.damping.loop import LONGEST_STEP, Loop, eigenvalues, network_correction
from truenorth.damping.networks import NO_NETWORK, first_order, second_order
from truenorth.damping.options import Damper
from truenorth.damping.reference import LEAST_NOISE, Reference, reference_of
from truenorth.damping.result import Damping
from truenorth.damping.switching import switching
from truenorth.damping.waves import over_waves
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.errors.group import Group
from truenorth.errors.log import LogErrors, log_errors, log_rows
from truenorth.errors.marine import MOTION, OF_INS, STATES, MarineModel
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
WINDOW = 5.0  # s, of filter 2
LEAST_WALK = 1e-5  # m/s/sqrt(s), of an IMU without noise


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
        From outside; method ``augmented`` takes them.
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
    if (fixes.positions or fixes.azimuths) and damper.method != "augmented":
        raise UsageError(f"fixes with damping {damper.method}; expected damping augmented, whose filter can weigh them")
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
    fixed = fixes_on(course, finest, fixes, start)
    wholes = [_whole(course, log, errors, spec, others, start) for errors in drifts]
    whole = wholes[0]
    found = _damped(course, log.reference, spec, damper, start, wholes, drifts[0], fixed)
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
        modes=tuple(eigenvalues(course, _loop(damper), (len(course) - 1) // 2)) if network else (),
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
    of_fixes = [] if found.estimate is None or found.estimate.fixes is None else found.estimate.fixes.residuals()
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


def _loop(damper: Damper) -> Loop:
    if damper.method in ("internal", "external"):
        network = first_order(damper.ratio) if damper.order == 1 else second_order(damper.ratio)
        return Loop(network, damper.azimuth)
    return Loop(NO_NETWORK)


def _damped(
    course: Track,
    reference: Reference | None,
    spec: ImuSpec,
    damper: Damper,
    start: int,
    wholes: Sequence[Filter],
    errors: LogErrors,
    fixes: FixRows | None,
) -> Found:
    whole = wholes[0]
    x = np.zeros((len(course), MOTION.stop))
    rest = course[start:]
    if damper.method == "none":
        return Found(x, None, None, None)
    if damper.method in ("internal", "external"):
        return _by_network(course, reference, damper, start, wholes)
    assert reference is not None  # checked before
    if damper.method == "augmented":
        return _augmented(course, reference, start, wholes, fixes)
    model = MarineModel.from_spec(spec)
    one = Filter(model, whole.P0[:STATES, :STATES], reference.noise, relinearise=True)
    two = None if damper.method == "kalman" else change_filter(one, errors, course.interval)
    kinds = {"filter1": one} if two is None else {"filter1": one, "filter2": two}
    estimates = run_filters(course, reference.velocity, start=start, kinds=kinds)
    estimate, known = estimates["filter1"], None
    if two is not None:
        samples = max(1, round(3600.0 / course.interval))
        fused = Fusion(samples=samples)(estimate, estimates["filter2"], course.interval)
        assert fused.weight is not None  # of a fusion
        known = fused.weight[:, MOTION], (estimate.x - estimates["filter2"].x)[:, MOTION]
        estimate = fused
    x[start:] = estimate.x[:, MOTION]
    absent = np.asarray(np.isnan(reference.velocity[start:]).any(axis=1))
    bands = widest([filter_bands(rest, whole, one, two, known, absent) for whole in wholes])
    return Found(x, bands, estimate, None)


def _augmented(
    course: Track, reference: Reference, start: int, wholes: Sequence[Filter], fixes: FixRows | None
) -> Found:
    """By the filter of all errors, in the faster reading of the drift; sigma holds the slower one too, where there are two."""
    calm = over_waves(course, reference.velocity, reference.noise, start)
    whole = replace(wholes[0], gate=1.0 - limit("log's gate"), sigma=calm.noise)

    def run(fixed: FixRows | None) -> Estimate:
        kinds = {"augmented": replace(whole, fixes=fixed)}
        once = partial(run_filters, course, calm.velocity, start=start, kinds=kinds, seen=calm.course)
        return once(about=once()["augmented"].x[:, MOTION])["augmented"]

    x = np.zeros((len(course), MOTION.stop))
    if len(wholes) > 1:  # of a drift that may as well be slower than the filter takes it for
        absent = np.asarray(np.isnan(calm.velocity[start:]).any(axis=1))

        def bands_of(fixed: FixRows | None) -> Bands:
            one = replace(whole, fixes=fixed)
            return widest([filter_bands(course[start:], each, one, absent=absent) for each in wholes[1:]])

        estimate, slower = _with_fixes(fixes, run, bands_of)
        sigma = estimate.sigma.copy()
        sigma[:, MOTION] = np.maximum(sigma[:, MOTION], slower.errors)
        estimate = replace(estimate, sigma=sigma)
    else:
        estimate = run(fixes)
    x[start:] = estimate.x[:, MOTION]
    return Found(x, None, estimate, None)


def _with_fixes(
    fixes: FixRows | None, run: Callable[[FixRows | None], Estimate], bands_of: Callable[[FixRows | None], Bands]
) -> tuple[Estimate, Bands]:
    """A filter that weighs its fixes by bands which follow those that it takes."""
    bands = bands_of(fixes)
    if fixes is None:
        return run(None), bands
    taken = np.ones(len(fixes.time), dtype=bool)
    for _ in fixes.time:
        estimate = run(fixes.expected(bands.errors))
        assert estimate.fixes is not None  # it was given some
        if np.array_equal(estimate.fixes.used, taken):
            break
        taken = estimate.fixes.used
        bands = bands_of(fixes.some(taken))
    return estimate, bands


def change_filter(one: Filter, errors: LogErrors, interval: float) -> Filter:
    """Filter 2, of changes of the velocity that filter 1 smooths.

    What filter 1 takes in of noise changes its velocity as a random walk of the INS's own density ``q`` does, so that a change
    over T has ``q/sqrt(T)``; a drift of the log adds its own density. Windows that overlap share it: each counts as one of so many.
    """
    q = math.hypot(one.model.accel_random_walk, errors.drift * math.sqrt(2.0 / errors.time))
    return replace(one, sigma=max(q, LEAST_WALK) / math.sqrt(min(interval, WINDOW)), window=WINDOW)


def _by_network(
    course: Track,
    reference: Reference | None,
    damper: Damper,
    start: int,
    wholes: Sequence[Filter],
) -> Found:
    """A network's correction, its bands, and what manoeuvres add to those of internal damping."""
    loop, at = _loop(damper), float(course.time[start])
    internal = damper.method == "internal"
    used = None if internal or reference is None else reference.velocity
    sigma = np.sqrt(np.mean(course.sigma[:, DV][:, :2] ** 2, axis=1))
    found = switching(course, loop.network, sigma) if internal else None
    mu = found.mu if found is not None and damper.switching else np.ones(len(course))
    x = network_correction(course, loop, used, start=at, ramp=damper.ramp, mu=mu)
    by_log = used is not None
    absent = None if used is None else np.asarray(np.isnan(used[start:]).any(axis=1))
    bands = widest(
        [network_bands(course[start:], loop, whole, mu[start:], log=by_log, absent=absent) for whole in wholes]
    )
    if found is not None:  # a manoeuvre's part alone, as if the rest of the velocity were known
        still = course.v_n[:, :2] - found.manoeuvre
        added = network_correction(course, loop, still, start=at, ramp=damper.ramp, mu=mu)
        bands = bands._replace(errors=np.hypot(bands.errors, added[start:]))
    return Found(x, bands, None, found if damper.switching else None)
