"""A slave that an engine shakes, some way from its master: rates whose phase at a master's row the delay does not tell.

A velocity row holds ``C (w x r)`` of the arm `r` between both, with the rate `w` at the row. A delay that is known to s seconds
leaves the phase of a tone of `f` Hz at the row uncertain by ``2 pi f s``. Up to a radian the filter's columns are lines; beyond,
a row of 10 Hz and a vibration of 10 Hz are explained by any delay, each with another arm: an aircraft's was 17 sigmas off, and
its level 5. The slow part of the motion shows the delay to milliseconds, within a pass; until then what is faster tells of no arm
and no delay: the rows have the slow part of the rate, both parts being split by
frequency, so that neither holds anything of the other.

What is left in a row is ``w~ x r`` of the fast part. It is no white noise: a vibration at a whole number of the rows' frequency is
alike in all of them. The phase is not known, so it is a sum of ``w~`` and of what is a quarter of a period later (its Hilbert
transform), by the cosine and sine of a phase of which all are equally likely. What the filter makes of each, along each axis of
the arm, is found by running it with that added, and half of the sum of squares is in sigma.

The rule is ours. Hilbert transform: A. Oppenheim, R. Schafer, "Discrete-time signal processing", 3rd ed. (2010), chapter 12.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Matched
from truenorth.alignment.transfer_filter import Assumed, Linear
from truenorth.alignment.transfer_turns import shaken
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.errors.master import ARM, TransferModel
from truenorth.records import ImuRecord, MasterRecord
from truenorth.state.evidence import Effect, Evidence
from truenorth.state.judge import weight
from truenorth.state.layout import DV, PHI
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]


def shaken_evidence(
    run: Callable[..., Track],
    track: Track,
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    start: Start,
    assumed: Assumed,
    linear: Linear | None,
    what: Matched,
) -> list[Evidence]:
    """What the fast part of the rates does to the answer, where there is one.

    Parameters
    ----------
    run : callable
        The filter, of a slave with a `model`, a `start` and a `master`.
    track : Track
        What it made of these.
    """
    if what.translation != "velocity" or linear is None or master.v_n is None:
        return []
    held = master.time - assumed.delay - linear.delay - linear.late
    rates = shaken(slave, held, model.gyro_random_walk, min(assumed.delay_sigma, linear.phase))
    if rates is None:
        return []
    arm, off = _arm_of(track, assumed), []
    C_nb = linear.C_nb if linear.C_late is None else linear.C_late
    for part in (rates.fast, rates.quarter):
        for swing in np.diag(arm):
            added = np.nan_to_num(np.einsum("kij,kj->ki", C_nb, np.cross(part, swing)))
            other = run(slave, model=model, start=start, master=replace(master, v_n=master.v_n + added))
            phi = rotation_vector_from_dcm(other.C_nb[-1] @ track.C_nb[-1].T)
            off.append(np.concatenate([phi, other.v_n[-1] - track.v_n[-1]]))
    sizes = np.sqrt(0.5 * np.sum(np.square(off), axis=0))
    effect = Effect(heading=float(sizes[2]), level=float(np.max(sizes[:2])), velocity=float(np.max(sizes[3:])))
    own = np.sqrt(np.diagonal(track.P[-1]))
    least = Effect(float(own[PHI][2]), float(np.min(own[PHI][:2])), float(np.min(own[DV])))
    if weight(effect, least) <= limit("negligible"):  # nothing is added for it: not worth a word
        return []
    size = float(np.sqrt(np.mean(np.sum(rates.fast**2, axis=1)) * (arm @ arm)))
    return [Evidence("transfer.shaken", {"size": size, "level": effect.level}, "hint", effect)]


def _arm_of(track: Track, assumed: Assumed) -> Array:
    """(3,) m: size of each component of the lever arm in the end, its sigma included."""
    at = track.layout.slice_of(ARM)
    found, sigma = (0.0, 0.0) if at is None else (track.sensors[-1, at], track.sigma[-1, at])
    return np.asarray(np.hypot(assumed.lever_arm + found, sigma))
