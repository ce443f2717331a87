"""Is one gyro of a base that sways, or of an IMU that turns on it, later than the two others? By the filter's own response to it.

Of gyros that are late together gravity is askew by the rate times the delay (:mod:`truenorth.alignment.late_gyros`). Where one
alone is late, turns about two axes no longer belong together as well: a base that rolls and turns comes out tilted by half the
product of both, which no bias and no common delay makes. So the gyro about the vertical shows itself, too, about which gravity says
nothing. Navigation grade gyros on a base that sways by some degrees show .1 ms of it.

Twice the logarithm of the likelihood ratio of each gyro's own delay is a chi-square of one degree of freedom where clocks agree. It
has to exceed that of a delay of all three by the limit of a drift, which chance passes once in a million. Then the gyro is put
right and the log aligned anew, its motion fitted anew. Waves that push a ship in step with her tilt look like a delay of a gyro as
well, by 40 to 70: of what the gyro put right explains they leave most (:mod:`truenorth.alignment.put_right`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.late_gyros import STEP, turned_by
from truenorth.alignment.matched import innovations_of
from truenorth.alignment.put_right import Anew, in_step, likelihood
from truenorth.alignment.swaying import SwayAlignment
from truenorth.core.attitude import misalignment
from truenorth.estimate.responses import Seen, likeliest
from truenorth.records import ImuRecord
from truenorth.records.interpolation import held_at_ends
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit

Array = NDArray[np.float64]

ROUNDS = 3  # of a gyro put right, by what the filter of the round before shows: the response is that of a small delay
LONGEST = 0.2  # s: later than that is no filter of a gyro, and no row or some


class _Late(NamedTuple):
    """The gyro whose delay (s) explains a log best, and by how much better than a delay of all three."""

    axis: int
    delay: float
    ratio: float


def late_gyro_evidence(fine: SwayAlignment, record: ImuRecord, anew: Anew) -> list[Evidence]:
    """A gyro that is later than the two others, with what that does.

    Parameters
    ----------
    fine : SwayAlignment
        With the base's motion fitted.
    record : ImuRecord
        Of which it is.
    anew : callable
        Of :func:`truenorth.alignment.put_right.aligned_anew`.
    """
    first = _latest(fine)
    if first.ratio <= limit("drift"):
        return []
    delay, best = 0.0, fine
    found = first
    for _ in range(ROUNDS):
        if found.axis != first.axis or abs(delay + found.delay) > LONGEST:
            break
        tried = anew(one_behind(record, first.axis, -(delay + found.delay)))
        if likelihood(tried) <= likelihood(best):
            break
        delay, best = delay + found.delay, tried
        found = _latest(best)
        if found.ratio <= limit("drift"):
            break
    gained = likelihood(best) - likelihood(fine)
    pushed = in_step(best)
    if gained <= limit("drift") or pushed > limit("may be pushed") * gained:
        return []
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, best))))
    turned = turned_by(delay, _alone(record, first.axis))
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1]))).joined(turned)
    figures: dict[str, Figure] = {
        "axis": "xyz"[first.axis],
        "delay": delay,
        "ratio": gained,
        "chance": limit("drift"),
        "heading": effect.heading,
        "level": effect.level,
    }
    kind: Kind = "hint" if pushed > limit("pushed in step") * gained else "bounded"
    return [Evidence("response.gyro_late", figures, kind, effect, ("common_clock",))]


def one_behind(record: ImuRecord, axis: int, late: float) -> ImuRecord:
    """The record with one gyro late by so many seconds, parts of a row too."""
    gyro = record.gyro.copy()
    gyro[:, [axis]] = held_at_ends(record.time, gyro[:, [axis]], record.time - late)
    return replace(record, gyro=gyro)


def _alone(record: ImuRecord, axis: int) -> ImuRecord:
    """The record with the other gyros at rest."""
    return replace(record, gyro=record.gyro * np.eye(3)[axis])


def _latest(fine: SwayAlignment) -> _Late:
    log, z = fine.about, fine.system.z
    later = [log.with_record(one_behind(log.record, axis, STEP)).linearise().z for axis in range(3)]
    responses = (np.stack(later, axis=2) - z[..., None]) / STEP
    white = innovations_of(fine, np.concatenate([responses, responses.sum(axis=2, keepdims=True)], axis=2)).white
    *alone, (together, _) = (
        likeliest([Seen(fine.integrals.time[1:], white[..., 0], white[..., [i]])]) for i in range(1, 5)
    )
    axis = int(np.argmax([ratio for ratio, _ in alone]))
    ratio, size = alone[axis]
    return _Late(axis, float(size[0]), ratio - together)
