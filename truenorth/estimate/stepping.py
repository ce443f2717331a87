"""Does the bias of one gyro step on the way? By the filter's own response to a step of each axis at moments all along the log.

Where the earth's rate tells heading, a gyro whose bias steps by 2 deg/h turns it by degrees, or is taken for a slow error of the
wheel. Biases that walk (:mod:`truenorth.estimate.rivals`) may take any course, and pay for it: a step has one axis, one moment and
one size. The ratio of the size that fits best, by the filter's own response to it (:mod:`truenorth.estimate.responses`), is a
chi-square of one degree of freedom where nothing steps. Six moments stand for all, and near the likeliest two more are asked for:
what the innovations of a drive keep of a step in between is .9 correlated with one of theirs at least, but for the last tenth of a
log. One of N looks that has the probability p by chance is as rare as a likelihood ratio of ``-2 ln(N p)`` (Markov's inequality):
that is what is said. Below the limit of a rival nothing is: a look that fits by chance may have any size and effect.

A slow error that was taken from the innovations may be the step itself. So it is looked for without each of them, too; by how much
the log is against the sensor without that error is taken off the ratio.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); signatures by passes of the filter, and the moments, are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.chi_square import tail
from truenorth.core.errors import DataError
from truenorth.estimate.responses import likeliest, signatures_of
from truenorth.estimate.rivals import Rival, likelihood_ratio, moved
from truenorth.estimate.warming import LEAST_CHANCE
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Figure
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

ONSETS = (0.1, 0.25, 0.4, 0.55, 0.7, 0.85)  # of the log
NEXT = 0.075  # of the log, before and after the likeliest of these
STEP = 1e-2  # sigmas of a bias, with which a pass asks: so small that no gate decides otherwise


class _Look(NamedTuple):
    """A step of one gyro's bias, and twice the logarithm of its likelihood ratio."""

    ratio: float
    axis: int
    onset: float  # of the log
    size: float  # rad/s


def stepping_rivals(
    runs: Sequence[Callable[[ImuRecord], Track]], first: Track, record: ImuRecord, spec: ImuSpec
) -> list[Rival]:
    """A gyro whose bias steps: none, or one, with what it moves the answer by, where chance does not give as much to every log.

    Parameters
    ----------
    runs : sequence of callable
        The same log with another record; then the same, each without one of the slow errors that the innovations have shown.
    first : track
        Of the first of these, with the record as it is.
    record : ImuRecord
    spec : ImuSpec
        Its biases are the measure of the step that a pass asks with.
    """
    sigma = math.sqrt(float(spec.bias_variance[0]))
    if not sigma > 0.0:
        return []
    found = []
    for run in runs:
        try:
            track = first if run is runs[0] else run(record)
        except DataError:  # the filter broke down: no explanation
            continue
        before = min(likelihood_ratio(first.residuals, track.residuals), 0.0)
        looks = _looks(run, track, record, STEP * sigma)
        if looks:
            best = max(looks)
            found.append((best.ratio + before, best, run, len(looks)))
    if not found:
        return []
    ratio, best, run, count = max(found, key=lambda item: item[0])
    as_rare = -2.0 * math.log(min(1.0, count * len(runs) * tail(ratio, 1) + LEAST_CHANCE))
    if as_rare <= limit("rival"):
        return []
    try:
        effect = moved(first, run(without_step(record, best)))
    except DataError:
        return []
    # Its size is one of 1/sqrt(ratio) of it, one sigma, and what it does is as unsure.
    effect = effect.times(math.hypot(1.0, 1.0 / math.sqrt(best.ratio)))
    figures: dict[str, Figure] = {
        "axis": "xyz"[best.axis],
        "onset": best.onset * record.duration,
        "size": abs(best.size),
    }
    return [Rival(as_rare, "rival.gyro_steps", figures, effect)]


def without_step(record: ImuRecord, step: _Look) -> ImuRecord:
    """The record of a gyro whose bias does not step."""
    later = record.time > record.time[0] + step.onset * record.duration
    gyro = record.gyro.copy()
    gyro[later, step.axis] -= step.size * (record.steps[later] if record.kind == "increments" else 1.0)
    return replace(record, gyro=gyro)


def _looks(run: Callable[[ImuRecord], Track], track: Track, record: ImuRecord, step: float) -> list[_Look]:
    """Steps of each gyro at all moments, then nearer to the likeliest."""

    def look(axis: int, onset: float) -> list[_Look]:
        try:
            other = run(without_step(record, _Look(0.0, axis, onset, step)))
        except DataError:  # the filter broke down: no explanation
            return []
        ratio, size = likeliest(signatures_of(track.residuals, [other.residuals], step))
        return [_Look(ratio, axis, onset, float(size[0]) if size.size else 0.0)]

    looks = [item for onset, axis in product(ONSETS, range(3)) for item in look(axis, onset)]
    if looks:
        best = max(looks)
        looks += [item for by in (-NEXT, NEXT) for item in look(best.axis, best.onset + by)]
    return looks
