"""Does a level accelerometer of a base that sways read too much? Its scale factor, against a push in step with the tilt.

A scale factor ``k`` of an axis acts on all of the force along it: gravity, as the base tilts, and what the lever arm feels. The
mean of that is a tilt of the answer (the arm's centripetal part along the axis, gravity's where the base heels), and none of it is
seen by a filter whose base may move: to first order the rest is a force in step with the tilt, as waves make one that carry a ship
to and fro while they roll her. The filter's own response finds scale factors of .2 to .8 on sound ships and buoys, with likelihood
ratios up to 370.

So both compete. With its accelerometer put right the log is aligned anew, its motion fitted anew. Of a true scale factor nothing
goes with the tilt any more then: the motion that was left is the base's own, and the log is likelier by thousands. Of a push, which
has its own phase, frequencies and directions, most is left. Asked is what any push in step would explain of the log that is put
right, ``K = K0 + K1 jw + K2 (jw)^2`` along and across, as of :mod:`truenorth.quality.pushed`. Of 16 logs with a scale factor it was
.3 to 5 % of what this explains, of 13 sound ships and buoys half of it and more.

In a sea that pushes a base as much as a scale factor would, the two are one, and nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SENSORS, seen_of
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import innovations_of, whitened
from truenorth.core.attitude import misalignment
from truenorth.errors.staying import BA, BG, PHI
from truenorth.filters.gains import through
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

ROUNDS = 4  # of alignments anew: the response of a log that is far off is linear in a part of the scale factor only
LARGEST = 0.5  # of a correction in one round
FAST = 0.5  # rad of phase from row to row, at which an angle comes out 2 % too small


class _Response(NamedTuple):
    """Of an accelerometer's scale factor, as the filter shows it."""

    axis: int
    ratio: float  # twice the logarithm of the likelihood ratio
    size: float  # of the error, by the force as measured
    sigma: float
    moved: Array  # (3,) rad: misalignment that it leaves


def scale_on_sway_evidence(
    fine: FineAlignment, record: ImuRecord, anew: Callable[[ImuRecord], FineAlignment]
) -> list[Evidence]:
    """The accelerometer whose scale factor explains a swaying log better than any motion of its base, with what it does.

    Parameters
    ----------
    fine : FineAlignment
        With the base's motion fitted.
    record : ImuRecord
        Of which it is.
    anew : callable
        Aligns another record about the same attitude, a motion of the same kind fitted anew: a base that does not swing on lines
        would else be likelier by its swing, not by its accelerometer.
    """
    if _hardly_sampled(record):
        return []
    sigma = np.sqrt(np.diag(fine.P)[PHI])
    shown = [item for item in _responses(fine) if not may_be_chance(item.ratio)]
    shown = [item for item in shown if np.any(np.abs(item.moved) > limit("negligible") * sigma)]
    if not shown:
        return []
    first = last = max(shown, key=lambda item: item.ratio)
    best, scale, factor = fine, first, 1.0
    for _ in range(ROUNDS):
        factor *= 1.0 - min(max(last.size, -LARGEST), LARGEST)
        right = record.accel.copy()
        right[:, first.axis] *= factor
        other = anew(replace(record, accel=right))
        last = _responses(other)[first.axis]
        if _likelihood(other) > _likelihood(best):
            best, scale = other, last._replace(size=1.0 / factor - 1.0)
        if may_be_chance(last.ratio):
            break
    gained = _likelihood(best) - _likelihood(fine)
    if may_be_chance(gained) or _in_step(best) > limit("pushed in step") * gained:
        return []
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, best))))
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    figures: dict[str, Figure] = {
        "axis": "xyz"[scale.axis],
        "scale": scale.size,
        "sigma": scale.sigma,
        "ratio": gained,
        "heading": effect.heading,
        "level": effect.level,
    }
    return [Evidence("bias.accel_scale", figures, "bounded", effect, ("specification", "units"))]


def _hardly_sampled(record: ImuRecord) -> bool:
    """Whether the base turns to and fro so fast that from row to row the angle is not a sum of rates: it comes out too small."""
    turned = increments(record)[0]
    turned = turned - turned.mean(axis=0)
    return bool(np.sum(np.diff(turned, axis=0) ** 2) > FAST**2 * np.sum(turned**2))


def _likelihood(fine: FineAlignment) -> float:
    """Twice its logarithm."""
    return 2.0 * float(fine.estimates.log_likelihood)


def _responses(fine: FineAlignment) -> list[_Response]:
    """Of each axis. The force is as measured: its mean along an axis, of which no bias is free, tilts the answer."""
    log = fine.integrals
    force = np.einsum("kji,kj->ki", log.C_mean, log.mean_force)
    errors = np.zeros((len(force), SENSORS.stop - SENSORS.start, 3))
    accelerometers = slice(BA.start - BG.start, None)
    errors[:, accelerometers] = force[:, :, None] * np.eye(3)
    made, left, seen = _through(fine, seen_of(fine, errors))
    match, energy = made.T @ seen, np.maximum(np.sum(made**2, axis=0), 1e-300)
    size = match / energy
    return [
        _Response(axis, float(match[axis] * size[axis]), float(size[axis]), float(energy[axis] ** -0.5), moved)
        for axis, moved in enumerate((size * left[PHI]).T)
    ]


def _in_step(fine: FineAlignment) -> float:
    """Squares of the white innovations that a push in step with the tilt explains, along each axis of the base and across."""
    made, _, seen = _through(fine, seen_of(fine, _pushes(fine)))
    Q = np.linalg.qr(made)[0]
    return float(np.sum((Q.T @ seen) ** 2))


def _pushes(fine: FineAlignment) -> Array:
    """(K, 6, 18) forces in the IMU's axes that go with the tilt of two of its axes, its rate and its acceleration."""
    log = fine.integrals
    T = log.intervals[:, None]
    C = fine.C_n0_i @ log.C_mean
    up = C[:, 2]  # of n0, along the IMU's axes
    one, other = np.argsort(np.abs(up.mean(axis=0)))[:2]  # those that are the most level
    tilt = up[:, [one, other]] - up[:, [one, other]].mean(axis=0)
    rate = np.gradient(tilt, axis=0) / T
    acceleration = np.gradient(rate, axis=0) / T
    along = C[:, :, one] * [1.0, 1.0, 0.0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    level = np.broadcast_to([0.0, 0.0, 1.0], along.shape)
    ways = along, np.cross(level, along), level
    forces = [moved[:, [j]] * way for moved in (tilt, rate, acceleration) for j in (0, 1) for way in ways]
    errors = np.zeros((len(C), SENSORS.stop - SENSORS.start, len(forces)))
    errors[:, BA.start - BG.start :] = np.swapaxes(C, 1, 2) @ np.stack(forces, axis=2)
    return errors


def _through(fine: FineAlignment, signatures: Array) -> tuple[Array, Array, Array]:
    """White innovations (3 K, S) that signatures make, what they leave of the last state (n, S), and those of the log (3 K,)."""
    seen = innovations_of(fine)
    made, left = through(fine.gains, np.ascontiguousarray(signatures))
    return whitened(seen.L, made).reshape(-1, made.shape[2]), left, seen.white[:, :, 0].ravel()
