"""May the answer of an alignment on the move be used? What its measurements say, and what a poor heading needs."""

from __future__ import annotations

from truenorth.alignment.result import Alignment
from truenorth.alignment.verdict import claimed, judged
from truenorth.estimate.rivals import counted_once
from truenorth.quality.innovations import innovation_evidence
from truenorth.quality.mounting import RECEIVER, mounting_evidence
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import is_estimated
from truenorth.state.track import Track


def judge_moving(answer: Alignment, track: Track, limit: float, more: list[Evidence]) -> Alignment:
    """The answer with its verdict; `limit` is the largest one-sigma heading error of use, rad."""
    by_motion = answer.method == "motion"
    needs: tuple[str, ...] = ()
    if by_motion:
        needs = ("manoeuvre_gnss" if any("GNSS" in r.name for r in track.residuals) else "north",)
    evidence = [*_wheel(answer), *innovation_evidence(track.residuals, claimed(answer), by_motion=by_motion), *more]
    evidence += mounting_evidence(track, (RECEIVER,))
    return judged(answer, counted_once(evidence), limit, waiting=not by_motion, remedies=needs)


def _wheel(answer: Alignment) -> list[Evidence]:
    """What was found of the odometer."""
    moving = answer.moving
    if moving is None or moving.wheel is None:
        return []
    wheel, layout = moving.wheel, moving.track.layout
    return [
        note("odometer.scale", name=wheel.sensor, scale=wheel.scale, sigma=wheel.scale_sigma)
        for name, prior in zip(layout.names, layout.priors, strict=True)
        if name == f"{wheel.sensor} scale" and is_estimated(wheel.scale_sigma, prior[0])
    ]
