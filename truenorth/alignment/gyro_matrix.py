"""Do the gyros of a base that sways, or of an indexer on it, turn too far, or sit askew? The same log with their matrix left open.

Gyros that see ``(I + M) w`` are scaled, askew, or turned as a block against the accelerometers. By ``M`` times the sway gravity
swings with the tilt: along it by a scale factor, across by a turned axis. A block that is turned by `a` about the vertical finds
another north by `a`. Whether the gyros are turned or the accelerometers, no log shows: level is that of the accelerometers, and of
a body whose gyros sit right it is off by the turn. So what of a turn is about level axes counts as an error of level. Pieces of 20
s show a turn to .1 to .6 deg, a scale factor to 3 % (:mod:`truenorth.quality.tilt`), behind all that the base does of its own, and
behind its arm, which swings in the same way. The filter of the answer has the base's motion and the arm among its states.

First it is asked what each entry of ``M`` does to its measurements, and with it the accelerometers' scale factors, axes and
biases, as large as their specification says: they swing gravity in step with the tilt as well, and no filter of a sway has
them. The squares that ``M`` explains are a chi-square of nine degrees of freedom where the gyros are as their specification
says. Where they are more, the likeliest ``M`` is searched: the log is aligned with it among the states, as large as it likes,
or put right by what the innovations show of it, and aligned anew, the motion fitted anew. A push of waves in step with the tilt
makes such a matrix seem, too: :mod:`~truenorth.alignment.put_right`. Of 40 gyros turned by .3 to 3 deg, or scaled or askew by
.3 to 5 %, a push explained .1 to 4 % of what their matrix does, of one more 12 %; of 32 sound ships, buoys and rafts 20 % and
more. In between, and where late gyros explain as much, what the matrix does is in sigma.

Nor is it the matrix where the log is likelier by another motion. The fit of one climbs from the highest peaks, and what it
comes to may be less likely by a thousand than what it comes to with any other gyros: two peaks of the swell, and the slow surge of
a moored boat left over. With three kinds of motion along an axis no two oscillators hold it all, and what yaw makes of a matrix
explains a part of a surge as slow. So the gyros as given are filtered with the motion of those put right, too, and both with a
swing on lines besides: of 60 moored boats whose heading swings by 2 to 5 deg in 70 to 110 s seven were likelier with a matrix
by 31 to 805; with the motions of both none by more than 43, and that one by none with a swing. Of such boats with a gyro off by 1
to 5 % it stays 60 and more, of bases without a slow sway thousands, by their own motions and by both.

A gyro's noise is in its own rate, by which its scale factor is found: of turns of variance s^2 with a random walk of n^2 in them,
the noise looks like a scale factor of ``n^2 / (s^2 + n^2)`` too much (errors in variables). A log is likelier the less noise its
gyros have: industrial gyros about two axes that only the third of an indexer turns were said to turn by 80 to 116 % too far. Where
noise makes more than a sigma of a scale factor, that one is left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.put_right import Anew, hardly_sampled, in_step, likelihood, through_filter
from truenorth.alignment.swaying import SwayAlignment
from truenorth.alignment.swung_bias import swung_biases
from truenorth.alignment.windowed import response
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.attitude import misalignment
from truenorth.core.errors import DataError
from truenorth.errors.matrices import known_moments, with_matrices
from truenorth.errors.staying import PHI
from truenorth.quality.tilt import PIECE, whole_cells
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDS = 5  # of matrices left open, the gyros put right by the one before: what yaw alone shows comes last
OPEN = (0.01, 0.05)  # of a turn, one sigma of each entry where the matrix is left open
LARGEST = 0.2  # entry of a step
# Of a turn: true ones were found to .03 deg. A sound ship that rolls by 18 deg with an arm of 14 m shows .008 deg, by what
# her filter leaves out: less than this is in sigma, and refuses no log.
SHOWN = 4.0  # sigmas of a turn, about three axes: a sound log in a thousand has more
EXACT = 5e-4
ONE = np.eye(3, dtype=np.bool_)
LATE = ("response.gyros_late", "response.gyros_early", "response.gyro_late")


class _Found(NamedTuple):
    """Entries (3, 3) of the gyros' matrix, their one-sigmas, and the log aligned with them put right."""

    M: Array
    sigma: Array
    fine: SwayAlignment
    pushed: float  # what a push in step with the tilt still explains of it


