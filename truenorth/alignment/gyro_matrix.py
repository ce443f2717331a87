"""Do the gyros of a base that sways, or of an indexer on it, turn too far, or sit askew? The same log with their matrix left open.

Gyros that see ``(I + M) w`` are scaled, askew, or turned as a block against the accelerometers. By ``M`` times the sway gravity
swings with the tilt: along it by a scale factor, across by a turned axis. A block that is turned by `a` about the vertical finds
another north by `a`. Pieces of 20 s show a turn to .1 to .6 deg, a scale factor to 3 % (:mod:`truenorth.quality.tilt`), behind all
that the base does of its own, and behind its arm, which swings in the same way. The filter of the answer has the base's motion and
the arm among its states.

First it is asked what each entry of ``M`` does to its measurements: the squares that this explains are a chi-square of nine degrees
of freedom where the gyros are as their specification says (11 on the average of sound logs, 18 at the most of eight). Where they
are more, the log is aligned with ``M`` among the states, as large as it likes; the gyros are put right by what that finds, and
aligned anew. A push of waves in step with the tilt makes such a matrix seem, too: :mod:`~truenorth.alignment.put_right`. Of 40
gyros turned by .3 to 3 deg, or scaled or askew by .3 to 5 %, a push explained .1 to 4 % of what their matrix does, of one more
12 %; of 32 sound ships, buoys and rafts 20 % and more. In between, and where late gyros explain as much, what the matrix does is
in sigma.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import matrix_signatures
from truenorth.alignment.matched import innovations_of
from truenorth.alignment.put_right import Anew, hardly_sampled, in_step, likelihood
from truenorth.alignment.swaying import SwayAlignment
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.attitude import misalignment
from truenorth.core.errors import DataError
from truenorth.errors.staying import PHI
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

ROUNDS = 5  # of matrices left open, the gyros put right by the one before: what yaw alone shows comes last
OPEN = (0.01, 0.05)  # of a turn, one sigma of each entry where the matrix is left open
ONE = np.eye(3, dtype=np.bool_)
LATE = ("response.gyros_late", "response.gyros_early")


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
        Whose gyros may be off by as much as it says.
    anew : callable
        Of :func:`truenorth.alignment.put_right.aligned_anew`.
    others : sequence of Evidence
        Found before: late gyros of an indexer that spins steadily are turned by the delay times its rate.
    """
    if hardly_sampled(record) or _explained(fine, imu) < chi_square_limit(limit("matrix"), 9):
        return []
    try:
        again = anew(record)  # a motion that is fitted anew may be likelier by itself
        as_given = max(likelihood(fine), likelihood(again))
        found = _put_right(record, imu, anew, again, as_given)
    except DataError:  # the filter broke down: with so open a matrix the log says nothing
        return []
    gained = likelihood(found.fine) - as_given
    if may_be_chance(gained) or found.pushed > limit("may be pushed") * gained:
        return []
    late = max((float(item.figures["ratio"]) for item in others if item.key in LATE), default=0.0)
    in_doubt = found.pushed > limit("pushed in step") * gained or late > limit("may be pushed") * gained
    if in_doubt and np.abs(found.M).max() > OPEN[-1]:  # no gyro, but what waves do is as large as that
        return []
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, found.fine))))
    if not np.any(moved > limit("negligible") * np.sqrt(np.diag(fine.P)[PHI])):
        return []
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    return [Evidence(*_named(found.M, found.sigma), "hint" if in_doubt else "bounded", effect, ("imu_axes", "units"))]


def _explained(fine: SwayAlignment, imu: ImuSpec) -> float:
    """Squares of the innovations that a matrix of the gyros explains, by what is known of it and by their noise."""
    seen = matrix_signatures(fine, replace(imu, gyro_scale_factor=1.0, gyro_misalignment=1.0))
    if seen is None:
        return 0.0
    white = innovations_of(fine, np.ascontiguousarray(seen[:, :, :9])).white
    response = white[..., 1:].reshape(-1, 9)
    P = np.linalg.pinv(response.T @ response, hermitian=True)
    M = P @ (response.T @ white[..., 0].ravel())
    known = np.where(ONE, imu.gyro_scale_factor, np.hypot(imu.gyro_misalignment, imu.accel_misalignment)).ravel()
    return float(M @ np.linalg.pinv(P + np.diag(known**2), hermitian=True) @ M)


def _put_right(record: ImuRecord, imu: ImuSpec, anew: Anew, again: SwayAlignment, as_given: float) -> _Found:
    """The likeliest matrix of the gyros: of one that is left a little open and one that is wide open, round after round.

    A motion of the base takes a part of a matrix up, and the more so the farther that one may go: wide open it may come to rest
    where the log is less likely than as given. Where a push explains more than the first matrix does, it is none.
    """
    best = _Found(np.zeros((3, 3)), np.zeros((3, 3)), again, np.inf)
    for _ in range(ROUNDS):
        put = np.asarray(np.linalg.inv(np.eye(3) + best.M), dtype=np.float64)
        right = replace(record, gyro=record.gyro @ put.T)
        better = best
        for size in OPEN:
            found = _corrected(record, put, *_left_open(anew(right, _opened(imu, size))), anew)
            better = max(better, found, key=lambda item: likelihood(item.fine))
            if better.pushed > likelihood(better.fine) - as_given:
                return better
        if better is best:
            break
        best = better
        if best.pushed <= limit("pushed in step") * (likelihood(best.fine) - as_given):
            break
    return best


def _opened(imu: ImuSpec, size: float) -> ImuSpec:
    return replace(imu, gyro_scale_factor=size, gyro_misalignment=size)


def _corrected(record: ImuRecord, put: Array, M: Array, sigma: Array, anew: Anew) -> _Found:
    """The log aligned with its gyros put right by `put` and a matrix that was found after it."""
    put = np.linalg.inv(np.eye(3) + M) @ put
    fine = anew(replace(record, gyro=record.gyro @ put.T))
    return _Found(np.linalg.inv(put) - np.eye(3), sigma, fine, in_step(fine))


def _left_open(found: SwayAlignment) -> tuple[Array, Array]:
    """The gyros' matrix (3, 3) that an alignment finds which leaves it open, taken off and left at the end; and its one-sigmas."""
    at = found.about.prior.groups["matrices"]
    gyros = slice(at.start, at.start + 9)
    M = found.about.taken[gyros] + found.estimates.x[-1][gyros]
    return M.reshape(3, 3), np.sqrt(np.diag(found.estimates.P[-1])[gyros]).reshape(3, 3)


def _named(M: Array, sigma: Array) -> tuple[str, dict[str, Figure]]:
    """What is off most: a scale factor, or an axis, or the block."""
    askew = max(float(np.max(np.abs(np.where(ONE, 0.0, M)))), float(np.linalg.norm(M - M.T)) / np.sqrt(8.0))
    axis = int(np.argmax(np.abs(np.diag(M))))
    if abs(M[axis, axis]) > askew:
        return "tilt.scale", {"axis": "xyz"[axis], "scale": float(M[axis, axis]), "sigma": float(sigma[axis, axis])}
    return "tilt.turned", {"turn": askew, "sigma": float(np.max(np.where(ONE, 0.0, sigma)))}
