"""May the answer of a transfer alignment be used? What its master's rows contradict, and what a poor heading needs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.alignment.transfer_filter import TRANSLATIONS, Assumed, axes_along
from truenorth.alignment.transfer_result import Transfer
from truenorth.alignment.transfer_rows import by_rows
from truenorth.alignment.verdict import judged
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.errors.master import ATTITUDE_ERROR, FILTER, VELOCITY_ERROR
from truenorth.estimate.memory import USED
from truenorth.estimate.rivals import counted_once
from truenorth.quality.whiteness import whiteness
from truenorth.state.evidence import Evidence, contradiction, note, notes
from truenorth.state.limits import limit
from truenorth.state.track import Track

Array = NDArray[np.float64]

MOST_JUMPS = 3  # of the master, that the reasons name one by one
LONGEST_FILTER = 0.12  # s: of a longer time constant the terms that are left out move the arm by more than its sigma
UNSETTLED = 1.0  # sigmas: a pass that moves what was found by more has no answer yet
LOPSIDED, STEADY, FEWEST = 6.0, 0.9, 20  # sigmas of a mean of innovations, their correlation from row to row, rows


def judge_transfer(
    answer: Alignment,
    transfer: Transfer,
    track: Track,
    assumed: Assumed,
    heading_limit: float,
    of_master: list[Evidence],
    least: float,
    left: float = 0.0,
) -> Alignment:
    """The answer with its verdict; `of_master` is what was found of the master before, its clock included.

    `assumed` is what was said at first; `least` is the noise of its translation that is
    no surprise: as given, or what the fit begins with. `left` is what the last pass has still moved the motion by, in sigmas.
    """
    evidence = list(of_master)
    evidence += _rejected(transfer)
    known = {item.key for item in evidence}  # a delay that is far off comes out between that and what was said
    evidence += [item for item in _misses(transfer, track, assumed) if item.key not in known]
    lopsided = _lopsided(track, transfer)
    evidence += [] if lopsided else _lasting(transfer, least)
    if lopsided:
        remedies = ("slave_specification", "without_jump") if transfer.jumps else ("slave_specification",)
        evidence.append(contradiction("transfer.lopsided", *remedies, rows=lopsided, imu=answer.imu_source))
    evidence += _unsettled(left)
    evidence += _filtered(track)  # last: an IMU that is poorer than it is said to be may look like one
    evidence += notes(transfer.notes) + notes(transfer.jumps[:MOST_JUMPS])
    if len(transfer.jumps) > MOST_JUMPS:  # a master that is reset now and then does not do that
        evidence.append(
            contradiction(
                "transfer.jumps", "transfer_geometry", "put_times_right", "without_jump", count=len(transfer.jumps)
            )
        )
    evidence += [note("transfer.open", states=words) for words in transfer.open]
    needs = "match_velocity" if transfer.matching == "attitude" else "manoeuvre"
    answer = judged(answer, counted_once(evidence), heading_limit, waiting=False, remedies=(needs,))
    assert answer.transfer is not None
    # After the judge, who widens both sigmas by what the evidence shows: what is said is what the result holds.
    return replace(answer, evidence=(*answer.evidence, _against_what(answer.transfer)))


def _against_what(transfer: Transfer) -> Evidence:
    """Whether sigma is absolute, or against the master."""
    if transfer.considered:
        heading, pitch, roll = transfer.relative_sigma.tolist()
        return note("transfer.absolute", heading=heading, level=max(pitch, roll))
    return note("transfer.relative")


def _rejected(transfer: Transfer) -> list[Evidence]:
    share = transfer.rejected / max(1, transfer.rejected + transfer.used)
    if share <= limit("rejected"):
        return []
    return [contradiction("transfer.rejected", "transfer_geometry", "flexure", share=share)]


def _misses(transfer: Transfer, track: Track, assumed: Assumed) -> list[Evidence]:
    """A delay, an arm or a mounting that comes out far from what was said of it."""
    found = []
    for name, off, prior in (
        ("delay", transfer.delay - assumed.delay, transfer.delay_prior),
        ("lever_arm", transfer.lever_arm - assumed.lever_arm, transfer.lever_arm_prior[0]),
        ("mounting", _between(assumed.C_mb, axes_along(track, assumed)[-1]), transfer.mounting_prior[0]),
    ):
        miss = float(np.max(np.abs(off)))
        if prior > 0.0 and miss > limit("mounting") * prior:
            remedies = ("slave_axes", f"transfer.{name}")
            found.append(contradiction(f"transfer.{name}", *remedies, miss=miss, prior=float(prior)))
    return found


def _unsettled(left: float) -> list[Evidence]:
    """Passes that still moved attitude, arm, delay or seat by so many sigmas: nobody knows how far they would go."""
    return [contradiction("transfer.unsettled", "slave_specification", left=left)] if left > UNSETTLED else []


def _filtered(track: Track) -> list[Evidence]:
    """A filter of the master's velocity that is slower than the terms of it which are states describe.

    By attitude and velocity its time constant is the mean delay of the one behind the other, by velocity alone the root of twice
    the variance term; counted is what it is at least, by two sigmas.
    """
    at = track.layout.slice_of(FILTER)
    if at is None:
        return []
    sigma = np.sqrt(np.diag(track.P[-1][at, at]))
    (late, flat), (late_sigma, flat_sigma) = track.sensors[-1, at][:2], sigma[:2]
    by_both = late_sigma > 0.0
    least = late - 2.0 * late_sigma if by_both else np.sqrt(2.0 * max(flat - 2.0 * flat_sigma, 0.0))
    if least < LONGEST_FILTER:
        return []
    constant = late if by_both else np.sqrt(2.0 * flat)
    return [contradiction("transfer.filter", "without_filter", constant=float(constant))]


def _lasting(transfer: Transfer, least: float) -> list[Evidence]:
    """Differences of the translation that are no noise, since they last from row to row: no motion of one rigid body.

    Their density at the period of manoeuvres is the noise that was fitted; where it is much more than what changes from row to
    row, as of accelerometers whose axes are exchanged while a ship rolls, it is not a master's. What has no more density
    than a noise that is no surprise is in sigma: of rows without noise, the filter follows slowly.
    """
    residuals = next((r for r in transfer.residuals if r.name in TRANSLATIONS), None)
    if residuals is None or not residuals.used.any():
        return []
    e = (residuals.innovation / residuals.sigma)[residuals.used]
    whole = e[:, np.isfinite(e).all(axis=0)]
    found = whiteness(whole, float(np.median(np.diff(residuals.time))) if len(residuals.time) > 1 else 1.0)
    # By what sigma they have for most of the log: a first row from a start that is known to 10 m only is no size of them all.
    size = found.size * float(np.nanmedian(residuals.sigma[residuals.used]))
    if not found.sure or found.turning < limit("growth") or found.turning * size < least:
        return []
    return [
        contradiction(
            "transfer.lasting",
            "slave_axes",
            "transfer_geometry",
            name=residuals.name,
            size=size,
            unit=residuals.unit,
            colour=found.turning,
        )
    ]


def _lopsided(track: Track, transfer: Transfer) -> str:
    """Which rows of the later three quarters have innovations with a mean beyond chance, and hardly a change from row to row.

    Rows that were used, that is: those of a jump lie on one side too, until it is taken up.
    """
    later, said, lasting = slice(len(track) // 4, None), by_rows(track), _masters_own(track)
    nu, verdict = (said.innovation / said.sigma)[later], said.verdict[later]
    first = {"position": "positions", "acceleration": "accelerations"}.get(
        transfer.matching.split("+")[0], "velocities"
    )
    for kind, name in enumerate((first, "attitudes")):
        rows = nu[verdict[:, kind] == USED, 3 * kind : 3 * kind + 3]
        if len(rows) < FEWEST:
            continue
        follows = np.sum(rows[1:] * rows[:-1], axis=0) / np.sum(rows**2, axis=0)
        columns = slice(3 * kind, 3 * kind + 3)
        slow = np.nanmean(lasting[columns] / said.sigma[later, columns] ** 2, axis=0)
        mean = np.abs(rows.mean(axis=0)) / np.sqrt(1.0 / len(rows) + slow)
        if np.any((mean > LOPSIDED) & (follows > STEADY)):
            return name
    return ""


def _masters_own(track: Track) -> Array:
    """(6,) variance, at the end, of what in the innovations is the master's own error, which does not change from row to row."""
    found = np.zeros(6)
    for first, name in ((0, VELOCITY_ERROR), (3, ATTITUDE_ERROR)):
        at = track.layout.slice_of(name)
        if at is not None:
            found[first : first + 3] = np.diag(track.P[-1])[at]
    return found


def _between(before: Array, after: Array) -> Array:
    """(3,) rotation vector from one mounting to another, rad."""
    return np.asarray(rotation_vector_from_dcm(before.T @ after))
