"""Evidence in words: templates of one language, filled with figures in the units people read.

A field of a template is ``{name}``, ``{name:spec}`` with Python's own specification, ``{name:unit|spec}`` (an SI figure
shown in a unit), ``{name:angle}`` (deg or arcmin, whichever is shorter) or ``{name:term}`` (a word of the language).
"""

from __future__ import annotations

import math
import string
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from truenorth.core.units import parse_unit, significant
from truenorth.state.evidence import Evidence


class Language(NamedTuple):
    """What a language needs: titles by status and by kind of evidence, sentences and remedies by key, words by term."""

    titles: Mapping[str, str]
    sentences: Mapping[str, str]
    remedies: Mapping[str, str]
    terms: Mapping[str, str]


class _Figures(string.Formatter):
    """Fills a template; the units are written by the template itself."""

    def __init__(self, terms: Mapping[str, str]) -> None:
        self.terms = terms

    def format_field(self, value: Any, format_spec: str) -> str:
        """One figure, in its unit."""
        if format_spec == "term":
            return self.terms.get(str(value), str(value))
        if format_spec == "angle":
            return angle(float(value))
        unit, bar, spec = format_spec.partition("|")
        if not bar:
            return format(value, format_spec)
        number = float(value) / parse_unit(unit)[0]
        return significant(number) if spec == "" else format(number, spec)


def angle(x: float) -> str:
    """An angle for people: ``0.51 deg``, ``12.30 arcmin``."""
    degrees = math.degrees(x)
    return f"{degrees:.2f} deg" if degrees >= 0.5 else f"{degrees * 60:.2f} arcmin"


def sentence(item: Evidence, options: Mapping[str, str] | None = None, language: Language | None = None) -> str:
    """One piece of evidence in words: what was seen, and after a colon what to do.

    Parameters
    ----------
    item : Evidence
    options : mapping of remedy to str, optional
        How a program offers a remedy, with fields of the same figures, such as ``--to {until:.0f}``; named in parentheses.
    language : Language, optional
        English when left out.
    """
    language = language or _english()
    words = _Figures(language.terms)
    text = words.vformat(language.sentences[item.key], (), item.figures)
    advice = []
    for remedy in item.remedies:
        what = words.vformat(language.remedies[remedy], (), item.figures)
        how = (options or {}).get(remedy)
        advice.append(what if how is None else f"{what} ({words.vformat(how, (), item.figures)})")
    text = f"warning: {text}" if item.urgent else text
    return f"{text}: {'; '.join(advice)}" if advice else text


def sentences(evidence: Iterable[Evidence], options: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """All of it in English, in its order."""
    return tuple(sentence(item, options) for item in evidence)


def headline(status: str, evidence: Sequence[Evidence], language: Language | None = None) -> str:
    """A verdict in a few words: of an inconsistent result, what contradicts it."""
    titles = (language or _english()).titles
    what = evidence[0].key.partition(".")[0] if evidence and status == "inconsistent" else status
    return titles.get(what, titles[status])


def _english() -> Language:
    from truenorth.state.english import ENGLISH

    return ENGLISH
