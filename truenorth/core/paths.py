"""Paths that callers give."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from truenorth.core.errors import UsageError

LONGEST = 255  # bytes, of a file's name


def as_path(given: Any, what: str) -> Path:
    """A path of what was given.

    Raises
    ------
    UsageError
        No text and no path, or a text that no file can be named by; the message begins with `what`.
    """
    try:
        path = Path(given)
    except TypeError:
        raise UsageError(f"{what} is a {type(given).__name__}; expected a path") from None
    if "\0" in str(path):
        raise UsageError(f"{what} {str(path)!r}: no file has such a name")
    if any(len(part.encode("utf-8", "surrogateescape")) > LONGEST for part in path.parts):
        raise UsageError(f"{what} {str(path)[:60]!r}...: no file has so long a name")
    return path