def gyro_matrix_evidence(
    fine: SwayAlignment, record: ImuRecord, imu: ImuSpec, anew: Anew, others: Sequence[Evidence]
) -> list[Evidence]:
    """Scale factors and axes of the gyros that explain a log better than any motion of its base, with what they do.

    Parameters
    ----------
    fine : SwayAlignment
        With the base's motion fitted.
    record : ImuRecord
        Of which it is.
    imu : ImuSpec
        Whose sensors may be off by as much as it says.
    anew : callable
        Of :func:`truenorth.alignment.put_right.aligned_anew`.
    others : sequence of Evidence
        Found before: late gyros of an indexer that spins steadily are turned by the delay times its rate.
    """
    if hardly_sampled(record):
        return []
    M, P = _response(fine, imu)
    seen = _seen(record, imu, np.sqrt(np.diag(P)[::4]))
    if _explained(M, P, imu, seen) < chi_square_limit(limit("matrix"), int(seen.sum())):
        return []
    try:
        found, as_given = _put_right(record, imu, anew, fine, seen)
    except DataError:  # the filter broke down: with so open a matrix the log says nothing
        return []
    as_given = max(as_given, fine.estimator.likeliest(found.fine.motion))
    gained = likelihood(found.fine) - as_given
    if may_be_chance(gained) or found.pushed > limit("may be pushed") * gained:
        return []
    if may_be_chance(_on_lines(fine, found, as_given)):
        return []
    late = max((float(item.figures["ratio"]) for item in others if item.key in LATE), default=0.0)
    in_doubt = found.pushed > limit("pushed in step") * gained or late > limit("may be pushed") * gained
    if in_doubt and np.abs(found.M).max() > OPEN[-1]:  # no gyro, but what waves do is as large as that
        return []
    key, figures = _named(found.M, found.sigma)
    figures["ratio"] = gained
    effect = _effect(fine, found)
    if effect is None:
        return []
    in_doubt = in_doubt or float(np.abs(found.M).max()) < EXACT
    return [Evidence(key, figures, "hint" if in_doubt else "bounded", effect, ("imu_axes", "units"))]


def _on_lines(fine: SwayAlignment, found: _Found, as_given: float) -> float:
    """By how much a log is likelier with a matrix where its base may swing on lines as well: twice the logarithm of the ratio.

    Of the likeliest motion for the gyros as given, which make the log as likely as `as_given` by the usual one, and of that for
    those put right.
    """
    put_right = max(likelihood(found.fine), found.fine.estimator.on_lines())
    return put_right - max(as_given, fine.estimator.on_lines())


def _effect(fine: SwayAlignment, found: _Found) -> Effect | None:
    """What a matrix does to level and heading; None: nothing that counts."""
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, found.fine))))
    key, figures = _named(found.M, found.sigma)
    turned = key == "tilt.turned" and float(figures["turn"]) > SHOWN * float(figures["sigma"])
    askew = _askew(fine, found.M) if turned else 0.0
    if not np.any(np.append(moved, askew) > limit("negligible") * np.sqrt(np.diag(fine.P)[PHI])[[0, 1, 2, 0]]):
        return None
    return Effect(heading=float(moved[2]), level=math.hypot(moved[0], moved[1], askew))


def _askew(fine: SwayAlignment, M: Array) -> float:
    """How far gravity is from where the accelerometers see it, rad, if the gyros are the body's and the accelerometers are turned.

    Of ``M`` the part that turns a block, less what of that is about the vertical.
    """
    turn = 0.5 * np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])
    up = (fine.C_n0_i @ fine.integrals.C_mean)[:, 2]  # of n0, along the IMU's axes
    return float(np.linalg.norm(np.cross(up, turn), axis=1).max())


