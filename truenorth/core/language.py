"""The reader's language: English texts and their translations from a gettext catalogue.

English text is the key. Mark a text by `translated`, and a template with figures by ``translated("... {x} ...").format(x=...)``.
"""

from __future__ import annotations

import gettext
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from truenorth.core.errors import UsageError

LANGUAGES = {"en": "English", "zh": "简体中文"}
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


@cache
def _catalogue(code: str) -> gettext.NullTranslations:
    return gettext.translation("truenorth", FOLDER, [code])
