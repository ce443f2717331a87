"""Which biases change on a base that sways, one after the other, where nobody has said how sensors wander.

A change of one bias looks a little like larger ones of others: what a vertical accelerometer that wanders by 40 ug leaves looks
like 1.3 mg of a level one, which would turn heading by 2 deg. So the most plausible change explains what it can first, and what is
still there then is asked again (orthogonal matching pursuit). Plausible: twice the log-likelihood less what the prior says of so
large a change, which is normal with the bias that the log itself shows.

Source: Y. C. Pati, R. Rezaiifar and P. S. Krishnaprasad, Orthogonal matching pursuit, 27th Asilomar Conference, 1993.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SIGNATURES, bias_signatures, seen_of, step_evidence, wander_of
from truenorth.alignment.coloured import weighed_by_colour
from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import Match, innovations_of, matched
from truenorth.errors.staying import PHI
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence
from truenorth.state.limits import limit

Array = NDArray[np.float64]

MOST = 5  # changes
FREE = 3.0  # times its size, one sigma with which a change that was found explains what it can


class Change(NamedTuple):
    """A bias that changes: place among the signatures, twice the log-likelihood ratio, and size.

    `left` (3,), rad, is what it leaves; `likely` what the level accelerometers leave besides, if they change as the vertical one
    does: a sway hides theirs, and they are of the same maker, at the same temperature.
    """

    at: int
    ratio: float
    size: float
    left: Array
    likely: Array


def steps_in_turn(fine: FineAlignment, spec: ImuSpec, match: Match, others: Array | None) -> list[Evidence]:
    """Evidence of the steps and ramps of biases that are there together, with the error that they leave.

    Where the vertical one alone is seen to change, what level ones may do as well is in sigma, and refuses no log.

    Parameters
    ----------
    fine : FineAlignment
    spec : ImuSpec
        Inferred from the log.
    match : Match
        Of :func:`truenorth.alignment.bias_step.bias_signatures`.
    others : (K, m, M) array, optional
        As of :func:`truenorth.alignment.matched.innovations_of`.
    """
    found = [change for change in changes(fine, spec, match, others) if not _wanders(change, spec)]
    if not found:
        return []
    left = _all([change.left for change in found])
    worst = max(found, key=lambda change: change.ratio)
    (said,) = step_evidence(
        fine, worst.at, worst.ratio, worst.size, heading=float(left[2]), level=float(np.hypot(*left[:2]))
    )
    if not all(change.likely.any() for change in found):  # level ones that change are found themselves
        return [said]
    whole = _all([left, *(change.likely for change in found)])
    effect = Effect(heading=float(whole[2]), level=float(np.hypot(*whole[:2])))
    return [replace(said, effect=effect, kind="hint")]


def changes(fine: FineAlignment, spec: ImuSpec, match: Match, others: Array | None) -> list[Change]:
    """The changes of biases that explain the innovations, the most plausible of those that are left first."""
    found: list[Change] = []
    bank = bias_signatures(fine)
    vertical = 3 + int(np.argmax(np.abs((fine.C_n0_i @ fine.integrals.C_ib[-1])[2])))
    while len(found) < MOST and match.ratio.max() > limit("hint"):
        ratio, size, ends = match
        at = _most_plausible(ratio, size, spec)
        level = [at - at % 6 + axis for axis in range(3, 6) if axis != vertical] if at % 6 == vertical else []
        likely = _all([np.zeros(3), *(ends[PHI, k] * size[at] for k in level)])
        found.append(Change(at, float(ratio[at]), float(size[at]), np.abs(ends[PHI, at] * size[at]), likely))
        seen = seen_of(fine, FREE * size[at] * _course(at, len(fine.estimates.innovation)))
        others = seen if others is None else np.concatenate([others, seen], axis=2)
        innovations = innovations_of(fine, others)
        (match,) = weighed_by_colour(innovations, (bank,), matched(innovations, bank))
    return found


def _most_plausible(ratio: Array, size: Array, spec: ImuSpec) -> int:
    """Of the changes that are likelier than chance."""
    usual = np.where(np.arange(len(ratio)) % 6 < 3, spec.gyro_bias, spec.accel_bias)
    share = 1.0 / (1.0 + (size / usual) ** 2 / np.maximum(ratio, 1e-300))
    return int(np.argmax(np.where(ratio > limit("hint"), ratio * share, -np.inf)))


def _course(at: int, count: int) -> Array:
    """(K, 6, 1) a change of size one over so many epochs."""
    kind, onset = SIGNATURES[at // 6]
    begin = round(onset * count)
    course = np.zeros((count, 6, 1))
    course[begin:, at % 6, 0] = 1.0 if kind == "step" else np.arange(count - begin) / (count - begin)
    return course


def _wanders(change: Change, spec: ImuSpec) -> bool:
    return change.at % 6 >= 3 and abs(change.size) < wander_of(spec)


def _all(parts: list[Array]) -> Array:
    """Root of the sum of squares."""
    return np.sqrt(np.sum(np.square(parts), axis=0))
