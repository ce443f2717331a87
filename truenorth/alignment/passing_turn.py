"""A base at rest that is turned slowly for a while and then rests as before: a turret, a ship in her dock, a tripod that is nudged.

To gyros a slow turn is a rate like a bias, and no force shows it where it goes about the vertical. What tells it from a change of
bias is that it passes: the rate is before and after what it is most of the time. Its seconds say nothing of the rate at rest; the
attitude is carried through them like through any other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.coarse.analytic import BLOCKS, Means, means, scatter_of
from truenorth.core.earth import EARTH_RATE
from truenorth.core.remembered import remembered
from truenorth.quality.regimes import MotionSummary
from truenorth.quality.signals import median_of_rows
from truenorth.records import ImuRecord
from truenorth.records.vibration import cone_drift

FAR = 6.0  # sigma of a second's mean rate: chance is that far in one of 1e9 seconds
SHARED = 0.5 * EARTH_RATE  # rad/s: by turns of up to 30 deg the axes share the earth's rate anew
EDGE = 1  # s before and after, in which a turn begins and ends
REST = 5  # s of rest, at least, before and after it
MOSTLY = 0.5  # of the seconds, at most: a median is that of the rest


@remembered
def passing_turns(motion: MotionSummary) -> NDArray[np.bool_]:
    """Seconds (m,) of a still base in which it turns, and after which it rests as before.

    A base that people shake is another matter: it tilts in a second and may come back in many. The noise of a second's mean is
    that of neighbours, of which most are alike.
    """
    rate = motion.rate
    none = np.zeros(len(rate), dtype=np.bool_)
    rests = motion.overall in ("still", "disturbed") and motion.still_fraction > 1.0 - MOSTLY
    if not rests or len(rate) < 2 * REST + 1:
        return none
    if np.ptp(rate, axis=0).max() <= SHARED:  # no second is that far from the median
        return none
    noise = median_of_rows(np.abs(rate[1:] - rate[:-1]).T)[:, 0] / 0.6745 / np.sqrt(2.0)
    turns = np.any(np.abs(rate - median_of_rows(rate.T)[:, 0]) > SHARED + FAR * noise, axis=1)
    if not turns.any() or turns.mean() > MOSTLY:
        return none
    turns = np.convolve(turns, np.ones(2 * EDGE + 1), "same") > 0.0
    return turns if not (turns[:REST].any() or turns[-REST:].any()) else none


def means_at_rest(record: ImuRecord, motion: MotionSummary) -> Means:
    """Means of a record, the rate without the seconds in which a still base turns for a while."""
    found, turns = means(record), passing_turns(motion)
    if not turns.any():
        return found
    rest = motion.rate[~turns] + motion.rate_bias
    blocks = np.stack([part.mean(axis=0) for part in np.array_split(rest, min(BLOCKS, len(rest)))])
    return replace(found, w_ib_b=rest.mean(axis=0) + cone_drift(record), w_covariance=scatter_of(blocks) / len(blocks))
