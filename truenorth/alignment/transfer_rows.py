"""What each row of a master said against the prediction, by its stamp.

Velocities that a filter made late hold before the attitude that has the same stamp, and are epochs of the loop of their own. A row
is both.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.master import MASTER_ATTITUDE, MASTER_VELOCITY
from truenorth.estimate.memory import ABSENT, REJECTED, REOPENED, USED
from truenorth.state.track import RESIDUALS, Residuals, Track

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

TRANSLATION, ATTITUDE = 0, 1  # kinds of rows, and three columns each of the innovations


class MasterRows(NamedTuple):
    """What each row of the master said against the prediction; the rows are the epochs of the track."""

    stamp: Array  # (K,) s: its time less the delay that is assumed
    innovation: Array  # (K, 6): velocity (m/s; or position, acceleration) and attitude (rad); NaN where absent
    sigma: Array  # (K, 6)
    nis: Array  # (K, 2)
    verdict: Integers  # (K, 2): `ABSENT`, `USED`, `REJECTED` or `REOPENED`, of :mod:`truenorth.estimate.memory`


def by_rows(track: Track) -> MasterRows:
    """The residuals of a track of :func:`truenorth.alignment.transfer_filter.transfer_filter`, row by row of the master."""
    stamps = np.unique(np.concatenate([r.stamp for r in track.residuals]))
    count = len(stamps)
    assert count == len(track)  # each row is put out once
    innovation, sigma = np.full((2, count, 6), np.nan)
    nis, verdict = np.full((count, 2), np.nan), np.full((count, 2), ABSENT)
    for r in track.residuals:
        kind = ATTITUDE if r.name == MASTER_ATTITUDE.name else TRANSLATION
        at = np.searchsorted(stamps, r.stamp)
        columns = slice(3 * kind, 3 * kind + 3)
        innovation[at, columns], sigma[at, columns], nis[at, kind] = r.innovation, r.sigma, r.nis
        verdict[at, kind] = np.where(r.jumped, REOPENED, np.where(r.used, USED, REJECTED))
    return MasterRows(stamps, innovation, sigma, nis, verdict)


def stamped_as_the_master(track: Track, stamps: Array, late: float) -> Track:
    """A track whose velocities have the stamps of their rows (M,), not those so much (`late`, s) before.

    Attitudes put rows out. Velocities near the ends of a log whose attitude falls beyond it are in no epoch, and are left out.
    """
    attitude = [r.stamp for r in track.residuals if r.name == MASTER_ATTITUDE.name]
    if late == 0.0 or not attitude:
        return track

    def of_rows(r: Residuals) -> Residuals:
        if r.name != MASTER_VELOCITY.name:
            return r
        own = stamps[np.searchsorted(stamps - late, r.stamp)]
        kept = np.isin(own, attitude[0])
        r = replace(r, stamp=own)
        return replace(r, **{name: getattr(r, name)[kept] for name in RESIDUALS})

    return replace(track, residuals=tuple(of_rows(r) for r in track.residuals))
