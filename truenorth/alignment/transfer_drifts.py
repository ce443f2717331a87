"""Is the master as it was said to be? The same log once more with a heading that drifts, or a delay that is hardly known.

Gravity holds a master's level; nothing holds its heading while it goes straight at a steady speed, and its gyros carry it away. A
slave shows that twice: its own gyros do not turn as the master's attitudes do, and where velocity is matched, the heading in
which the vehicle accelerates is another one. A filter to which the master's heading is fixed takes the first for a gyro's bias
and the second for a velocity, a delay or a mounting, each with its full confidence.

The rival is the model with a heading error of the master that is a Gauss-Markov process (:class:`truenorth.errors.MasterErrors`)
of so many times what was said, and is estimated. A slave whose gyros are poorer than specified drifts apart from its master too:
such rivals are compared with this one (:mod:`truenorth.estimate.rivals`), and the likeliest gives its name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from truenorth.alignment.transfer_filter import TRANSLATIONS, Assumed
from truenorth.core.errors import DataError
from truenorth.errors.master import ATTITUDE_ERROR, DELAY, TransferModel
from truenorth.estimate.rivals import Rival, effect_of, likelihood_ratio
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit
from truenorth.state.track import Track

# rad, of what the heading drifts by within the correlation time of the master's errors: 0.03, 0.2 and 1.2 deg/h in 300 s
LADDER = tuple(math.radians(drift / 60.0) for drift in (1.0, 6.0, 36.0))


def drifting_rivals(run: Callable[[float], Track], first: Track, model: TransferModel) -> list[Rival]:
    """Drifts of the master's heading that the log fits better than chance explains; none where no row bears its attitude.

    Parameters
    ----------
    run : callable
        The same log of a master whose heading drifts by so much, rad, and which is otherwise as it was said to be; its errors are
        estimated.
    first : Track
        Of the model itself, the master's errors estimated.
    model : TransferModel
    """
    found, before = [], 0.0
    said = model.master.attitude_drifts[2]
    for drift in LADDER:
        try:
            other = run(math.hypot(said, drift))
        except DataError:  # the filter broke down: no explanation
            break
        if other.layout.slice_of(ATTITUDE_ERROR) is None:
            break
        ratio = likelihood_ratio(first.residuals, other.residuals, whitened=True)
        if ratio > limit("rival"):
            found.append(
                Rival(
                    ratio,
                    "rival.master_heading",
                    {"size": _drifted(other)},
                    effect_of(first, other),
                    suspect="master_drift",
                )
            )
        elif ratio < before - limit("ruled out"):
            break
        before = max(ratio, before)
    return found


def _drifted(track: Track) -> float:
    """By how much the heading error of a master changes on the way, rad: after the first tenth, in which its constant is found."""
    at = track.layout.slice_of(ATTITUDE_ERROR)
    assert at is not None
    return float(np.ptp(track.sensors[len(track) // 10 :, at][:, 2]))


def delay_evidence(first: Track, free: Track, said: Assumed, others: Sequence[Evidence]) -> list[Evidence]:
    """That the delay of the master's stamps is not what was said: a delay that is hardly known fits better, far away from that.

    A delay that is said to be known to milliseconds is held there by a log of a minute or of a few rows, and what it does to the
    innovations is within their noise row by row. Their likelihood shows it. Where a translation is matched, it speaks: attitudes do
    not part late gyros from an early master. Where attitude is matched alone, a late master turns late, and its noise, which is
    read from the innovations, holds that. A heading that drifts seems to explain a part of it, and is the better cause if it is
    likelier.

    Parameters
    ----------
    first, free : Track
        With the delay as well known as was said, and hardly known.
    said : Assumed
    others : sequence of Evidence
        What else would explain the log.
    """
    at = free.layout.slice_of(DELAY)
    if at is None:
        return []
    by_translation = [tuple(r for r in track.residuals if r.name in TRANSLATIONS) for track in (first, free)]
    alone = not by_translation[0]
    shown = (first.residuals, free.residuals) if alone else by_translation
    if likelihood_ratio(*shown) <= limit("rival"):
        return []
    drifts = [float(item.figures["ratio"]) for item in others if alone and item.key == "rival.master_heading"]
    if drifts and max(drifts) > likelihood_ratio(*shown, whitened=True):  # as drifts are weighed
        return []
    miss = abs(float(free.sensors[-1, at][0]))
    if miss <= limit("mounting") * said.delay_sigma:
        return []
    remedies = ("slave_axes", "transfer.delay")
    return [contradiction("transfer.delay", *remedies, miss=miss, prior=said.delay_sigma)]
