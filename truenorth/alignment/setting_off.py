"""A base that rests, and turns at one end of its log: a table that goes on turning, or a vehicle that sets off or stops.

Both begin alike. A table turns its IMU about an axis: an arm, scale factors and misalignments explain what the accelerometers see,
and the turn shows their biases. A vehicle turns as it is pushed, and nothing of the sensors explains the push; fitted all the same,
it made an accelerometer's bias of 37 mg, and a level that was 32 sigmas off. One has to see the base rest again, or turn for some
seconds, to tell the two apart. So the seconds from where the base sets off are left out of the fit, the gyros carry the attitude
through them, and they are asked whether they fit what the rest has shown: where they do, the base is a table. A log that begins as
its vehicle stops is the same backwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import whitened
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.filters import Estimates, kalman
from truenorth.navigation.departure import departure
from truenorth.quality.regimes import KINDS, SEEN_LATE, TURN_RATE, MotionSummary, motion_summary
from truenorth.quality.signals import median_of_rows
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence, contradiction, note

Array = NDArray[np.float64]

AGAIN = 5  # s of rest that show where a turn has led to
EDGE = 1.0  # s before a turn is seen, in which it begins
SOONER = 30.0  # s, at the most, by which a push begins before the turn
RESTS = 60.0  # s before that, in which a departure is looked for
AT_REST = 5.0  # s of rest, at least, that show a level
UNKNOWN = 100.0  # m/s, one sigma: of a base that sets off
TABLE = 0.01  # m/s: by which a table shakes what it turns
FEWEST, FIRST = 8, 20  # epochs of a turn that tell a table, and of how many the first are asked
LAST = 5  # epochs at the end that are held against chance
BY_CHANCE = 1e-6


class Away(NamedTuple):
    """A part of a log, at one of its ends, in which a base that rests otherwise goes or turns; s, on the record's clock."""

    begin: float
    end: float
    first: float  # of its turn, ...
    last: float  # ... and the last


def stays_in(edges: Array, away: Sequence[Away]) -> NDArray[np.bool_]:
    """(K,) whether intervals between edges (K+1,) reach into no part in which the base goes away."""
    stays = np.ones(len(edges) - 1, dtype=np.bool_)
    for part in away:
        stays &= (edges[1:] <= part.begin) | (edges[:-1] >= part.end)
    return stays


def goes_away(record: ImuRecord) -> tuple[Away, ...]:
    """The end and the beginning of a log, where the base turns in them and rests behind, or before."""
    begin, end = float(record.time[0] - record.interval), float(record.time[-1])
    edges = np.append(begin, record.time)
    back = replace(record, time=begin + end - edges[-2::-1], gyro=-record.gyro[::-1], accel=record.accel[::-1])
    off, stops = _sets_off(record), _sets_off(back)
    found = [] if off is None else [Away(off[0], math.inf, off[1], end)]
    if stops is not None and (off is None or begin + end - stops[0] < off[0] - AT_REST):
        found.append(Away(-math.inf, begin + end - stops[0], begin, begin + end - stops[1]))
    return tuple(found)


def _sets_off(record: ImuRecord) -> tuple[float, float] | None:
    """When a base that rested sets off, and from when on it turns till the end; None where it does not, or rests again."""
    motion = motion_summary(record)
    # A cheap gyro's bias looks like a turn: what is the rate of most seconds, or is slower, is no setting off.
    most, least = median_of_rows(motion.rate.T)[:, 0], TURN_RATE + 5.0 * float(np.linalg.norm(motion.angle_noise))
    faster = np.linalg.norm(motion.rate, axis=1) > np.linalg.norm(most)
    turns = np.flatnonzero(faster & (np.linalg.norm(motion.rate - most, axis=1) > least))
    if not len(turns) or len(motion.kind) - turns[-1] > AGAIN:
        return None
    pauses = np.flatnonzero(np.diff(turns) > AGAIN)
    first = int(turns[pauses[-1] + 1] if len(pauses) else turns[0])
    seen = float(motion.time[first]) - 1.0
    begins = float(motion.time[_moves_before(motion, first)]) - 1.0 - EDGE
    pushed = departure(record.between(begins - SOONER - RESTS, None))
    if pushed is not None and np.isfinite(pushed.unseen):
        begins = min(begins, max(pushed.time, begins - SOONER))
    return (begins, seen) if begins > record.time[0] - record.interval + AT_REST else None


def _moves_before(motion: MotionSummary, first: int) -> int:
    """The first second of motion that goes over into a turn, whose first second is given."""
    moves = motion.kind == KINDS.index("moving")
    if motion.still_fraction > 0.5:  # else people or an engine shake it
        moves |= motion.kind == KINDS.index("disturbed")
    while first > 0 and moves[first - 1]:
        first -= 1
    return first


def fits_a_table(fine: FineAlignment, away: Away) -> bool:
    """Whether a part left out of a fit is what this foretells as of an IMU that a table turns, by the innovations."""
    edges = fine.integrals.start + fine.integrals.time
    turns = np.flatnonzero((edges[:-1] >= away.first) & (edges[1:] <= away.last))
    if len(turns) < FEWEST:
        return False
    # What a log begins with its filter believes: the rest behind tells whether it should.
    rows = (
        turns[:FIRST]
        if math.isinf(away.end)
        else np.arange(len(edges) - 1)[max(turns[-1] - FIRST, 0) : turns[-1] + FIRST]
    )
    R = fine.system.R.copy()
    R[~stays_in(edges, (away,))] += np.diag(fine.disturbance**2 + TABLE**2 - UNKNOWN**2)
    seen = kalman(fine.system.with_arrays(R=R), history="full", innovations=True)
    return _beyond_chance(seen, rows) is None


def end_evidence(fine: FineAlignment) -> list[Evidence]:
    """That the last epochs of a log in which the IMU turns are not what its fit foretells: then no sigma is to be trusted there.

    A variance of the base's motion that is fitted to the whole log hardly grows by the last few of its seconds.
    """
    count = len(fine.estimates.innovation)
    rows = np.arange(count)[: -LAST - 1 : -1]
    found = _beyond_chance(fine.estimates, rows)
    if found is None:
        return []
    epochs, nis = found
    begins = float(fine.integrals.start + fine.integrals.time[count - epochs])
    factor = math.sqrt(nis / (2.0 * epochs))
    return [contradiction("innovations.at_end", "end_before", until=begins, factor=factor, end=begins - SEEN_LATE)]


def away_notes(away: Sequence[Away]) -> list[Evidence]:
    """Of which part of its log an answer is."""
    return [
        note("base.sets_off", time=part.begin) if math.isinf(part.end) else note("base.stops", time=part.end)
        for part in away
    ]


def _beyond_chance(seen: Estimates, rows: NDArray[np.int64]) -> tuple[int, float] | None:
    """Of how many of these epochs, the first ones, level innovations are farthest beyond chance, and their squares; None: none."""
    L: Array = np.asarray(np.linalg.cholesky(seen.innovation_covariance[rows]), dtype=np.float64)
    nis = np.cumsum(np.sum(whitened(L, seen.innovation[rows][..., None])[:, :2, 0] ** 2, axis=1))
    beyond = nis / [chi_square_limit(BY_CHANCE, 2 * (k + 1)) for k in range(len(nis))]
    worst = int(np.argmax(beyond))
    return (worst + 1, float(nis[worst])) if beyond[worst] > 1.0 else None
