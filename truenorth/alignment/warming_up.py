"""Do the accelerometers of a base that sways warm up? Three biases that move together, as ``1 - exp(-t / T)``.

Signatures of one axis (:mod:`truenorth.alignment.bias_step`) see the vertical accelerometer warm up, and say what that does:
nothing. The level ones, which warm up with it, tilt gravity as slowly as the earth turns a wrong heading, and hide behind it. So
all three are one cause with one time: what the vertical axis shows says how large the changes of the others may be. Their sizes
are normal with one sigma, which is the likeliest (empirical Bayes); what the log says of the level ones, and what it leaves open,
is in the effect.

The ratio of the sizes that fit best is a chi-square of three degrees of freedom where nothing warms up. One of N times that has the
probability p by chance is as rare as a likelihood ratio of ``-2 ln(N p)`` (Markov's inequality). Innovations that are coloured
carry so much less (:mod:`truenorth.quality.colour`). Nothing is said where a single axis, or a base that leaves, explains the log
better.

The course is that of a body that one heat capacity and one resistance describe (Newton's law of cooling), with biases that are
linear in its temperature; see :mod:`truenorth.estimate.warming`, which asks the same on the move. The test is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SENSORS, seen_of
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Innovations, whitened
from truenorth.analysis.chi_square import tail
from truenorth.errors.staying import BA, BG, PHI
from truenorth.filters.gains import through
from truenorth.quality.colour import colour_of
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

TIMES = (0.1, 0.2, 0.4, 0.8)  # of the log
PASSES = 20  # of the likeliest sigma of the sizes
LEAST_CHANCE = 1e-300


class _Warmed(NamedTuple):
    """Accelerometers that warm up within one time."""

    ratio: float  # twice the logarithm of the likelihood ratio of the sizes that fit best
    as_white: float  # the same, as rare in coloured innovations
    time: float  # of the log
    size: Array  # (3,) m/s^2
    square: Array  # (3,) rad^2: of the misalignment that they leave, mean of what the log allows


def warming_evidence(fine: FineAlignment, seen: Innovations, rival: float) -> list[Evidence]:
    """Accelerometers that warm up together, if that is likelier than chance, with what it does to the answer.

    Parameters
    ----------
    fine : FineAlignment
    seen : Innovations
        Its own; what other errors explain of them is theirs.
    rival : float
        Twice the logarithm of the likelihood ratio of the best other cause, with the same innovations, taken for white.
    """
    found = _warmed(fine, seen)
    best = max(found, key=lambda item: item.as_white)
    as_rare = -2.0 * math.log(min(1.0, len(TIMES) * tail(best.as_white, 3) + LEAST_CHANCE))
    if as_rare <= limit("rival") or rival - best.ratio > limit("ruled out"):
        return []
    # A log does not say which time it was where several fit: what each does counts as much as it is likely.
    weight = np.exp(0.5 * np.array([item.as_white - best.as_white for item in found]))
    moved = np.sqrt(weight @ np.array([item.square for item in found]) / weight.sum())
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    figures: dict[str, Figure] = {
        "size": float(np.abs(best.size).max()),
        "time": best.time * float(fine.integrals.time[-1]),
        "ratio": as_rare,
        "chance": limit("rival"),
        "heading": effect.heading,
        "level": effect.level,
    }
    kind: Kind = "hint" if may_be_chance(as_rare) else "bounded"
    return [Evidence("rival.accels_warm_up", figures, kind, effect, ("still_part",))]


def _warmed(fine: FineAlignment, seen: Innovations) -> list[_Warmed]:
    """Of each time."""
    count = len(seen.white)
    part = (np.arange(count) + 0.5) / count
    errors = np.zeros((count, SENSORS.stop - SENSORS.start, 3 * len(TIMES)))
    for k, time in enumerate(TIMES):
        errors[:, BA.start - BG.start :, 3 * k : 3 * k + 3] = -np.expm1(-part / time)[:, None, None] * np.eye(3)
    made, left = through(fine.gains, seen_of(fine, errors))
    columns = whitened(seen.L, made).reshape(-1, made.shape[2])
    nu, others = seen.white[:, :, 0].reshape(-1, 1), seen.white[:, :, 1:].reshape(len(columns), -1)
    if others.shape[1]:
        inner = np.eye(others.shape[1]) + others.T @ others
        columns, nu = (x - others @ np.linalg.solve(inner, others.T @ x) for x in (columns, nu))
    parts = (slice(3 * k, 3 * k + 3) for k in range(len(TIMES)))
    return [
        _fitted(time, columns[:, own], nu[:, 0], left[PHI, own], seen.white.shape[:2])
        for time, own in zip(TIMES, parts, strict=True)
    ]


def _fitted(time: float, s: Array, nu: Array, left: Array, shape: tuple[int, ...]) -> _Warmed:
    """Of signatures (N, 3) of size one, that leave the misalignments (3, 3), in white innovations (N,) of this shape."""
    A, b = s.T @ s, s.T @ nu
    best = np.linalg.solve(A, b)
    ratio = float(b @ best)
    colour = colour_of((nu - s @ best).reshape(shape), (s @ best).reshape(shape))
    A, b = A / colour.growth, b / colour.growth
    variance = float(best @ best)  # of a size; from above, where it is not known
    for _ in range(PASSES):
        P = np.linalg.inv(A + np.eye(3) / variance)
        size = P @ b
        variance = float(size @ size + np.trace(P)) / 3.0
    square = (left @ size) ** 2 + np.einsum("ij,jk,ik->i", left, P, left)
    return _Warmed(ratio, colour.ratio(ratio), time, size, square)
