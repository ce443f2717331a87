"""The reader's language: English texts and their translations from a gettext catalogue.

English text is the key. Mark a text by `translated`, and a template with figures by ``translated("... {x} ...").format(x=...)``.

What is raised as an exception, or found in a log, is English, since programs read it too. At the edge `retold` says it in the
language in force: the catalogue holds the templates of all messages, with their figures as ``{0}``, ``{1}``, .., and the one that
fits gives them back. What no template fits, such as the message of another library inside ours, stays as it is.
"""

from __future__ import annotations

import gettext
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from truenorth.core.errors import UsageError

LANGUAGES = {"en": "English", "zh": "简体中文"}
FRAME = "{0}: {1}"
FOLDER = Path(__file__).resolve().parent.parent / "locale"

_chosen: ContextVar[str] = ContextVar("language", default="en")


def translated(text: str) -> str:
    """Return the text in the language in force; English where no translation exists."""
    return text if _chosen.get() == "en" else _catalogue(_chosen.get()).gettext(text)


def language() -> str:
    """Code of the language in force, such as ``en``."""
    return _chosen.get()


@contextmanager
def in_language(code: str) -> Iterator[None]:
    """Make pages and messages inside speak this language.

    Parameters
    ----------
    code : str
        A key of `LANGUAGES`.

    Raises
    ------
    UsageError
        A language that is not known.
    """
    before = _chosen.get()
    speak(code)
    try:
        yield
    finally:
        _chosen.set(before)


def speak(code: str) -> None:
    """Set the language from here on; see `in_language`."""
    if code not in LANGUAGES:
        raise UsageError(f"language {code!r} is not known; choose one of {', '.join(LANGUAGES)}")
    _chosen.set(code)


def retold(message: str) -> str:
    """A message of the library in the language in force; figures, and words that no catalogue has, as they are."""
    if _chosen.get() == "en" or not message:
        return message
    escaped = message.replace("{", "{{").replace("}", "}}")
    if (found := translated(escaped)) != escaped:
        return found.format()
    whole, (source, colon, rest) = _fitting(message), message.partition(": ")
    if colon and (part := _fitting(rest)) is not None and (whole is None or part[0] > whole[0]):
        return translated(FRAME).format(source, retold(rest))  # the name of a file before a message of its own
    return message if whole is None else whole[1].format(*(retold(group) for group in whole[2]))


def _fitting(message: str) -> tuple[int, str, tuple[str, ...]] | None:
    """The most telling template that a message was made from: its fixed characters, its translation, the figures."""
    for pieces, pattern, said in _templates(_chosen.get()):
        if all(piece in message for piece in pieces) and (match := re.fullmatch(pattern, message, re.DOTALL)):
            return sum(map(len, pieces)), said, match.groups()
    return None


@cache
def _templates(code: str) -> list[tuple[list[str], str, str]]:
    """Of each template the fixed pieces, a pattern that gives its figures, and its translation; the most telling first."""
    found = []
    for text, said in _catalogue(code)._catalog.items():  # type: ignore[attr-defined]
        if isinstance(text, str) and "{0}" in text:
            pieces = [piece.replace("{{", "{").replace("}}", "}") for piece in re.split(r"\{\d+\}", text)]
            found.append((pieces, "(.*?)".join(map(re.escape, pieces)), said))
    return sorted(found, key=lambda entry: -sum(map(len, entry[0])))


@cache
def _catalogue(code: str) -> gettext.NullTranslations:
    return gettext.translation("truenorth", FOLDER, [code])
