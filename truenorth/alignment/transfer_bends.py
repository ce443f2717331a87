"""Whether something bends between a slave and its master, where nobody said so.

What the slave turns about an axis by its gyros, `X`, and by how much less the master's attitude turns, `D`, are compared row by
row. Of one rigid body `D` is noise, and what a delay tau leaves, ``(1 - exp(i w tau)) X``: attitudes that are not matched may have
another one than velocities that a filter has made late. So the slave is taken where its turns are nearest to the master's. Of a
seat that bends `D` is what the seat turns. In each octave of frequencies below half the rate of the rows (what is faster is in the
rows, too, folded into these),

    share = Re sum(D X*) / sum |X|^2

with its own standard error by what it leaves of `D`. (A filter of the master's attitude, too slow for what both turn, looks the
same.) Where that is sure, the log is aligned again with a seat that bends so much and so fast; what that moves is the effect.
The test by octaves is ours.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_bending import filtered, frequencies, own_angles, relative
from truenorth.alignment.transfer_filter import Assumed
from truenorth.alignment.transfer_nominal import carried_back, carried_for
from truenorth.alignment.transfer_passes import rigid_rows
from truenorth.core.errors import AlignmentError, DataError
from truenorth.errors.master import ARM, DELAY, MOUNTING, TransferModel
from truenorth.estimate.rivals import effect_of
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.flexure import DECAY, FlexureSpec
from truenorth.state.evidence import ANY_EFFECT, Evidence, Figure
from truenorth.state.track import Track

Array = NDArray[np.float64]

SLOWEST = 0.2  # Hz: slower, an arm that is rigid is less than centimetres a second off
SHARE = 0.2  # of what a slave turns within an octave: less may be a late master, or gyros on axes of their own
NOISE = 10.0  # times the variance of the gyros' own random walk of angle in an octave, folded noise included
PHASE = 0.2  # rad, of a sigma of the delay: of what is faster nobody knows how much the master should show
SURELY = 6.0  # standard errors; of three axes and six octaves chance has one beyond in 10^7 logs
LATEST, STEP = 0.3, 0.01  # s: attitudes that are further off are no matter of a filter; the delay is between steps
MISSES = 2.0  # sigmas: a delay, an arm or a mounting that is further off is none


def bending_evidence(
    slave: ImuRecord,
    master: MasterRecord,
    track: Track,
    model: TransferModel,
    said: Assumed,
    again: Callable[[FlexureSpec], Track],
) -> list[Evidence]:
    """That the seat bends, and what a rigid one does to the answer; `again` is the alignment with a seat that bends."""
    spec = seen_to_bend(slave, master, track, model, said) if master.C_nb is not None else None
    if spec is None:
        return []
    figures: dict[str, Figure] = {
        "size": max(spec.sigma),
        "lasts": spec.correlation_time,
        "frequency": spec.beta / (2.0 * math.pi),
    }
    try:
        other = again(spec)
    except (AlignmentError, DataError):  # it does not fit with that either
        return [Evidence("transfer.bends", figures, "unknown", ANY_EFFECT, ("bending",))]
    off = 0.0
    for name in (DELAY, ARM, MOUNTING):
        at, own = track.layout.slice_of(name), other.layout.slice_of(name)
        if at is not None and own is not None:
            sigma = np.maximum(track.sigma[-1, at], 1e-12)
            off = max(off, float(np.max(np.abs(other.sensors[-1, own] - track.sensors[-1, at]) / sigma)))
    if off > MISSES:
        return [Evidence("transfer.bends", figures, "unknown", ANY_EFFECT, ("bending",))]
    return [Evidence("transfer.bends", figures, "known", effect_of(track, other), ("bending",))]


def seen_to_bend(
    slave: ImuRecord, master: MasterRecord, track: Track, model: TransferModel, said: Assumed
) -> FlexureSpec | None:
    """How much and how fast a slave's seat bends, the same about each axis; None where nothing shows it."""
    carried = carried_back(slave, track, carried_for(slave, model))
    C_rigid, held = rigid_rows(master, track, carried, said)
    raw = relative(slave, carried, C_rigid, held)
    if raw is None:
        return None
    whole = own_angles(slave)
    then = held + late(held, C_rigid, *raw, whole)
    knots, angles = relative(slave, carried, C_rigid, then) or raw
    w = 2.0 * math.pi * frequencies(len(knots), slave.interval)
    tau = track.layout.slice_of(DELAY)
    unsure = 0.0 if tau is None else float(track.sigma[-1, tau][0])
    turned = filtered(whole, np.repeat((w * unsure < PHASE)[:, None], 3, axis=1))
    D, X = (
        np.fft.rfft(np.concatenate([rows, rows[::-1]]), axis=0)
        for rows in (at(then, knots, of) for of in (angles, turned))
    )
    f = frequencies(len(held), float(np.median(np.diff(held))))
    edge, bent = f[-1], np.zeros(3)
    slowest = math.inf
    while edge > SLOWEST:
        octave = (f > 0.5 * edge) & (f <= edge)
        for axis in range(3):
            # Mean square of rows that are taken there and back; the gyros' own noise is turned by the slave alone, too.
            power = 2.0 * shown(D[octave, axis], X[octave, axis]) / (2 * len(held)) ** 2
            if power > NOISE * model.gyro_random_walk**2 / (2.0 * math.pi**2) * (1.0 / edge + 1.0 / f[-1]):
                bent[axis] += power
                slowest = min(slowest, 0.5 * edge)
        edge *= 0.5
    # A vibration whose phase nobody knows is in the master's rows at any share, folded to any frequency.
    if np.sum(bent) <= np.sum(np.var(whole - turned, axis=0)):
        return None
    fast = filtered(turned, np.repeat((w > 2.0 * math.pi * slowest)[:, None], 3, axis=1))
    spectrum = np.abs(np.fft.rfft(fast[:, int(np.argmax(bent))])) ** 2
    rate = 2.0 * math.pi * np.fft.rfftfreq(len(fast), slave.interval)
    beta = float(rate @ spectrum / np.sum(spectrum))
    return FlexureSpec(sigma=(float(np.sqrt(bent.max())),) * 3, correlation_time=DECAY / beta)


