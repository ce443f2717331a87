"""What a check saw in the data, and what that does to the answer: figures, never text."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["note", "hint", "known", "bounded", "unknown"]
Figure = float | int | str
OUTPUTS = ("heading", "level", "velocity", "position")


@dataclass(frozen=True)
class Effect:
    """One figure for each output of an alignment or a navigation: an error, or a sigma."""

    heading: float = 0.0  # rad
    level: float = 0.0  # rad
    velocity: float = 0.0  # m/s
    position: float = 0.0  # m; zero: no effect; infinite: of unknown size

    def items(self) -> list[tuple[str, float]]:
        """Name and size of each output's figure."""
        return [(name, getattr(self, name)) for name in OUTPUTS]

    def joined(self, other: Effect) -> Effect:
        """The root of the sum of squares of two independent errors."""
        if other is NO_EFFECT:
            return self
        return Effect(*(math.hypot(a, b) for (_, a), (_, b) in zip(self.items(), other.items(), strict=True)))

    def or_larger(self, other: Effect) -> Effect:
        """The larger of each of two effects."""
        return Effect(*(max(a, b) for (_, a), (_, b) in zip(self.items(), other.items(), strict=True)))

    def times(self, factor: float) -> Effect:
        """So many times as large."""
        return Effect(*(factor * size for _, size in self.items()))


NO_EFFECT = Effect()
ANY_EFFECT = Effect(math.inf, math.inf, math.inf, math.inf)


@dataclass(frozen=True)
class Evidence:
    """What one check saw."""

    # what was seen, such as ``drift.step``; the text that belongs to it stands in :mod:`truenorth.state.english`
    key: str
    figures: Mapping[str, Figure] = field(default_factory=dict)  # what the text needs, SI
    # ``note``: worth knowing, no effect. ``hint``: an error that chance may have shown, of a known one-sigma size if it is there.
    # ``known``: an error whose one-sigma size is known. ``bounded``: a suspicion that, if it is true, has an effect of at most
    # this size. ``unknown``: the model does not hold, and nobody knows what that does.
    kind: Kind = "note"
    # one sigma, or the bound, of the error in each output; an output whose effect is zero is not touched
    effect: Effect = NO_EFFECT
    remedies: tuple[str, ...] = ()  # what to do, as keys; a program that knows its options names them
    urgent: bool = False  # of a note: worth a warning to a person who reads nothing else

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON: an infinite effect is the word ``unknown``."""
        return {
            "key": self.key,
            "kind": self.kind,
            "figures": {k: _plain(v) for k, v in self.figures.items()},
            "effect": {name: "unknown" if math.isinf(size) else size for name, size in self.effect.items() if size},
            "remedies": list(self.remedies),
        }


def contradiction(key: str, *remedies: str, effect: Effect = ANY_EFFECT, **figures: Figure) -> Evidence:
    """Evidence that the model does not hold, with an effect of unknown size."""
    return Evidence(key, figures, "unknown", effect, remedies)


def note(key: str, *remedies: str, urgent: bool = False, **figures: Figure) -> Evidence:
    """Evidence without an effect."""
    return Evidence(key, figures, remedies=remedies, urgent=urgent)


def notes(texts: tuple[str, ...] | list[str]) -> list[Evidence]:
    """What a reader of files has to say of them, in its own words."""
    return [note("text", text=text) for text in texts]


def _plain(figure: Figure) -> Figure | None:
    if isinstance(figure, str):
        return figure
    return figure if math.isfinite(figure) else None
