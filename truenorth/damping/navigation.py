"""A free navigation, damped: its track corrected, its bands, what the log did, spectra before and after."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.damping.bands import constant_error_sigma, network_sigma
from truenorth.damping.course import Course
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.loop import LONGEST_STEP, Loop, eigenvalues, network_correction
from truenorth.damping.networks import NO_NETWORK, first_order, second_order
from truenorth.damping.options import Damper
from truenorth.damping.reference import Reference, reference_of
from truenorth.damping.result import Damping
from truenorth.damping.spectrum import Spectrum, schuler_lines, spectrum
from truenorth.models.marine import BA, BG, DP, DV, OF_INS, PHI, REF, STATES, MarineModel
from truenorth.navigation.result import Navigation, judged_navigation
from truenorth.records import VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state import layout as ins
from truenorth.state.evidence import Evidence, contradiction, note
from truenorth.state.limits import limit

if TYPE_CHECKING:
    from truenorth.state.mounting import Mounting
    from truenorth.state.track import Track

Array = NDArray[np.float64]

GATE = 1.0 - 1e-6  # with which a good row passes: one in six days at 1 Hz is lost
WINDOW = 5.0  # s, of filter 2
CHANGE_SIGMA = 0.001  # m/s^2, of filter 2's measurement
SHORTEST = 16  # epochs of a spectrum
LEVEL = np.array([0, 1, 2, 3, 4, 6, 7])  # of errors.ins: PHI, and the level parts of DV and DP


def damp_navigation(
    result: Navigation,
    velocity: VelocityRecord | None,
    spec: ImuSpec,
    damper: Damper,
    mounting: Mounting | None = None,
) -> Navigation:
    """Damp a free inertial navigation afterwards.

    Parameters
    ----------
    result : Navigation
        Without aiding, its height held.
    velocity : VelocityRecord, optional
        Needed by all methods but ``none`` and ``internal``.
    spec : ImuSpec
        Of the IMU: noise of the filters and of the bands.
    damper : Damper
    mounting : Mounting, optional
        Of the velocity log: the angles of one in body axes, and its latency.

    Returns
    -------
    Navigation
        With `damping`.

    Raises
    ------
    UsageError
        No velocity log where one is needed; a navigation that was aided, whose height was free, or whose epochs are far apart;
        a mounting with a lever arm, or with something to be estimated.
    DataError
        Uneven epochs; a log that does not overlap; a switch after the end.
    """
    if result.residuals or result.smoothed:
        raise UsageError("damping corrects a free INS; expected no aiding sensor, no stops and no smoothing besides it")
    if result.altitude != "fixed":
        raise UsageError(f"damping with altitude {result.altitude!r}; expected 'fixed': the height is held at sea")
    if velocity is None and damper.needs_reference:
        raise UsageError(f"damping {damper.method} needs a reference velocity; expected velocity=record")
    track = _even(result.track)
    course = Course(track.time, track.C_nb, track.v_n, track.position)
    if course.interval > LONGEST_STEP * 1.01:
        raise UsageError(
            f"damping with a track of {course.interval:g} s from row to row; expected {LONGEST_STEP:g} s at most"
        )
    start = round(damper.start / course.interval)
    if start >= course.epochs - 1:
        raise DataError(
            f"damping begins {damper.start:g} s after {course.time[0]:.1f} s, the log ends at {course.time[-1]:.1f} s; expected an "
            "earlier start"
        )
    reference = None if velocity is None else reference_of(course, _mounted(velocity, mounting))
    P0 = track.P[start][np.ix_(OF_INS, OF_INS)]
    x, sigma, estimate = _damped(course, reference, spec, damper, start, P0)
    damped = course.corrected(x)
    seen = slice(start, None)
    base = 0.0 if reference is None else reference.velocity[seen]
    spectra = [_spectrum(c.v_n[seen, :2] - base, course.interval) for c in (course, damped)]
    loop = _loop(damper)
    report = Damping(
        damper=damper,
        switch=float(course.time[start]),
        reference=reference,
        before=spectra[0],
        after=spectra[1],
        lines=_lines(course.v_n[seen, :2] - base, course.interval),
        modes=tuple(eigenvalues(course, loop, course.epochs // 2)),
        rejected=0 if estimate is None else estimate.rejected,
        length=float(course.time[-1] - course.time[start]),
    )
    if estimate is not None and damper.method == "augmented":
        last, last_sigma = estimate.x[-1, REF], estimate.sigma[-1, REF]
        report = replace(report, reference_error=last, reference_error_sigma=last_sigma)
    evidence = list(result.evidence)
    if reference is not None and damper.needs_reference:
        evidence += _contradiction(course, reference, track.sigma[:, 3:5], damper, start)
    evidence += [] if reference is None else reference.evidence()
    if report.rejected:
        evidence.append(note("log.rejected", count=report.rejected))
    if damper.method == "internal":
        evidence.append(note("damping.internal"))
    track = track if damper.method == "none" else _corrected(track, damped, sigma, start, estimate)
    return judged_navigation(replace(result, track=track, damping=report), evidence)


def _contradiction(course: Course, reference: Reference, sigma: Array, damper: Damper, start: int) -> list[Evidence]:
    """That a log cannot be this vehicle's.

    For more than half of the log it differs from the free INS by more than both can be wrong. A log that is dead or in other
    units does; outliers, jumps and silences do not.
    """
    off = np.abs(course.v_n[start:, :2] - reference.velocity[start:])
    expected = np.sqrt(sigma[start:] ** 2 + damper.reference_sigma**2 + reference.noise**2)
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
    unknown = (mounting.lever_arm_sigma, mounting.angle_sigma, mounting.scale_sigma, mounting.latency_sigma)
    if np.any(mounting.lever_arm) or any(unknown):
        raise UsageError(
            "damping takes the log's velocity for the IMU's; expected no lever arm, and nothing of the log to be estimated"
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
    course: Course, reference: Reference | None, spec: ImuSpec, damper: Damper, start: int, P0: Array
) -> tuple[Array, Array, Estimate | None]:
    """Errors (K+1, 7), what is left of them, one-sigma (K+1-start, 7), and the filter's estimate where it is one."""
    x = np.zeros((course.epochs + 1, 7))
    model = MarineModel.from_spec(spec, with_reference=damper.method == "augmented")
    if damper.method == "none":
        return x, np.zeros((0, 7)), None
    if damper.method in ("internal", "external"):
        loop, at = _loop(damper), float(course.time[start])
        used = None if damper.method == "internal" or reference is None else reference.velocity
        x = network_correction(course, loop, used, start=at, ramp=damper.ramp)
        noise = 0.0 if used is None or reference is None else reference.noise
        constant = 0.0 if used is None else damper.reference_sigma
        sigma = network_sigma(course, loop, P0, model, start=start, reference_noise=noise, reference_sigma=constant)
        return x, sigma, None
    assert reference is not None  # checked before
    kinds = _kinds(damper, model, P0, reference.noise)

    def found(velocity: Array) -> Estimate:
        estimates = run_filters(course, velocity, start=start, kinds=kinds)
        if damper.method != "double":
            return next(iter(estimates.values()))
        samples = max(1, round(3600.0 / course.interval))
        return Fusion(samples=samples)(estimates["filter1"], estimates["filter2"], course.interval)

    estimate = found(reference.velocity)
    x[start:] = estimate.x[:, :7]
    sigma = estimate.sigma[:, :7]
    if damper.method != "augmented":
        moved = constant_error_sigma(
            lambda velocity: found(velocity).x[:, :7], reference.velocity, damper.reference_sigma, estimate.x[:, :7]
        )
        sigma = np.hypot(sigma, moved)
    return x, sigma, estimate