def at(times: Array, knots: Array, angles: Array) -> Array:
    """(M, 3) angles at some times, between knots."""
    return np.stack([np.interp(times, knots, axis) for axis in angles.T], axis=1)


def late(held: Array, C_rigid: Array, knots: Array, angles: Array, turned: Array) -> float:
    """By how much later a slave's turns (N + 1, 3) at `knots` are nearest to its master's, which they differ from by `angles`, s.

    From row to row: what a seat bends adds as much to the squares whatever the delay.
    """
    held = held[np.isfinite(C_rigid).all(axis=(1, 2))]
    body = at(held, knots, turned - angles)
    taus = np.arange(-LATEST, LATEST + 0.5 * STEP, STEP)
    cost = np.array([np.sum(np.diff(at(held + tau, knots, turned) - body, axis=0) ** 2) for tau in taus])
    best = int(np.argmin(cost))
    if best in (0, len(taus) - 1):
        return float(taus[best])
    before, here, after = cost[best - 1 : best + 2]
    return float(taus[best] + 0.5 * STEP * (before - after) / (before - 2.0 * here + after))


def shown(D: Array, X: Array) -> float:
    """Sum of squares, over the frequencies of an octave, of what bends; 0 where nothing is sure."""
    power = float(np.sum(np.abs(X) ** 2))
    if len(X) < 2 or power == 0.0:
        return 0.0
    share = float(np.real(np.sum(D * np.conj(X)))) / power
    left = float(np.sum(np.abs(D - share * X) ** 2)) / (len(X) - 1)
    if share < max(SHARE, SURELY * math.sqrt(left / power)):
        return 0.0
    return share * power
