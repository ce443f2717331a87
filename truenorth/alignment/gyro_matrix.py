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
gyros turned by .3 to 3 deg, or scaled or askew by .3 to 5 %, a push explained .1 to 4 % of what their matrix does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import matrix_signatures
from truenorth.alignment.matched import innovations_of
from truenorth.alignment.put_right import hardly_sampled, in_step, likelihood
from truenorth.alignment.swaying import SwayAlignment
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.attitude import misalignment
from truenorth.errors.staying import PHI
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

ROUNDS = 3  # of matrices left open, the gyros put right by the one before: what yaw alone shows comes last
OPEN = 0.05  # of a turn, one sigma of each entry where the matrix is left open
ONE = np.eye(3, dtype=np.bool_)


def gyro_matrix_evidence(
    fine: SwayAlignment, record: ImuRecord, imu: ImuSpec, anew: Callable[[ImuRecord, ImuSpec | None], SwayAlignment]
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
        Aligns another record about the same attitude, a motion of the same kind fitted anew; with a specification, its matrices are
        states as large as it says.
    """
    if hardly_sampled(record) or _explained(fine, imu) < chi_square_limit(limit("matrix"), 9):
        return []
    wide = replace(imu, gyro_scale_factor=OPEN, gyro_misalignment=OPEN)
    as_given = max(
        likelihood(fine), likelihood(anew(record, None))
    )  # a motion that is fitted anew may be likelier by itself
    right, put = record, np.eye(3)
    for _ in range(ROUNDS):
        M, sigma = _left_open(anew(right, wide))
        put = np.linalg.inv(np.eye(3) + M) @ put
        right = replace(record, gyro=record.gyro @ put.T)
        other = anew(right, None)
        gained = likelihood(other) - as_given
        if may_be_chance(gained):
            return []
        if in_step(other) <= limit("pushed in step") * gained:
            break
    else:
        return []
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, other))))
    if not np.any(moved > limit("negligible") * np.sqrt(np.diag(fine.P)[PHI])):
        return []
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    return [Evidence(*_named(np.linalg.inv(put) - np.eye(3), sigma), "bounded", effect, ("imu_axes", "units"))]


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
    return float(M @ np.linalg.solve(P + np.diag(known**2), M))


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
