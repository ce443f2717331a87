"""Do the accelerometers warm up? Three biases that move together, as ``1 - exp(-t / T)``, and which log that fits.

Rivals whose biases walk (:mod:`truenorth.estimate.rivals`) may take any course, and pay for it: three axes that warm up together
have one time, and their three sizes are all that is asked for. The ratio of the sizes that fit best, by the filter's own
response to them (:mod:`truenorth.estimate.responses`), is a chi-square of three degrees of freedom where nothing warms up. Two
times stand for all: what the innovations of a drive keep of times between them, and up to twice as long or as short, is .9
correlated with theirs at least. One of N that has the probability p by chance is as rare as a likelihood ratio of
``-2 ln(N p)`` (Markov's inequality): that is what is said.

Gyros that warm up are found by walks already: heading shows what they do. The course is that of a body that one heat capacity and
one resistance describe (Newton's law of cooling), with biases that are linear in its temperature; the test is ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.chi_square import tail
from truenorth.core.errors import DataError
from truenorth.estimate.responses import likeliest, signatures_of
from truenorth.estimate.rivals import Rival, likelihood_ratio, moved
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

TIMES = (0.1, 0.4)  # of the log
STEP = 1e-2  # sigmas of a bias, with which a pass asks: so small that no gate decides otherwise
MOST = 100.0  # sigmas of a bias, about, that one changes by
LEAST_CHANCE = 1e-300


def warming_rivals(run: Callable[[ImuRecord], Track], first: Track, record: ImuRecord, spec: ImuSpec) -> list[Rival]:
    """Accelerometers that warm up and are likelier than chance: none, or one, with what it moves the answer by.

    Parameters
    ----------
    run : callable
        The same log with another record.
    first : track
        Of the record as it is.
    record : ImuRecord
    spec : ImuSpec
        Its biases are the measure of sizes.
    """
    sigma = math.sqrt(float(spec.bias_variance[3]))
    if not sigma > 0.0:
        return []
    found: tuple[float, Array, float] = (0.0, np.zeros(3), 0.0)
    for time in (part * record.duration for part in TIMES):
        try:
            passes = [run(without_warming(record, STEP * sigma * axis, time)).residuals for axis in np.eye(3)]
        except DataError:  # the filter broke down: no explanation
            continue
        ratio, size = likeliest(signatures_of(first.residuals, passes, STEP), precision=MOST**-2)
        found = max(found, (ratio, size * sigma, time), key=lambda item: item[0])
    ratio, size, time = found
    if _as_rare(ratio) <= limit("rival"):
        return []
    try:
        without = run(without_warming(record, size, time))
    except DataError:
        return []
    # Responses hold for gains that stay as they are. Where a change moves the gains, it has to be shown by the whole of it.
    shown = likelihood_ratio(first.residuals, without.residuals, one_model=True, whitened=True)
    as_rare = _as_rare(min(ratio, shown))
    if as_rare <= limit("rival"):
        return []
    effect = moved(first, without)
    figures = {"size": float(np.abs(size).max()), "time": time}
    return [Rival(as_rare, "rival.accels_warm_up", figures, effect)]


def _as_rare(ratio: float) -> float:
    """The likelihood ratio that is as rare by chance as the largest of those of `TIMES`."""
    return -2.0 * math.log(min(1.0, len(TIMES) * tail(ratio, 3) + LEAST_CHANCE))


def without_warming(record: ImuRecord, size: Array, time: float) -> ImuRecord:
    """The record of accelerometers that do not warm up by `size` (3,) m/s^2, within a time (s) that divides what is left by e."""
    course = -np.expm1(-(record.time - record.time[0]) / time)
    scale = record.steps[:, None] if record.kind == "increments" else 1.0
    return replace(record, accel=record.accel - scale * np.outer(course, size))
