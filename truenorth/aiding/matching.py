"""What of a master is matched: one of its velocity, position and acceleration, its attitude, or both kinds together."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple, get_args

from truenorth.core.errors import UsageError
from truenorth.records import MasterRecord

What = Literal[
    "auto", "velocity", "attitude", "both", "position", "acceleration", "position+attitude", "acceleration+attitude"
]
Translation = Literal["velocity", "position", "acceleration"]

# White noise to begin the fit with: m/s, m, m/s^2 and rad.
FIRST_NOISE = {"velocity": 0.1, "position": 1.0, "acceleration": 0.02, "attitude": math.radians(0.05)}


class Matched(NamedTuple):
    """Which rows of the master are taken."""

    translation: Translation | None
    attitude: bool

    @property
    def name(self) -> What:
        """As it is asked for."""
        if self.translation is None:
            return "attitude"
        if not self.attitude:
            return self.translation
        return "both" if self.translation == "velocity" else f"{self.translation}+attitude"  # type: ignore[return-value]

    @property
    def kind(self) -> Translation:
        """The translation whose place in the rows is taken, or would be."""
        return self.translation or "velocity"

    def __str__(self) -> str:
        return " and ".join(
            [*([self.translation] if self.translation else []), *(["attitude"] if self.attitude else [])]
        )


def matched(asked: What, master: MasterRecord) -> Matched:
    """What is asked for; "auto": velocity and attitude, as far as the master has them.

    Raises
    ------
    UsageError
        An unknown matching, or a master that lacks what it needs.
    """
    if asked not in get_args(What):
        raise UsageError(f"matching {asked!r} is not known; choose one of {', '.join(get_args(What))}")
    has = {"velocity": master.v_n is not None, "attitude": master.C_nb is not None}
    if asked == "auto":
        return Matched("velocity" if has["velocity"] else None, has["attitude"])
    parts = ["velocity", "attitude"] if asked == "both" else asked.split("+")
    found = Matched(next((p for p in get_args(Translation) if p in parts), None), "attitude" in parts)
    needs = {
        "velocity": ["velocity"],
        "attitude": ["attitude"],
        "position": ["velocity", "position"],  # of these the slave's start
        "acceleration": ["velocity", "attitude", "specific force"],
    }
    has |= {"position": master.lat is not None, "specific force": master.f_b is not None}
    missing = [each for part in parts for each in needs[part] if not has[each]]
    if missing:
        raise UsageError(f"{master.source}: matching {asked!r} needs its {missing[0]}, which it does not hold")
    return found


def first_noise(what: Matched, given: dict[str, float | None]) -> tuple[tuple[float, float], list[bool]]:
    """Noise of translation and attitude to begin with (infinite: not matched), and whether each is to be fitted.

    Raises
    ------
    UsageError
        A noise that is not positive, or of what is not matched.
    """
    taken = {what.translation, "attitude" if what.attitude else None}
    for name, value in given.items():
        if value is not None and not 0.0 < value < math.inf:
            raise UsageError(f"{name}_noise is {value}; expected a positive one-sigma, or nothing: it is fitted then")
        if value is not None and name in ("position", "acceleration") and name not in taken:
            raise UsageError(f"{name}_noise is given, and {what} is matched; leave it out, or match {name}")

    def begin(name: str | None) -> tuple[float, bool]:
        if name not in taken or name is None:
            return math.inf, False
        value = given[name]
        return (FIRST_NOISE[name], True) if value is None else (value, False)

    (first, fit_first), (second, fit_second) = begin(what.translation), begin("attitude")
    return (first, second), [fit_first, fit_second]
