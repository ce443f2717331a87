"""Whether a receiver is led away, by how the filter itself would follow it: the exact form of `truenorth/quality/led_away.py`.

The same log with a receiver whose velocity steps at a moment, and whose place moves on with it: what that adds to the innovations
of all sources is the signature ``s`` of a step of 1 m/s, east and north. Twice the logarithm of the likelihood ratio of the step
that fits best is ``b^T A^-1 b``, ``A = sum s^T s``, ``b = sum s^T z``: a chi-square of two degrees of freedom where nothing steps.
It is asked for where a simpler signature leaves doubt, and compared with the chance of all moments.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in linear
systems", IEEE Trans. Autom. Control 21 (1976); signatures by passes of the filter are ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.estimate.responses import Seen, likeliest, signatures_of
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.quality.led_away import (
    BEGINS,
    LARGE,
    USUAL,
    doubtful_onsets,
    larger_than_chance,
    led_away_evidence,
    led_by,
)
from truenorth.records import GnssRecord
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

STEP = 1e-3  # m/s, with which a pass asks: so small that no gate decides otherwise
ROWS = 12  # earlier and later than a simpler signature finds it: the likeliest is asked for itself
MOMENTS = 60  # at which a step is tried to see what is usual
EARLIER = 1e-3  # s, by which a step begins before the row that shows it


def led_by_evidence(
    run: Callable[[GnssRecord], Track],
    first: Track,
    receiver: GnssRecord,
    without: Sequence[Callable[[GnssRecord], Track]] = (),
) -> list[Evidence]:
    """The step of a receiver's velocity that is likelier than chance, by the filter's own response to it.

    A step makes the errors of a receiver seem to last: where innovations have shown a slow error, a step without it is a rival.

    Parameters
    ----------
    run : callable
        The same filter with another record of the receiver.
    first : track
        With the record as it is.
    receiver : GnssRecord
        On the clock that `run` takes it on.
    without : sequence of callable
        As `run`, each without one of the slow errors that the innovations have shown.

    Returns
    -------
    list of Evidence
        None, or one.
    """
    if receiver.v_n is None or any(led_away_evidence(source) for source in first.residuals):
        return []
    found = _led(run, first, receiver, 0.0)
    for less in without:
        try:
            track = less(receiver)
        except DataError:  # the filter broke down: no explanation
            continue
        found += _led(less, track, receiver, likelihood_ratio(first.residuals, track.residuals))
    return sorted(found, key=lambda item: -float(item.figures["ratio"]))[:1]


def _led(run: Callable[[GnssRecord], Track], track: Track, receiver: GnssRecord, before: float) -> list[Evidence]:
    """Steps that are likelier than chance; `before`: twice the logarithm of the likelihood ratio of this filter without one."""
    found = []
    for source in track.residuals:
        chance = 2.0 * math.log(max(len(source.time), 2) / limit("step"))
        asked: list[int] = []
        for onset in doubtful_onsets(source):
            row = int(np.searchsorted(source.time, onset))
            if any(abs(row - other) <= ROWS for other in asked):
                continue
            asked.append(row)
            try:
                ratio, step, at = _asked(run, track.residuals, receiver, source, onset)
            except DataError:
                continue
            if ratio + min(before, 0.0) > chance:
                found.append(led_by(source.name, step, at, float(source.time[-1]), ratio, chance))
    return found


def _asked(
    run: Callable[[GnssRecord], Track],
    first: Sequence[Residuals],
    receiver: GnssRecord,
    source: Residuals,
    onset: float,
) -> tuple[float, Array, float]:
    """Ratio and size (2,) of the likeliest step near a moment, and its own moment.

    A response begun some rows earlier is the same response that much earlier, nearly: the likeliest is then asked for itself.
    """

    def signatures(moment: float) -> list[Seen]:
        return signatures_of(first, [run(_stepped(receiver, moment, axis)).residuals for axis in (0, 1)], STEP)

    seen = signatures(onset)
    row = int(np.searchsorted(source.time, onset))
    near = source.time[max(row - ROWS, 0) : row + ROWS + 1]
    tried = [likeliest([item.begun(float(moment) - onset) for item in seen])[0] for moment in near]
    best = float(near[int(np.argmax(tried))])
    seen = seen if best == onset else signatures(best)
    ratio, step = likeliest(seen)
    return ratio / _usual(seen, step, best, source), step, best


def _usual(seen: Sequence[Seen], step: Array, onset: float, source: Residuals) -> float:
    """How much larger ratios at other moments, and squares, are than of white innovations, once the step is gone; 1 at least.

    Of a receiver that is off in every turn many are, and a step counts by how far it stands out.
    """
    left = [item._replace(z=item.z - item.s @ step) for item in seen]
    moments = source.time[BEGINS :: max(1, len(source.time) // MOMENTS)]
    ratios = np.array([likeliest([item.begun(float(moment) - onset) for item in left])[0] for moment in moments])
    squares = [larger_than_chance(np.sum(item.z[:, :2] ** 2, axis=1), LARGE) for item in left if item.z.shape[1] > 1]
    return max(1.0, larger_than_chance(ratios, USUAL), *squares)


def _stepped(receiver: GnssRecord, onset: float, axis: int) -> GnssRecord:
    """The receiver as it would be without a step of STEP, east (0) or north (1), from a moment on."""
    since = receiver.time - (onset - EARLIER)
    away = -STEP * np.maximum(since, 0.0)
    R_M, R_N = radii(receiver.lat)
    lat, lon = receiver.lat, receiver.lon
    if axis == 0:
        lon = lon + away / ((R_N + np.nan_to_num(receiver.alt)) * np.cos(lat))
    else:
        lat = lat + away / (R_M + np.nan_to_num(receiver.alt))
    assert receiver.v_n is not None
    velocity = receiver.v_n - STEP * np.outer(since >= 0.0, np.eye(3)[axis])
    return replace(receiver, lat=lat, lon=lon, v_n=velocity)