def _kinds(damper: Damper, model: MarineModel, P0: Array, noise: float) -> dict[str, Filter]:
    if damper.method == "double":
        paper = MarineModel.of_paper()
        return {"filter1": Filter(paper, P0, noise), "filter2": Filter(paper, P0, CHANGE_SIGMA, window=WINDOW)}
    P = np.zeros((model.states, model.states))
    P[:STATES, :STATES] = P0
    if model.with_reference:
        P[REF, REF] = damper.reference_sigma**2 * np.eye(2)
        return {"augmented": Filter(model, P, noise, relinearise=True, gate=GATE)}
    return {"filter1": Filter(model, P, noise, relinearise=True)}


def _even(track: Track) -> Track:
    """The track without a last epoch that comes too early."""
    steps = np.diff(track.time)
    if len(steps) > 1 and abs(steps[-1] - steps[0]) > 0.01 * steps[0]:
        return replace(
            track,
            time=track.time[:-1],
            C_nb=track.C_nb[:-1],
            v_n=track.v_n[:-1],
            position=track.position[:-1],
            sensors=track.sensors[:-1],
            P=track.P[:-1],
        )
    return track


def _corrected(track: Track, damped: Course, sigma: Array, start: int, estimate: Estimate | None) -> Track:
    """The track with the errors taken off and the bands that are left; correlations are not known."""
    P, sensors = track.P.copy(), track.sensors.copy()
    variance = np.einsum("kii->ki", P)[start:].copy()
    variance[:, LEVEL] = np.concatenate([sigma[:, PHI], sigma[:, DV], sigma[:, DP]], axis=1) ** 2
    if estimate is not None:
        for own, there in ((BG, ins.BG), (BA, ins.BA)):
            sensors[start:, there] += estimate.x[:, own]
            variance[:, there] = estimate.sigma[:, own] ** 2
    P[start:] = 0.0
    states = np.arange(P.shape[1])
    P[start:, states, states] = variance
    return replace(track, C_nb=damped.C_nb, v_n=damped.v_n, position=damped.position, P=P, sensors=sensors)


def _spectrum(v: Array, interval: float) -> Spectrum | None:
    there = np.isfinite(v).all(axis=1)
    return spectrum(v[:, 0] + 1j * v[:, 1], interval) if there.sum() >= SHORTEST else None


def _lines(v: Array, interval: float) -> tuple[float, float]:
    return schuler_lines(v, interval) if np.isfinite(v).any() else (np.nan, np.nan)
