"""Slow errors of fixes too small for innovations to show, and large enough to be in a smoothed velocity.

Of velocity, fixes say what they say of the way in some ten seconds to minutes. A slow error of size s that lasts for T is, over
less than ``2 pi T``, a random walk of the density ``s sqrt(2 / T)``: a smoother follows it, and as of white fixes it says that the
velocity so found is right. A filter knows velocity by the last seconds alone, and hardly suffers.

The test for colour (:mod:`truenorth.quality.slow_aids`) asks for a share of what is left in innovations. In logs of 200 s with
fixes each second it found no slow error up to nine tenths of the white noise. The likelihood of the whole log is a sharper one,
and still a tenth to a third of the white noise may be hidden of white fixes. So no decision is made. All sizes up to the last of
`SIZES` are alike likely beforehand, and the log is smoothed once more with the mean of ``s^2`` by the likelihood of each. White
noise is what differences of innovations show; the time is the usual one, since of another one it is ``s^2 / T`` that counts.

By that, the square of the answer's error is the variance of the second smoother and the square of what the two differ by. The
answer itself is that of white fixes, whose last epoch is the filter's, and it is never less sure than the filter's.

The rule is ours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid, Gnss
from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.estimate.slow_fit import bounded_misfit, lasting_of
from truenorth.navigation.plan import Plan
from truenorth.navigation.under_way import COARSE, PART
from truenorth.quality.aid_noise import LEAST_SQUARE, white_part
from truenorth.quality.slow_aids import FIXES, USUAL_TIME, Lasting
from truenorth.state.layout import DV
from truenorth.state.track import Track

Array = NDArray[np.float64]

SIZES = np.array([0.01, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5])  # of slow errors, in parts of the white noise
BETWEEN = 301  # sizes, of which the likelihood is taken along straight lines


def smoothed_as_unsure(plan: Plan, given: Mapping[str, Aid], track: Track) -> Track:
    """The track smoothed, with its velocity as unsure as fixes leave it that may hide a slow error.

    Parameters
    ----------
    plan : Plan
    given : mapping
        Aids by their keys.
    track : Track
        Of the plan, before it is smoothed: its innovations show the white noise, and what it says of velocity is not exceeded.
    """
    whole, slow = track.whole(), _hidden(plan, given, track)
    if not slow:
        return whole
    other = replace(plan, slow={**plan.slow, **slow})
    try:
        unsure = other.run(other.sources(given), smooth=True).whole()
    except DataError:  # the filter broke down
        return whole
    P, at = whole.P.copy(), np.arange(DV.start, DV.stop)
    square = unsure.P[:, at, at] + whole.errors_against(unsure)[:, DV] ** 2
    P[:, at, at] = np.maximum(P[:, at, at], np.minimum(square, track.P[:, at, at]))
    return replace(whole, P=P)


def _hidden(plan: Plan, given: Mapping[str, Aid], track: Track) -> dict[str, Lasting]:
    """The slow error that fixes may hide; none where they have one, or one was given."""
    receiver = given.get(Gnss.key)
    said = isinstance(receiver, Gnss) and receiver.mounting is not None and receiver.mounting.bias_sigma is not None
    fixes = next((source for source in plan.sources(given) if source.name == FIXES), None)
    if fixes is None or said or "bias" in fixes.states:
        return {}
    white = _white(track, fixes)
    part = plan.record.between(None, plan.record.time[0] + PART)
    short = replace(plan, record=part, interval=max(plan.interval, COARSE), every=len(part))

    def of(size: float) -> dict[str, Lasting]:
        return {FIXES: lasting_of(fixes, white, size * white, USUAL_TIME)}

    def misfit(size: float) -> float:
        other = replace(short, slow={**plan.slow, **of(size)})
        return bounded_misfit(other.run(other.sources(given)).residuals)

    try:
        return of(mean_size(np.array([misfit(size) for size in SIZES])))
    except DataError:  # the filter broke down
        return {}


def mean_size(misfits: Array) -> float:
    """Root of the mean square of sizes that are alike likely beforehand, by minus twice the log-likelihood of each of `SIZES`."""
    size = np.linspace(0.0, SIZES[-1], BETWEEN)
    likely = np.exp(-0.5 * np.interp(size, SIZES, misfits - misfits.min()))
    return math.sqrt(float(size**2 @ likely / likely.sum()))


def _white(track: Track, fixes: Aiding) -> float:
    """White noise of fixes in parts of what they say; all of that where they are too few to show it."""
    heights = np.isfinite(fixes.measured[:, 2]).any()
    found = white_part(track, fixes, slice(0, 3 if heights else 2))
    return 1.0 if found is None else math.sqrt(max(found[0], LEAST_SQUARE))
