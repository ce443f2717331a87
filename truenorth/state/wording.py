"""Evidence in words: English templates, or their translations, filled with figures in the units people read.

A field of a template is ``{name}``, ``{name:spec}`` with Python's own specification, ``{name:unit|spec}`` (an SI figure
shown in a unit), ``{name:angle}`` (deg or arcmin, whichever is shorter), ``{name:term}`` (a word of the language) or
``{name:imu}`` (where a specification is from).
"""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from truenorth.core.language import retold, translated
from truenorth.core.units import parse_unit, significant
from truenorth.state.english import SENTENCES
from truenorth.state.evidence import Evidence
from truenorth.state.remedies import REMEDIES, TERMS
from truenorth.state.titles import TITLES

_FORMATTER = string.Formatter()


def _figure(value: Any, spec: str) -> str:
    """One figure, in its unit, which is written by the template itself."""
    if spec == "term":
        return translated(TERMS.get(str(value), str(value)))
    if spec == "imu":  # after the word "specification"
        return translated(TERMS.get(str(value), str(value).removeprefix("specification ")))
    if spec == "angle":
        return angle(float(value))
    if not spec and isinstance(value, str):  # a name, or what was found in a log
        return retold(value)
    unit, bar, digits = spec.partition("|")
    if not bar:
        return format(value, spec)
    number = float(value) / parse_unit(unit)[0]
    return significant(number) if digits == "" else format(number, digits)


@lru_cache(maxsize=1024)
def _parts_of(template: str) -> tuple[tuple[str, str | None, str | None, str | None], ...]:
    """Text, and the field behind it with its specification and conversion."""
    return tuple(_FORMATTER.parse(template))


def _filled(template: str, figures: Mapping[str, Any]) -> str:
    filled = []
    for text, name, spec, conversion in _parts_of(translated(template)):
        filled.append(text)
        if name is not None:
            filled.append(_figure(_FORMATTER.convert_field(figures[name], conversion), spec or ""))
    return "".join(filled)


def angle(x: float) -> str:
    """An angle for people: ``0.51 deg``, ``12.30 arcmin``; an effect beyond half a turn, as of a linear model, has no size."""
    degrees = math.degrees(x)
    if degrees > 180.0:
        return translated("more than 180 deg")
    return f"{degrees:.2f} deg" if degrees >= 0.5 else f"{degrees * 60:.2f} arcmin"


def sentence(item: Evidence, options: Mapping[str, str] | None = None) -> str:
    """One piece of evidence in words, in the language in force: what was seen, and after a colon what to do.

    Parameters
    ----------
    options : mapping of remedy to str, optional
        How a program offers a remedy, with fields of the same figures, such as ``--to {until:.0f}``; named in parentheses.
    """
    text = _filled(SENTENCES[item.key], item.figures)
    advice = []
    for remedy in item.remedies:
        what, how = _filled(REMEDIES[remedy], item.figures), (options or {}).get(remedy)
        advice.append(what if how is None else f"{what} ({_filled(how, item.figures)})")
    text = f"warning: {text}" if item.urgent else text
    return f"{text}: {'; '.join(advice)}" if advice else text


def sentences(evidence: Iterable[Evidence], options: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """All of it, in its order."""
    return tuple(sentence(item, options) for item in evidence)


def headline(status: str, evidence: Sequence[Evidence]) -> str:
    """A verdict in a few words of English: of an inconsistent result, what contradicts it."""
    what = evidence[0].key.partition(".")[0] if evidence and status == "inconsistent" else status
    return TITLES.get(what, TITLES[status])
