"""Whether the heights of a receiver step while its vertical velocity does not: another datum, geoid or reference from there on.

Heights less the way of the vertical velocity scatter about a line. Where the means of some rows before and after one moment differ
by far more than such means do elsewhere in the log, that moment is asked about: the filter itself says how it would follow a step
from there (:mod:`truenorth.estimate.responses`), with each of the slow errors left out that innovations have shown, too, since such
an error takes a step up. A step is a hint: what the answer was off by anywhere on the way, if it is one, is in sigma.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); signatures by passes of the filter are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.estimate.responses import likeliest_of
from truenorth.estimate.rivals import effect_along
from truenorth.records import GnssRecord
from truenorth.state.evidence import Evidence, Figure
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

STEP = 1e-3  # m, with which a pass asks: so small that no gate decides otherwise
SIDE = 20  # rows before and after a moment
FEWEST = 4  # times the rows of both sides, to know how such means differ without a step
STANDS_OUT = 6.0  # times the usual size: no more moments are worth a pass
LEAST = 1.0  # m


def height_step_evidence(
    run: Callable[[GnssRecord], Track],
    first: Track,
    receiver: GnssRecord,
    without: Sequence[Callable[[GnssRecord], Track]] = (),
) -> list[Evidence]:
    """The step of a receiver's heights against its velocities, where it is likelier than chance.

    Parameters
    ----------
    run : callable
        The same filter with another record of the receiver.
    first : track
        With the record as it is.
    receiver : GnssRecord
    without : sequence of callable
        As `run`, each without one of the slow errors that the innovations have shown.

    Returns
    -------
    list of Evidence
        None, or one.
    """
    suspect = likely_step(receiver)
    if suspect is None:
        return []
    onset, shown = suspect
    before = partial(_before_step, onset)
    try:
        ratio, size = likeliest_of((run, *without), first, receiver, before, STEP)
        if ratio <= 2.0 * math.log(len(receiver) / limit("step")):
            return []
        # Of a step whose rows the gates reject the innovations show a part alone.
        size = max(size, shown, key=abs) if size * shown > 0.0 else size
        effect = effect_along(first, run(before(receiver, size)))
    except DataError:  # the filter broke down: no explanation
        return []
    figures: dict[str, Figure] = {"size": size, "time": onset, "ratio": ratio}
    return [Evidence("gnss.height_steps", figures, "hint", effect)]


def likely_step(receiver: GnssRecord) -> tuple[float, float] | None:
    """The time (s) from which the heights may be others, and by how much (m), to a metre or two; None: no moment stands out."""
    if receiver.v_n is None:
        return None
    there = np.isfinite(receiver.alt) & np.isfinite(receiver.v_n[:, 2])
    time, height, climb = receiver.time[there], receiver.alt[there], receiver.v_n[there, 2]
    if len(time) < 2 * FEWEST * SIDE:
        return None
    way = np.concatenate([[0.0], np.cumsum(0.5 * (climb[1:] + climb[:-1]) * np.diff(time))])
    sums = np.concatenate([[0.0], np.cumsum(height - way)])
    means = (sums[SIDE:] - sums[:-SIDE]) / SIDE
    steps = means[SIDE:] - means[:-SIDE]  # at rows SIDE .. N - SIDE
    steps -= np.median(steps)
    largest = int(np.argmax(np.abs(steps)))
    usual = 1.4826 * float(np.median(np.abs(steps)))
    if abs(steps[largest]) < max(LEAST, STANDS_OUT * usual):
        return None
    return float(time[SIDE + largest]), float(steps[largest])


def _before_step(onset: float, receiver: GnssRecord, size: float) -> GnssRecord:
    """The receiver as it would be without heights that are larger by `size` (m) from a moment on."""
    return replace(receiver, alt=receiver.alt - size * (receiver.time >= onset))
