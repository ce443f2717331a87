"""Starts that are far off: the log is linearised once more about the start that it shows.

From stop to stop nothing holds the INS, where stops are all that is known of its speed. A gyro of a phone turns heading by tens of
degrees in a minute, until the next stop shows its bias, and errors are not linear by then: the filter sees a heading where there is
none to see. So the log is filtered and smoothed without gates, and begins anew with the attitude, velocity, place and biases that
the smoother finds at its start, as long as they fit better: Gauss and Newton's way to the likeliest start, the prior counted once.
No step goes farther than a start may be by its own covariance; one that fits no better is halved. Then the log begins there with
three times the sigma that it leaves itself of each combination of errors, and no more than the start's own, so that errors are
linear within it. It counts twice in that: 5 % of sigma at the most.

So it is of a phone that has levelled by accelerometers whose bias is 3 deg of tilt: until it sets off nothing shows which of the
two it is, and what takes a tilt of 5 deg off then makes .04 m/s^2 upwards that no column holds. Smoothed, vertical velocity was up
to 9 sigmas off.

Source: B. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4 (1994); the narrow start is ours,
as in :mod:`truenorth.navigation.recentred`, which turns heading alone where a sensor of speed or place holds the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.errors import DataError
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.navigation.given import ungated
from truenorth.navigation.plan import Plan
from truenorth.navigation.recentred import linear_within, recentred
from truenorth.state.layout import BA, BG, PHI, SLOW_ACCEL, SLOW_GYRO, STATES
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

MOST = 10  # passes
ENOUGH = 1.0  # of the misfit: less is no better fit
WIDER = 3.0  # times what the log leaves of a start
FARTHEST = math.sqrt(chi_square_limit(1e-3, STATES))  # sigmas of the prior, that a start may be off
LONGEST = 900.0  # s of a log, that show its start: smoothing holds all of them in memory
PARTS = (0.1, 0.25, 0.5)  # of the measurements
TILT = math.radians(1.0)  # one sigma of a start's, beyond which its square counts
ROUNDING = 1e-12  # of a correlation


class _Found(NamedTuple):
    """A likeliest start."""

    off: Array  # (15,) errors of the start that was given
    left: Array  # (r, r) covariance that the log leaves of it, by parts of the prior's factor
    near: bool  # no step led farther than a start may be


def about_its_start(plan: Plan, given: Mapping[str, Aid]) -> Plan:
    """The plan from the heading that the log shows, where its start was unsure; of stops alone, or tilted, from all it shows."""
    aiding = {True: plan.sources(given), False: plan.sources(ungated(given))}
    always = {True: plan.always, False: [replace(source, gate=0.0) for source in plan.always]}

    def run(at: Start, gated: bool, until: float | None = None) -> Track:
        part = replace(plan, record=plan.record.between(None, until), start=at, always=always[gated])
        return part.run(aiding[gated], smooth=not gated)

    def begun(at: Start, gated: bool, until: float | None) -> Track:
        return run(at, gated, plan.start.time + LONGEST if until is None else until)

    start = recentred(run, plan.start, linear_within(given)) if aiding[True] else plan.start
    rows = [source.time for source in (*aiding[True], *plan.always) if source.does == "measurement"]
    tilted = float(np.sqrt(start.P[PHI, PHI].diagonal()[:2].max())) > TILT
    if any((t <= start.time + LONGEST).any() for t in rows) and len(start.P) == STATES and (tilted or not aiding[True]):
        time = np.concatenate(rows)
        start = restarted(begun, start, np.quantile(time[time <= start.time + LONGEST], PARTS))
    return plan if start is plan.start else replace(plan, start=start)


def restarted(run: Callable[[Start, bool, float | None], Track], start: Start, ends: Iterable[float]) -> Start:
    """The start that the log shows, as sure as the log leaves it; the same one where it is likelier as it began.

    Parameters
    ----------
    run : callable
        The log from a start, with gates or, to be smoothed once that is asked for, without; the whole of it or up to a time, s.
    start : Start
        Of fifteen errors.
    ends : iterable of float, s
        Of parts of the log, the shortest first, which are gone through where the whole leads too far away.
    """
    spread = _factor(start.P)
    try:
        found = _likeliest(run, start, spread, np.zeros(STATES), None)
        if not found.near:
            off = np.zeros(STATES)
            for until in (*ends, None):
                found = _likeliest(run, start, spread, off, until)
                off = found.off
        shown = replace(start.with_errors(-found.off), P=_narrowed(spread, found.left))
        anew, usual = (bounded_misfit(run(one, True, None).residuals) for one in (shown, start))
    except DataError:  # the filter broke down
        return start
    return shown if anew + _square(np.linalg.pinv(spread) @ found.off) < usual else start


def _likeliest(
    run: Callable[[Start, bool, float | None], Track], start: Start, spread: Array, first: Array, until: float | None
) -> _Found:
    """By passes over a log up to a time, the first of them from a start without the errors `first`."""
    back = np.linalg.pinv(spread)
    best, off, step, near, left = math.inf, first, np.zeros(STATES), True, np.eye(spread.shape[1])
    for _ in range(MOST):
        cost, track = math.inf, None
        try:
            track = run(start.with_errors(-(off + step)), False, until)
            cost = bounded_misfit(track.residuals) + _square(back @ (off + step))
        except DataError:  # the filter broke down
            if best == math.inf:
                raise
        if track is None or not cost < best:
            step = 0.5 * step
            continue
        settled, best, off = cost > best - ENOUGH, cost, off + step
        smoothed = track.whole()
        shown, P = _off(start, smoothed)
        left = back @ P @ back.T
        # The prior of that run is about its own start, not about the one that was given.
        part = back @ shown - left @ back @ off
        far = float(np.linalg.norm(part))
        near = near and far <= FARTHEST
        step = spread @ part * min(1.0, FARTHEST / max(far, 1e-300)) - off
        if settled:
            break
    return _Found(off, left, near)


def _off(start: Start, track: Track) -> tuple[Array, Array]:
    """(15,) errors of the start, were the track's beginning true, and (15, 15) the covariance of that."""
    place = np.array([[start.lat, start.lon, start.alt]])
    begun = Track.of_motion(np.array([start.time]), start.C_nb[None], start.v_n[None], place)
    J = np.eye(STATES, track.layout.states)
    if start.whole is not None:  # its biases hold the slow ones
        for of, name in ((BG, SLOW_GYRO), (BA, SLOW_ACCEL)):
            if (slow := track.layout.slice_of(name)) is not None:
                J[of, slow] = np.eye(3)
    assumed = np.concatenate([start.gyro_bias, start.accel_bias])
    shown = (J @ track.sensors[0])[BG.start :] - assumed
    return np.concatenate([begun.errors_against(track, slice(0, 1))[0], shown]), J @ track.P[0] @ J.T


def _factor(P: Array) -> Array:
    """(15, r) whose product with its transpose is a covariance, of those combinations of errors that are not known."""
    scale = np.sqrt(np.maximum(np.diag(P), 0.0))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, ways = np.linalg.eigh(P / np.outer(safe, safe))
    open_ = values > ROUNDING
    return np.asarray(scale[:, None] * ways[:, open_] * np.sqrt(values[open_]))


def _square(part: Array) -> float:
    return float(part @ part)


def _narrowed(spread: Array, left: Array) -> Array:
    """(15, 15) the start's covariance, and of combinations of which the log leaves less, by parts of it, `WIDER` times that."""
    values, ways = np.linalg.eigh(left)
    part = spread @ ways * np.minimum(1.0, WIDER * np.sqrt(np.maximum(values, 0.0)))
    return np.asarray(part @ part.T)
