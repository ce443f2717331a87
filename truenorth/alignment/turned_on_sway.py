"""Are the gyros of a base that sways turned against its accelerometers? By the filter's own response, against a push in step.

Gyros turned by a small `a` find another north by the part of `a` about the vertical, and by that about north times the tangent of
latitude. On a sway gravity swings across the way of the tilt by `a` times its amount. Pieces of 20 s show that behind all that the
base does of its own, to .1 to .6 deg; the filter has the base's own motion among its states, and sees .02 to .1 deg.

As of a scale factor a push in step looks like it (:mod:`~truenorth.alignment.put_right`): the gyros are put right, the log aligned
anew, and what goes with the tilt then is asked for. Of 14 turned gyros of .3 to 2.6 deg a push explained .4 to 2 % of what the turn
does, and their turn was found to .03 deg; a ship that hardly rolls shows none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.matched import innovations_of
from truenorth.alignment.put_right import hardly_sampled, in_step, likelihood
from truenorth.alignment.swaying import SwayAlignment
from truenorth.core.attitude import dcm_from_rotation_vector, misalignment, rotation_vector_from_dcm
from truenorth.errors.staying import PHI
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]

ROUNDS = 4  # of alignments anew: the response of a log that is far off is linear in a part of the turn only
LARGEST = 0.1  # rad of a correction in one round
STEP = 1e-3  # rad, with which is asked


def turned_on_sway_evidence(
    fine: SwayAlignment, record: ImuRecord, imu: ImuSpec, anew: Callable[[ImuRecord], SwayAlignment]
) -> list[Evidence]:
    """The turn of the gyros' axes that explains a swaying log better than any motion of its base, with what it does.

    Parameters
    ----------
    fine : SwayAlignment
        With the base's motion fitted.
    record : ImuRecord
        Of which it is.
    imu : ImuSpec
        Whose axes may be off by as much as it says.
    anew : callable
        Aligns another record about the same attitude, a motion of the same kind fitted anew.
    """
    if hardly_sampled(record):
        return []
    prior = np.hypot(imu.gyro_misalignment, imu.accel_misalignment)
    turn, sigma, ratio = _response(fine, prior)
    if may_be_chance(ratio):
        return []
    as_given = likelihood(
        max(fine, anew(record), key=likelihood)
    )  # a motion that is fitted anew may be likelier by itself
    best, C = fine, np.eye(3)
    found = np.zeros(3)
    for _ in range(ROUNDS):
        C = C @ dcm_from_rotation_vector(-np.clip(turn, -LARGEST, LARGEST))
        other = anew(replace(record, gyro=record.gyro @ C.T))
        if likelihood(other) > likelihood(best):
            best, found = other, -rotation_vector_from_dcm(C)
        turn, _, left = _response(other, prior)
        if may_be_chance(left):
            break
    gained = likelihood(best) - as_given
    if may_be_chance(gained) or in_step(best) > limit("pushed in step") * gained:
        return []
    moved = np.abs(misalignment(*(item.misalignment_at(np.eye(3), 0.0)[0] for item in (fine, best))))
    if not np.any(moved > limit("negligible") * np.sqrt(np.diag(fine.P)[PHI])):
        return []
    effect = Effect(heading=float(moved[2]), level=float(np.hypot(moved[0], moved[1])))
    figures: dict[str, Figure] = {
        "turn": float(np.linalg.norm(found)),
        "sigma": float(np.max(sigma)),
    }
    return [Evidence("tilt.turned", figures, "bounded", effect, ("imu_axes",))]


def _response(fine: SwayAlignment, prior: float) -> tuple[Array, Array, float]:
    """The likeliest turn of the gyros' axes (3,), rad, its one-sigmas, and twice the logarithm of its likelihood ratio.

    `prior` is what is known of them, rad, one sigma: a turn of that size is none.
    """
    log, z = fine.about, fine.system.z
    made = []
    for i in range(3):
        gyro, (j, k) = log.record.gyro.copy(), ((i + 1) % 3, (i + 2) % 3)
        gyro[:, j] -= STEP * log.record.gyro[:, k]
        gyro[:, k] += STEP * log.record.gyro[:, j]
        made.append(log.with_record(replace(log.record, gyro=gyro)).linearise().z - z)
    white = innovations_of(fine, np.stack(made, axis=2) / STEP).white
    seen, response = white[..., 0].ravel(), white[..., 1:].reshape(-1, 3)
    N, b = response.T @ response, response.T @ seen
    P = np.linalg.pinv(N, hermitian=True)
    turn = P @ b
    spread = P + prior**2 * np.eye(3)
    return turn, np.sqrt(np.diag(P)), float(turn @ np.linalg.solve(spread, turn))
