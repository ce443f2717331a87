"""What innovations show to have begun on the way: a drift of the base, a step of a bias, the gravity of the other hemisphere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import bias_signatures, bias_step_evidence
from truenorth.alignment.coloured import weighed_by_colour
from truenorth.alignment.drift import Drift, detect_drift, drift_signatures
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.hemisphere import hemisphere_evidence, hemisphere_signature
from truenorth.alignment.loud_rows import loud_rows_evidence
from truenorth.alignment.masked import masked_evidence
from truenorth.alignment.matched import innovations_of, matched, matched_whole
from truenorth.alignment.steps_in_turn import steps_in_turn
from truenorth.alignment.sway_noise import sway_noise_evidence
from truenorth.alignment.swaying import SwayAlignment
from truenorth.alignment.swing import swing_note
from truenorth.alignment.warming_up import warming_evidence
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence

Array = NDArray[np.float64]


def what_begins(
    fine: FineAlignment,
    spec: ImuSpec,
    position: Position,
    others: Array | None = None,
    *,
    given: bool = True,
    sways: bool = False,
) -> tuple[Drift, list[Evidence], list[Evidence]]:
    """The drift that matches best, evidence of a bias that steps, and of the other hemisphere; `others` explain what they can.

    Parameters
    ----------
    others : (K, m, M) array, optional
        As of :func:`truenorth.alignment.matched.innovations_of`.
    given : bool
        Whether somebody has given the specification: then its noise is held against the log.
    sways : bool
        Whether the base does: then the colour of the innovations counts.
    """
    seen = innovations_of(fine, others)
    banks = drift_signatures(fine), bias_signatures(fine)
    drift, bias = matched(seen, *banks)
    gravity = matched_whole(seen, hemisphere_signature(fine, position))
    rival = float(max(drift.ratio.max(), bias.ratio.max()))
    if sways:
        drift, bias = weighed_by_colour(seen, banks, (drift, bias))
    in_turn = sways and not given
    steps = steps_in_turn(fine, spec, bias, others) if in_turn else bias_step_evidence(fine, spec, bias)
    steps += masked_evidence(fine, spec)
    elsewhere = None
    if isinstance(fine, SwayAlignment):
        elsewhere = fine.misfit_at
        steps += [*fine.begun, *([] if fine.slow_arm is None else [swing_note(fine.motion)])]
        steps += warming_evidence(fine, seen, rival) if sways else []
        steps += (
            [*sway_noise_evidence(fine.noisier, spec, position.lat), *loud_rows_evidence(fine, spec)] if given else []
        )
    return detect_drift(fine, drift), steps, hemisphere_evidence(gravity, fine, position, elsewhere, given=given)


def level_step_evidence(fine: FineAlignment, spec: ImuSpec) -> list[Evidence]:
    """A step of an accelerometer's bias, of a log of which level alone is known: heading and its gyros' biases are not asked."""
    seen, bank = innovations_of(fine), bias_signatures(fine)
    (match,) = weighed_by_colour(seen, (bank,), matched(seen, bank))
    left = match.left.copy()
    left[2] = 0.0
    accel = np.arange(len(match.ratio)) % 6 >= 3
    steps = bias_step_evidence(fine, spec, match._replace(ratio=np.where(accel, match.ratio, 0.0), left=left))
    return [replace(step, key="bias.accel_steps_level") for step in steps]
