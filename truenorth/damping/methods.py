"""The damping methods on one course: what each takes off, with which bands, and what it makes of fixes from outside."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.answer import Found
from truenorth.damping.bands import Bands, filter_bands, network_bands, widest
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.fix_rows import FixRows, Weighed
from truenorth.damping.loop import Loop, network_correction
from truenorth.damping.networks import NO_NETWORK, first_order, second_order
from truenorth.damping.options import Damper
from truenorth.damping.reference import Reference
from truenorth.damping.switching import switching
from truenorth.damping.waves import over_waves
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import DV, MOTION, OF_INS, STATES, MarineModel
from truenorth.records.specs import ImuSpec
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]
T = TypeVar("T")

WINDOW = 5.0  # s, of filter 2
LEAST_WALK = 1e-5  # m/s/sqrt(s), of an IMU without noise


def loop_of(damper: Damper) -> Loop:
    """Of a network; of any other method undamped."""
    if damper.method in ("internal", "external"):
        network = first_order(damper.ratio) if damper.order == 1 else second_order(damper.ratio)
        return Loop(network, damper.azimuth)
    return Loop(NO_NETWORK)


def found_by(
    course: Track,
    reference: Reference | None,
    spec: ImuSpec,
    damper: Damper,
    start: int,
    wholes: Sequence[Filter],
    errors: LogErrors,
    fixes: FixRows | None,
) -> Found:
    """Errors of a course as a method finds them.

    Parameters
    ----------
    course : Track
    reference : Reference, optional
    spec : ImuSpec
    damper : Damper
    start : int
        Epoch of the switch.
    wholes : sequence of Filter
        All errors of INS and log, in one reading of the log's drift or two, the faster one first.
    errors : LogErrors
        In the first of these.
    fixes : FixRows, optional
    """
    if damper.method == "none":
        return Found(np.zeros((len(course), MOTION.stop)), None, None, None)
    if damper.method in ("internal", "external"):
        return _by_network(course, reference, damper, start, wholes, fixes)
    assert reference is not None  # checked before
    if damper.method == "augmented":
        return _augmented(course, reference, start, wholes, fixes)
    one = Filter(MarineModel.from_spec(spec), wholes[0].P0[:STATES, :STATES], reference.noise, relinearise=True)
    if damper.method == "kalman":
        estimate, weighed, bands = _filter_one(course, reference, start, wholes, one, fixes)
        return Found(_from(course, start, estimate), bands, estimate, None, weighed)
    return _double(course, reference, start, wholes, one, errors, fixes)


def _augmented(
    course: Track, reference: Reference, start: int, wholes: Sequence[Filter], fixes: FixRows | None
) -> Found:
    """By the filter of all errors, in the faster reading of the drift; sigma holds the slower one too, where there are two."""
    calm = over_waves(course, reference.velocity, reference.noise, start)
    whole = replace(wholes[0], gate=1.0 - limit("log's gate"), sigma=calm.noise)

    def run(fixed: FixRows | None) -> tuple[Estimate, Weighed | None]:
        kinds = {"augmented": replace(whole, fixes=fixed)}
        once = partial(run_filters, course, calm.velocity, start=start, kinds=kinds, seen=calm.course)
        estimate = once(about=once()["augmented"].x[:, MOTION])["augmented"]
        return estimate, estimate.fixes

    if len(wholes) == 1:
        estimate, weighed = run(fixes)
        return Found(_from(course, start, estimate), None, estimate, None, weighed)
    absent = np.asarray(np.isnan(calm.velocity[start:]).any(axis=1))

    def bands_of(fixed: FixRows | None) -> Bands:
        one = replace(whole, fixes=fixed)
        return widest([filter_bands(course[start:], each, one, absent=absent) for each in wholes[1:]])

    # Of a drift that may as well be slower than the filter takes it for.
    estimate, weighed, slower = _weighed_by_bands(fixes, run, bands_of)
    sigma = estimate.sigma.copy()
    sigma[:, MOTION] = np.maximum(sigma[:, MOTION], slower.errors)
    return Found(_from(course, start, estimate), None, replace(estimate, sigma=sigma), None, weighed)


def _filter_one(
    course: Track,
    reference: Reference,
    start: int,
    wholes: Sequence[Filter],
    one: Filter,
    fixes: FixRows | None,
) -> tuple[Estimate, Weighed | None, Bands]:
    """Filter 1, which does not know how wrong the log makes it: place and heading begin anew with a fix."""
    absent = np.asarray(np.isnan(reference.velocity[start:]).any(axis=1))

    def run(fixed: FixRows | None) -> tuple[Estimate, Weighed | None]:
        kinds = {"filter1": replace(one, fixes=fixed)}
        estimate = run_filters(course, reference.velocity, start=start, kinds=kinds)["filter1"]
        return estimate, estimate.fixes

    def bands_of(fixed: FixRows | None) -> Bands:
        own = replace(one, fixes=fixed)
        return widest([filter_bands(course[start:], whole, own, absent=absent) for whole in wholes])

    return _weighed_by_bands(fixes, run, bands_of)


def _double(
    course: Track,
    reference: Reference,
    start: int,
    wholes: Sequence[Filter],
    one: Filter,
    errors: LogErrors,
    fixes: FixRows | None,
) -> Found:
    """Filters 1 and 2, fused; of fixes filter 2 takes those that filter 1 does."""
    two, weighed = change_filter(one, errors, course.interval), None
    if fixes is not None:
        _, weighed, _ = _filter_one(course, reference, start, wholes, one, fixes)
        assert weighed is not None  # it was given some
        taken = weighed.fixes.some(weighed.used)
        one, two = replace(one, fixes=taken), replace(two, fixes=taken.unasked())
    found = run_filters(course, reference.velocity, start=start, kinds={"filter1": one, "filter2": two})
    samples = max(1, round(3600.0 / course.interval))
    fused = Fusion(samples=samples)(found["filter1"], found["filter2"], course.interval)
    assert fused.weight is not None  # of a fusion
    known = fused.weight[:, MOTION], (found["filter1"].x - found["filter2"].x)[:, MOTION]
    absent = np.asarray(np.isnan(reference.velocity[start:]).any(axis=1))
    bands = widest([filter_bands(course[start:], whole, one, two, known, absent) for whole in wholes])
    return Found(_from(course, start, fused), bands, fused, None, weighed)


def _from(course: Track, start: int, estimate: Estimate) -> Array:
    """(K+1, 7) what is taken off a course, nothing before the switch."""
    x = np.zeros((len(course), MOTION.stop))
    x[start:] = estimate.x[:, MOTION]
    return x


def _weighed_by_bands(
    fixes: FixRows | None,
    run: Callable[[FixRows | None], tuple[T, Weighed | None]],
    bands_of: Callable[[FixRows | None], Bands],
) -> tuple[T, Weighed | None, Bands]:
    """A method that weighs its fixes by bands which follow those that it takes."""
    bands = bands_of(fixes)
    found, weighed = run(None if fixes is None else fixes.expected(bands.errors))
    if fixes is None:
        return found, weighed, bands
    taken = np.ones(len(fixes.time), dtype=bool)
    for _ in fixes.time:
        assert weighed is not None  # it was given some
        if np.array_equal(weighed.used, taken):
            break
        taken = weighed.used
        bands = bands_of(fixes.some(taken))
        found, weighed = run(fixes.expected(bands.errors))
    return found, weighed, bands


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
    fixes: FixRows | None,
) -> Found:
    """A network's correction, its bands, and what manoeuvres add to those of internal damping."""
    internal = damper.method == "internal"
    used = None if internal or reference is None else reference.velocity
    sigma = np.sqrt(np.mean(course.sigma[:, OF_INS[DV]] ** 2, axis=1))
    loop = loop_of(damper)
    found = switching(course, loop.network, sigma) if internal else None
    mu = found.mu if found is not None and damper.switching else np.ones(len(course))
    corrected = partial(network_correction, course, loop, start=float(course.time[start]), ramp=damper.ramp, mu=mu)
    absent = None if used is None else np.asarray(np.isnan(used[start:]).any(axis=1))

    def run(fixed: FixRows | None) -> tuple[Array, Weighed | None]:
        weighed = None if fixed is None else Weighed(fixed)
        return corrected(used, fixes=weighed), weighed

    def bands_of(fixed: FixRows | None) -> Bands:
        rest, part = course[start:], mu[start:]
        bands = widest(
            [
                network_bands(rest, loop, whole, part, log=used is not None, absent=absent, fixes=fixed)
                for whole in wholes
            ]
        )
        if found is None:
            return bands
        # A manoeuvre's part alone, as if the rest of the velocity were known.
        still = course.v_n[:, :2] - found.manoeuvre
        added = corrected(still, fixes=None if fixed is None else Weighed(replace(fixed.unasked(), z=0.0 * fixed.z)))
        return bands._replace(errors=np.hypot(bands.errors, added[start:]))

    x, weighed, bands = _weighed_by_bands(fixes, run, bands_of)
    return Found(x, bands, None, found if damper.switching else None, weighed)
