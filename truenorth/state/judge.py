"""May this answer be used? One judge for all results: their sigmas, what they must reach, and the evidence of all checks."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from truenorth.state.evidence import NO_EFFECT, Effect, Evidence
from truenorth.state.limits import limit

Finding = Literal["good", "level_only", "not_converged", "not_observable", "inconsistent"]


@dataclass(frozen=True)
class Claim:
    """What a result says of itself."""

    # one sigma of each output; infinite for one that it does not give. A heading beyond its limit counts as not given, unless
    # the sensors are `able` to give it.
    sigma: Effect
    # rad; largest one-sigma heading error of use; infinite: heading is not what the result is for
    heading_limit: float = math.inf
    floor: float = 0.0  # rad; the part of heading's sigma that waiting does not improve
    waiting: bool = True  # whether more of the same data improves heading at all
    hidden: bool = False  # whether the place, not the sensor, is what hides north
    able: bool = False  # whether the sensors, as specified, can give heading: one that they then do not give is missed


@dataclass(frozen=True)
class Verdict:
    """What the judge found.

    Attributes
    ----------
    finding : str
        ``good``, ``level_only``, ``not_converged``, ``not_observable`` or ``inconsistent``.
    sigma : Effect
        Of the outputs, what was added to them included.
    added : Effect
        One sigma of what was added.
    evidence : tuple of Evidence
        What decided first, then what was added to sigma, then the rest.
    """

    finding: Finding
    sigma: Effect
    added: Effect
    evidence: tuple[Evidence, ...]

    def status(self, good: str) -> str:
        """The status of a result that calls its good answers so."""
        return good if self.finding == "good" else self.finding


def judge(claim: Claim, evidence: Iterable[Evidence]) -> Verdict:
    """Weigh evidence against what a result says of itself.

    An effect that is small compared with sigma is a note. One whose size is known, or bounded by sigma, is added to sigma.
    What can make the answer wrong by more than sigma says makes the result inconsistent. An output that the result does
    not give cannot be made wrong. A hint, which chance gives sound logs too, is added however large it is: it refuses none.

    Parameters
    ----------
    claim : Claim
    evidence : iterable of Evidence
    """
    deciding, adding, hints, rest = [], [], [], []
    added = hinted = NO_EFFECT
    given = claim.sigma
    if given.heading > claim.heading_limit:  # refused, whatever else is found
        given = replace(given, heading=claim.heading_limit if claim.able else math.inf)
    for item in evidence:
        if item.kind == "note" or (size := weight(item.effect, given)) <= limit("negligible"):
            rest.append(item)
        elif item.kind == "hint" and math.isfinite(size):
            hinted = hinted.joined(_on(item.effect, given))
            hints.append(item)
        elif size <= (limit("growth") if item.kind == "known" else limit("bound")) and item.kind != "unknown":
            added = added.joined(_on(item.effect, given))
            adding.append(item)
        else:
            deciding.append(item)
    rest = _said_once(rest)
    # Many that are added each may be too much together.
    if not deciding and weight(added, given) > limit("growth"):
        deciding, adding = adding, []
    if deciding:
        return Verdict("inconsistent", claim.sigma, NO_EFFECT, (*deciding, *adding, *hints, *rest))
    added = added.joined(hinted)
    sigma = claim.sigma.joined(added)
    return Verdict(_reached(replace(claim, sigma=sigma)), sigma, added, (*adding, *hints, *rest))


def weight(effect: Effect, sigma: Effect) -> float:
    """The largest of the effects in units of their sigmas; nothing weighs on an output that is not given."""
    largest = 0.0
    for (_, e), (_, s) in zip(effect.items(), sigma.items(), strict=True):
        if e > 0.0 and math.isfinite(s):
            largest = max(largest, e / s if s > 0.0 else math.inf)
    return largest


def _said_once(notes: list[Evidence]) -> list[Evidence]:
    """Notes, of those that two checks have found on one axis at one time the likelier one."""
    best: dict[tuple[object, ...], Evidence] = {}
    for item in notes:
        seen = item.figures
        at = (
            (item.key, seen["axis"], round(float(seen["onset"])))
            if {"axis", "onset", "ratio"} <= set(seen)
            else (id(item),)
        )
        if at not in best or float(seen["ratio"]) > float(best[at].figures["ratio"]):
            best[at] = item
    return list(best.values())


def _on(effect: Effect, sigma: Effect) -> Effect:
    """An effect on the outputs that are given."""
    pairs = zip(effect.items(), sigma.items(), strict=True)
    return Effect(*(e if math.isfinite(s) else 0.0 for (_, e), (_, s) in pairs))


def _reached(claim: Claim) -> Finding:
    if math.isfinite(claim.sigma.level) and claim.sigma.level > limit("level"):
        return "not_converged"
    if claim.sigma.heading <= claim.heading_limit:
        return "good"
    if claim.hidden:
        return "not_observable"
    return "not_converged" if claim.waiting and claim.floor <= claim.heading_limit else "level_only"
