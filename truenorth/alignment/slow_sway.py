"""Is a slow sway one at all? A base that leaves, and a bias that changes, look like it.

The fit of the base's motion may take up what begins within the log as an oscillator that goes round a few times, or is
damped within one period; then innovations show nothing any more. So the log is filtered again with such oscillators made
smaller, and what is left is matched with signatures of what may begin: a velocity that is taken up within some seconds and
stays, drifts, biases that step or grow. Twice the logarithm of the likelihood ratio against the motion as fitted decides; a
cause that the log does not rule out moves the answer by what is added to sigma.

The comparison is ours; the ratios are those of :mod:`truenorth.alignment.matched`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import bias_signatures, seen_of
from truenorth.alignment.drift import AXES, ONSETS, drift_signatures
from truenorth.alignment.drift import KINDS as COURSES
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Innovations, innovations_of, matched, whitened
from truenorth.core.compiled import compiled
from truenorth.errors.staying import PHI
from truenorth.errors.sway import AxisMotion, Oscillator, motion_first
from truenorth.filters import Estimates, LinearSystem, kalman
from truenorth.filters.gains import through
from truenorth.quality.colour import colour_of
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

FEW = 6.0  # periods in a log, of which fewer are no oscillation that anybody has seen repeat itself
BROAD = 0.2  # damping: wind waves have up to .26 by Fossen (sec. 8.2.6), swell less
SMALLER = (1.0, 0.3, 0.1, 0.0)  # times its size
PARTS = 32  # of a log: onsets of a departure, refined about the best by quarters
BIASES = [(course, k / PARTS) for course in COURSES for k in range(1, PARTS)]
TAKES = (0.25, 1.0, 2.0, 4.0)  # parts, within which a departure takes up its velocity


class Cause(NamedTuple):
    """What may have begun."""

    cost: float  # minus twice the logarithm of its likelihood
    key: str
    axis: str
    onset: float  # s, since the beginning of the log
    size: float  # m/s of a velocity, rad/s or m/s^2 of a bias
    phi: Array  # (3,) rad: misalignment at the last epoch, if it did
    seen: Array  # (K, 3): what it makes of the measurements


def is_slow(item: Oscillator, duration: float) -> bool:
    """Whether a log of that length, s, does not show that an oscillator goes to and fro."""
    return item.frequency * duration / (2.0 * math.pi) < FEW or item.damping > BROAD


def slow_sway_evidence(
    fine: FineAlignment,
    full: Callable[[], LinearSystem],
    motion: Sequence[AxisMotion],
    without: Callable[[Array], tuple[float, Array]],
) -> list[Evidence]:
    """What else may have made the slow part of a base's motion, and what it would do to the answer.

    Parameters
    ----------
    fine : SwayAlignment
    full : callable
        Gives the system of its last pass, with all its noise.
    motion : three AxisMotion
        Along E, N, U; in the last states of that system.
    without : callable
        What is left if so much (K, 3) is taken off the measurements, and the motion fitted anew: minus twice the logarithm of the
        likelihood, and the misalignment (3,) at the last epoch.
    """
    duration = float(fine.integrals.time[-1])
    if not any(is_slow(item, duration) for axis in motion[:2] for item in axis.oscillators):
        return []
    system, as_fitted = full(), fine.estimates
    lowest = -2.0 * float(as_fitted.log_likelihood)
    found = []
    for share in SMALLER:
        other = _with(fine, system if share == 1.0 else _smaller(system, motion, duration, share), share == 1.0)
        lowest = min(lowest, -2.0 * float(other.estimates.log_likelihood))
        # With the motion as fitted chance finds something in every log: there the usual limit decides.
        found += [(limit("drift") if share == 1.0 else -limit("ruled out"), cause) for cause in causes(other)]
    # Oscillators that were fitted along with what began are not what is left without it.
    for kind in {_kind(cause) for _, cause in found}:
        likeliest = min((cause for _, cause in found if _kind(cause) == kind), key=lambda cause: cause.cost)
        cost, phi = without(likeliest.seen)
        found.append((limit("drift"), likeliest._replace(cost=cost, phi=phi)))
    end, sigma = as_fitted.x[-1][PHI], np.sqrt(np.diag(as_fitted.P[-1])[PHI])
    likely = [cause for least, cause in found if lowest - cause.cost > least]
    # With nothing off they may fit better, too. That lowers all ratios: what is nothing with higher ones is nothing.
    if _is_nothing(likely, lowest, end, sigma):
        return []
    lowest = min(lowest, without(np.zeros_like(system.z))[0])
    likely = [cause for least, cause in found if lowest - cause.cost > least]
    if not likely:
        return []
    seen = innovations_of(fine)
    ratio, best = max(
        ((_weighed(fine, seen, cause, lowest - cause.cost), cause) for cause in likely), key=lambda pair: pair[0]
    )
    moved = np.array([cause.phi for cause in likely]) - end
    heading, level = float(np.abs(moved[:, 2]).max()), float(np.hypot(moved[:, 0], moved[:, 1]).max())
    figures: dict[str, Figure] = {
        "axis": best.axis,
        "onset": best.onset,
        "ratio": ratio,
        "chance": limit("drift"),
        "heading": heading,
        "level": level,
        ("velocity" if best.key.startswith("drift") else "size"): abs(best.size),
    }
    effect = Effect(heading, level)
    if may_be_chance(ratio):
        if _negligible(moved, sigma):
            return []  # what nobody can rule out, and changes nothing
        return [Evidence("sway.slow", figures, "hint", effect, ("record_longer",))]
    return [Evidence(best.key, figures, "bounded", effect, ("still_part",))]


def _is_nothing(likely: Sequence[Cause], lowest: float, end: Array, sigma: Array) -> bool:
    """Whether chance gives all that is likely, and none of it moves the answer (3,) at the end."""
    return all(may_be_chance(lowest - cause.cost) and _negligible(cause.phi - end, sigma) for cause in likely)


def _negligible(moved: Array, sigma: Array) -> bool:
    return bool(np.all(np.abs(moved) < limit("negligible") * sigma))


def _weighed(fine: FineAlignment, seen: Innovations, cause: Cause, ratio: float) -> float:
    """A ratio by the colour of the innovations, as what the cause makes of them sees it."""
    if may_be_chance(ratio):
        return ratio
    nu, signature = seen.white[:, :, 0], whitened(seen.L, through(fine.gains, cause.seen[..., None])[0])[:, :, 0]
    size = float(np.sum(nu * signature) / np.sum(signature**2))  # the motion as fitted has taken up a part
    return colour_of(nu - size * signature, signature).ratio(ratio)


def _with(fine: FineAlignment, system: LinearSystem, filtered: bool) -> FineAlignment:
    """The log by a system with less of a motion, or as it was filtered; without states that nothing moves."""
    system, estimates = _of_moved_states(system, fine.estimates if filtered else kalman(system, history="full"))
    return fine.filtered_by(system, estimates)


def _of_moved_states(system: LinearSystem, estimates: Estimates) -> tuple[LinearSystem, Estimates]:
    """Without states of the base's motion that are zero throughout: what follows takes a part of the time, to the same bits."""
    first = motion_first(system.states, 0)
    variances = np.diagonal(estimates.P, axis1=1, axis2=2)[:, first:]
    at = np.concatenate([np.arange(first), first + np.flatnonzero(variances.any(axis=0))])

    def of(a: Array) -> Array:
        return np.ascontiguousarray(a[..., at])

    def block(a: Array) -> Array:
        return np.ascontiguousarray(a[..., at[:, None], at])

    arrays = {name: block(getattr(system, name)) for name in ("Phi", "Q", "P0")}
    arrays |= {name: of(getattr(system, name)) for name in ("H", "x0")}
    S = None if system.S is None else np.ascontiguousarray(system.S[..., at, :])
    kept = replace(estimates, x=of(estimates.x), sigma=of(estimates.sigma), P=block(estimates.P))
    return system.with_made(**arrays, S=S), kept