def _seen(record: ImuRecord, imu: ImuSpec, sigma: Array) -> Mask:
    """(9,) the entries that the gyros' noise does not make: of a scale factor less than its sigma (3,).

    Of turns in pieces about their line, which a constant rate is.
    """
    turns, interval, _ = whole_cells(record)
    length = round(PIECE / interval)
    pieces = len(turns) // length
    if pieces == 0:
        return ~ONE.ravel()
    angle = np.cumsum(turns[: pieces * length].reshape(pieces, length, 3), axis=1)
    angle -= angle.mean(axis=1, keepdims=True)
    time = np.arange(length) - 0.5 * (length - 1)
    angle -= time[:, None] * (time @ angle / (time @ time))[:, None, :]
    walked = imu.gyro_random_walk**2 * PIECE / 15.0  # the variance of a random walk about its line
    diluted = walked / np.maximum(np.mean(angle**2, axis=(0, 1)), walked) if walked > 0.0 else np.zeros(3)
    return np.asarray(~(ONE & (diluted > sigma)).ravel())


def _explained(M: Array, P: Array, imu: ImuSpec, seen: Mask) -> float:
    """Squares of the innovations that a matrix of the gyros explains, by what is known of it and by their noise."""
    known = np.where(ONE, imu.gyro_scale_factor, np.hypot(imu.gyro_misalignment, imu.accel_misalignment)).ravel()
    M, P = (item[seen] for item in _without(M, P, seen))
    return float(M @ np.linalg.pinv(P[:, seen] + np.diag(known[seen] ** 2), hermitian=True) @ M)


def _without(M: Array, P: Array, seen: Mask) -> tuple[Array, Array]:
    """The same matrix (9,) and its covariance where the entries that are not seen are zero."""
    if seen.all():
        return M, P
    weight = np.linalg.pinv(P, hermitian=True)
    kept = np.zeros_like(P)
    kept[np.ix_(seen, seen)] = np.linalg.pinv(weight[np.ix_(seen, seen)], hermitian=True)
    return kept @ (weight @ M), kept


def _response(fine: SwayAlignment, imu: ImuSpec | None = None, size: float = np.inf) -> tuple[Array, Array]:
    """The gyros' matrix (9,) that the innovations of a filter show, its motion held, and its covariance (9, 9).

    By the attitude as it sways: by its slow part, by which biases act, a gyro about the vertical that sees a part of the roll shows
    nowhere.

    Parameters
    ----------
    imu : ImuSpec, optional
        Of accelerometers whose errors explain what they can; of a step of a search, which the likelihood judges, they need not.
    size : float
        One sigma of each entry.
    """
    log, base = fine.about, fine.estimator.base
    moments = known_moments(log.right_record, log.integrals)
    bigger = with_matrices(base, moments, log.integrals, log.C_n0_i, log.position.lat)
    causes = response(bigger)[0][:, :, base.states :]
    if imu is None:
        causes = causes[:, :, :9]
    else:
        causes[:, :, 9:] *= np.where(ONE, imu.accel_scale_factor, imu.accel_misalignment).ravel()
        swung = swung_biases(fine, np.sqrt(imu.bias_variance[3:]), log.position, log.C_sb)
        causes = np.concatenate([causes, swung], axis=2)
    made, _, white = through_filter(fine, causes)
    known = np.concatenate([np.full(9, size**-2), np.ones(made.shape[1] - 9)])
    P = np.asarray(np.linalg.pinv(made.T @ made + np.diag(known), hermitian=True), dtype=np.float64)
    return (P @ (made.T @ white))[:9], P[:9, :9]


