"""Does a level accelerometer of a base that sways read too much? Its scale factor, against a push in step with the tilt.

A scale factor ``k`` of an axis acts on all of the force along it: gravity, as the base tilts, and what the lever arm feels. The
mean of that is a tilt of the answer (the arm's centripetal part along the axis, gravity's where the base heels), and none of it is
seen by a filter whose base may move: to first order the rest is a force in step with the tilt, as waves make one that carry a ship
to and fro while they roll her. The filter's own response finds scale factors of .2 to .8 on sound ships and buoys, with likelihood
ratios up to 370.

So both compete (:mod:`~truenorth.alignment.put_right`). Of 16 logs with a scale factor a push explained .3 to 5 % of what that does
once it was put right, of 13 sound ships and buoys half of it and more.

In a sea that pushes a base as much as a scale factor would, the two are one, and nothing is said.

A motion of many tones, as of a mast in gusts, is fitted by two lines on each axis, and fitted anew it may be likelier by itself:
by up to 1.2 an epoch in 60 sound logs of masts, where true scale factors of 1 to 27 % gained 5 and more. Less than `SURE` is a
hint: what it would do is in sigma, and no log is refused for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SENSORS, seen_of
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.put_right import hardly_sampled, in_step, likelihood, through_filter
from truenorth.core.attitude import misalignment
from truenorth.errors.staying import BA, BG, PHI
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

ROUNDS = 4  # of alignments anew: the response of a log that is far off is linear in a part of the scale factor only
LARGEST = 0.5  # of a correction in one round
SURE = 3.0  # of twice the logarithm of the likelihood ratio, an epoch


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
        Of :func:`truenorth.alignment.put_right.aligned_anew`.
    """
    if hardly_sampled(record):
        return []
    sigma = np.sqrt(np.diag(fine.P)[PHI])
    shown = [item for item in _responses(fine) if not may_be_chance(item.ratio)]
    shown = [item for item in shown if np.any(np.abs(item.moved) > limit("negligible") * sigma)]
    if not shown:
        return []
    first = last = max(shown, key=lambda item: item.ratio)
    best, scale, factor, put_right = fine, first, 1.0, 1.0
    for _ in range(ROUNDS):
        factor *= 1.0 - min(max(last.size, -LARGEST), LARGEST)
        right = record.accel.copy()
        right[:, first.axis] *= factor
        other = anew(replace(record, accel=right))
        last = _responses(other)[first.axis]
        if _as_measured(other, factor) > _as_measured(best, put_right):
            best, put_right, scale = other, factor, last._replace(size=1.0 / factor - 1.0)
        if may_be_chance(last.ratio):
            break
    gained = _as_measured(best, put_right) - likelihood(fine)
    if may_be_chance(gained) or in_step(best) > limit("pushed in step") * gained:
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
    if gained > SURE * len(fine.integrals.intervals):
        return [Evidence("bias.accel_scale", figures, "bounded", effect, ("specification", "units"))]
    return [Evidence("bias.accel_may_scale", figures, "hint", effect, ("record_calmer",))]


def _as_measured(fine: FineAlignment, factor: float) -> float:
    """Twice the logarithm of the likelihood of the force as measured, of which one axis was put right by a factor.

    A density of numbers that are ``factor`` times as large is larger by that for each. Without it a level axis that is put right to
    nothing would be the likeliest: no motion is left that it could contradict.
    """
    return likelihood(fine) + 2.0 * len(fine.integrals.intervals) * math.log(factor)


def _responses(fine: FineAlignment) -> list[_Response]:
    """Of each axis. The force is as measured: its mean along an axis, of which no bias is free, tilts the answer."""
    log = fine.integrals
    force = np.einsum("kji,kj->ki", log.C_mean, log.mean_force)
    errors = np.zeros((len(force), SENSORS.stop - SENSORS.start, 3))
    accelerometers = slice(BA.start - BG.start, None)
    errors[:, accelerometers] = force[:, :, None] * np.eye(3)
    made, left, seen = through_filter(fine, seen_of(fine, errors))
    match, energy = made.T @ seen, np.maximum(np.sum(made**2, axis=0), 1e-300)
    size = match / energy
    return [
        _Response(axis, float(match[axis] * size[axis]), float(size[axis]), float(energy[axis] ** -0.5), moved)
        for axis, moved in enumerate((size * left[PHI]).T)
    ]