def _kind(cause: Cause) -> str:
    return "bias" if cause.key.startswith("bias") else cause.key


def _smaller(system: LinearSystem, motion: Sequence[AxisMotion], duration: float, share: float) -> LinearSystem:
    """The system with the slow oscillators of its base so many times as large."""
    Q, P0 = system.Q.copy(), system.P0.copy()
    for axis, item in enumerate(motion):
        at = motion_first(system.states, axis)
        for part in item.oscillators:
            states = slice(at, at + part.states)
            if is_slow(part, duration):
                Q[:, states, states] *= share**2
                P0[states, states] *= share**2
            at += part.states
    return system.with_made(Q=Q, P0=P0)


def causes(fine: FineAlignment) -> Iterator[Cause]:
    """The best of each bank, by a filter of which all innovations are at hand."""
    seen = innovations_of(fine)
    cost, end = -2.0 * float(fine.estimates.log_likelihood), fine.estimates.x[-1][PHI]
    duration = float(fine.integrals.time[-1])
    drift, bias = matched(seen, drift_signatures(fine), bias_signatures(fine, BIASES))
    t = fine.integrals.time
    middle = 0.5 * (t[1:] + t[:-1])

    def course_of(course: str, onset: float) -> Array:
        """(K,) a step, or a ramp to one at the end, from so many seconds on."""
        return np.where(middle > onset, 1.0 if course == "step" else (middle - onset) / (duration - onset), 0.0)

    k = int(np.argmax(drift.ratio))
    (part_of, course, axis) = [(o, c, a) for o in ONSETS for c in COURSES for a in AXES][k]
    size, onset = float(drift.size[k]), part_of * duration
    velocity = np.outer(course_of(course, onset), [float(axis == name) for name in (*AXES, "up")])
    made = size * (velocity if fine.form == "velocity" else np.diff(velocity, axis=0, prepend=0.0))
    phi = end - size * drift.left[PHI, k]
    yield Cause(cost - float(drift.ratio[k]), f"drift.{course}", axis, onset, size, phi, made)
    k = int(np.argmax(bias.ratio))
    (course, part_of), size = BIASES[k // 6], float(bias.size[k])
    key = "bias.gyro_steps" if k % 6 < 3 else "bias.accel_steps"
    of_sensors = np.outer(course_of(course, part_of * duration), np.eye(6)[k % 6])[..., None]
    made = size * seen_of(fine, of_sensors)[..., 0]
    phi = end - size * bias.left[PHI, k]
    yield Cause(cost - float(bias.ratio[k]), key, "xyz"[k % 3], part_of * duration, size, phi, made)
    part = duration / PARTS
    coarse = _departure(fine, seen, [part * k for k in range(1, PARTS)])
    around = [coarse.onset + 0.25 * part * k for k in range(-3, 4)]
    fine_onset = _departure(fine, seen, [onset for onset in around if 0.0 < onset < duration])
    yield min(coarse, fine_onset, key=lambda cause: cause.cost)


def _departure(fine: FineAlignment, seen: Innovations, onsets: Sequence[float]) -> Cause:
    """The best of departures that begin then: a level velocity is taken up smoothly, and stays."""
    made, when = _taken_up(fine, onsets)
    through_filter, left = through(fine.gains, made)
    energy, match = np.zeros((len(when), 2, 2)), np.zeros((len(when), 2))
    _match_pairs(seen.L, seen.white, through_filter, energy, match)
    size = np.linalg.solve(energy + 1e-300 * np.eye(2), match[..., None])[..., 0]
    ratio = np.sum(size * match, axis=1)
    best = int(np.argmax(ratio))
    v = size[best]
    phi = fine.estimates.x[-1][PHI] - left[PHI].reshape(3, len(when), 2)[:, best] @ v
    cost = -2.0 * float(fine.estimates.log_likelihood) - float(ratio[best])
    axis_name = AXES[int(np.argmax(np.abs(v)))]
    seen_of_it = made[:, :, 2 * best : 2 * best + 2] @ v
    return Cause(cost, "drift.step", axis_name, when[best][0], float(np.hypot(*v)), phi, seen_of_it)


def _taken_up(fine: FineAlignment, onsets: Sequence[float]) -> tuple[Array, list[tuple[float, float]]]:
    """Signatures (K, 3, 2 W) of departures, east and north in turn, and onset and length of each, s."""
    t, duration = fine.integrals.time, float(fine.integrals.time[-1])
    middle = 0.5 * (t[1:] + t[:-1])
    when = [(onset, take * duration / PARTS) for onset in onsets for take in TAKES]
    onset, take = np.array(when).T
    s = np.minimum(np.maximum((middle[:, None] - onset) / take, 0.0), 1.0)
    v = s**2 * (3.0 - 2.0 * s)
    made = np.zeros((len(middle), 3, 2 * len(when)))
    for axis in (0, 1):
        made[:, axis, axis::2] = v if fine.form == "velocity" else np.diff(v, axis=0, prepend=0.0)
    return made, when


@compiled
def _match_pairs(L: Any, white: Any, y: Any, energy: Any, match: Any) -> None:
    """Energies (W, 2, 2) of W pairs in y (K, m, 2 W), made white, and their matches (W, 2) with the innovations."""
    m, count = y.shape[1], len(energy)
    row, known = np.empty((m, y.shape[2])), np.empty(y.shape[2])
    for k in range(len(y)):
        for i in range(m):
            for j in range(y.shape[2]):
                known[j] = 0.0
            for r in range(i):
                for j in range(y.shape[2]):
                    known[j] += L[k, i, r] * row[r, j]
            for j in range(y.shape[2]):
                row[i, j] = (y[k, i, j] - known[j]) / L[k, i, i]
            for w in range(count):
                east, north = row[i, 2 * w], row[i, 2 * w + 1]
                energy[w, 0, 0] += east * east
                energy[w, 0, 1] += east * north
                energy[w, 1, 1] += north * north
                match[w, 0] += east * white[k, i, 0]
                match[w, 1] += north * white[k, i, 0]
    for w in range(count):
        energy[w, 1, 0] = energy[w, 0, 1]