def _put_right(record: ImuRecord, imu: ImuSpec, anew: Anew, fine: SwayAlignment, seen: Mask) -> tuple[_Found, float]:
    """The likeliest matrix of the gyros, and the likelihood without any.

    Each round tries, from the best so far, a matrix that is left a little open and one that is wide open, and a step to what the
    filter's innovations show. A motion of the base takes a part of a matrix up: left open it may come to rest where the log is less
    likely than as given; the steps go on with a motion that is fitted to each, and are too short. Where a push explains more
    than the first matrices do, it is none, and where both of them do nothing to the answer no other is sought. A round that makes
    the log likelier by no more than chance is the last.
    """
    best, as_given = _Found(np.zeros((3, 3)), np.zeros((3, 3)), fine, np.inf), likelihood(fine)
    for turn in range(ROUNDS):
        found = _left_open(record, best, _opened(imu, OPEN[0]), anew, seen), _stepped(record, best, anew, seen)
        better = max(best, *found, key=_likelihood)
        if turn == 0 and not any(_effect(fine, item) for item in found):
            break  # both ways to it find a matrix that does nothing
        if turn == 0 and better.pushed <= _likelihood(better) - as_given:
            as_given = max(as_given, likelihood(anew(record)))  # a motion that is fitted anew may be likelier by itself
        if better.pushed > _likelihood(better) - as_given:
            break
        better = max(better, _left_open(record, best, _opened(imu, OPEN[1]), anew, seen), key=_likelihood)
        gained, best = _likelihood(better) - _likelihood(best), better
        if turn > 0 and may_be_chance(gained):
            break
        if best.pushed <= limit("pushed in step") * (_likelihood(best) - as_given):
            break
    return best, as_given


def _opened(imu: ImuSpec, size: float) -> ImuSpec:
    return replace(imu, gyro_scale_factor=size, gyro_misalignment=size)


def _left_open(record: ImuRecord, best: _Found, wide: ImuSpec, anew: Anew, seen: Mask) -> _Found:
    """With the matrix that an alignment finds which leaves it open, taken off and left at the end."""
    found = anew(_right(record, best.M), wide)
    at = found.about.prior.groups["matrices"]
    gyros = slice(at.start, at.start + 9)
    M = found.about.taken[gyros] + found.estimates.x[-1][gyros]
    M, P = _without(M, found.estimates.P[-1][gyros, gyros], seen)
    return _corrected(record, best, M, np.diag(P), anew)


def _stepped(record: ImuRecord, best: _Found, anew: Anew, seen: Mask) -> _Found:
    """With the matrix that the innovations of the best so far show, or a multiple of it, as long as the log becomes likelier."""
    M, P = _without(*_response(best.fine, size=OPEN[-1]), seen)
    found, before = _corrected(record, best, M, np.diag(P), anew), best
    while _likelihood(found) > _likelihood(before) and 2.0 * np.abs(M).max() <= LARGEST:
        M, before = 2.0 * M, found
        found = _corrected(record, best, M, np.diag(P), anew)
    return max(before, found, key=_likelihood)


def _corrected(record: ImuRecord, best: _Found, M: Array, variance: Array, anew: Anew) -> _Found:
    """The log aligned with its gyros put right by the best so far and by a matrix (9,) that was found after it."""
    total = (np.eye(3) + best.M) @ (np.eye(3) + M.reshape(3, 3)) - np.eye(3)
    fine = anew(_right(record, total))
    return _Found(total, np.sqrt(variance).reshape(3, 3), fine, in_step(fine))


def _right(record: ImuRecord, M: Array) -> ImuRecord:
    """Of gyros that see ``(I + M) w``."""
    return replace(record, gyro=record.gyro @ np.linalg.inv(np.eye(3) + M).T)


def _likelihood(found: _Found) -> float:
    return likelihood(found.fine)


def _named(M: Array, sigma: Array) -> tuple[str, dict[str, Figure]]:
    """What is off most: a scale factor, or an axis, or the block."""
    askew = max(float(np.max(np.abs(np.where(ONE, 0.0, M)))), float(np.linalg.norm(M - M.T)) / np.sqrt(8.0))
    axis = int(np.argmax(np.abs(np.diag(M))))
    if abs(M[axis, axis]) > askew:
        return "tilt.scale", {"axis": "xyz"[axis], "scale": float(M[axis, axis]), "sigma": float(sigma[axis, axis])}
    return "tilt.turned", {"turn": askew, "sigma": float(np.max(np.where(ONE, 0.0, sigma)))}
