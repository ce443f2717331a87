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
from truenorth.records import MasterRecord
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
    stamps = _stamps(track)
    count, order = len(stamps), np.argsort(stamps)
    assert count == len(track)  # each row is put out once
    innovation, sigma = np.full((2, count, 6), np.nan)
    nis, verdict = np.full((count, 2), np.nan), np.full((count, 2), ABSENT)
    for r in track.residuals:
        kind = ATTITUDE if r.name == MASTER_ATTITUDE.name else TRANSLATION
        at = order[np.searchsorted(stamps, r.stamp, sorter=order)]
        columns = slice(3 * kind, 3 * kind + 3)
        innovation[at, columns], sigma[at, columns], nis[at, kind] = r.innovation, r.sigma, r.nis
        verdict[at, kind] = np.where(r.jumped, REOPENED, np.where(r.used, USED, REJECTED))
    return MasterRows(stamps, innovation, sigma, nis, verdict)


def _stamps(track: Track) -> Array:
    """(K,) s, of the epochs of a track: a row's attitude puts it out, its translation where it has none."""
    attitude = [r for r in track.residuals if r.name == MASTER_ATTITUDE.name]
    known = np.concatenate([np.zeros(0), *(r.stamp for r in attitude)])
    putting = [(r.time, r.stamp) for r in attitude]
    for r in track.residuals:
        if r.name != MASTER_ATTITUDE.name:
            alone = ~np.isin(r.stamp, known)
            putting.append((r.time[alone], r.stamp[alone]))
    time, stamp = (np.concatenate(parts) for parts in zip(*putting, strict=True))
    return np.asarray(stamp[np.argsort(time, kind="stable")])


def stamped_as_the_master(track: Track, master: MasterRecord, stamps: Array, late: float) -> Track:
    """A track whose velocities have the stamps of their rows, not those so much (`late`, s) before.

    Velocities near the ends of a log whose attitude falls beyond it have no epoch of their own, and are left out.
    """
    if late == 0.0:
        return track
    attitude = [r.stamp for r in track.residuals if r.name == MASTER_ATTITUDE.name]

    def of_rows(r: Residuals) -> Residuals:
        if r.name != MASTER_VELOCITY.name:
            return r
        row = np.searchsorted(stamps - late, r.stamp)
        kept = np.ones(len(row), dtype=bool)
        if attitude and master.C_nb is not None:
            kept = np.isin(stamps[row], attitude[0]) | np.isnan(master.C_nb[row]).any(axis=(1, 2))
        r = replace(r, stamp=stamps[row])
        return replace(r, **{name: getattr(r, name)[kept] for name in RESIDUALS})

    return replace(track, residuals=tuple(of_rows(r) for r in track.residuals))
