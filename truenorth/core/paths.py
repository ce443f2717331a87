"""Paths that callers give."""

from __future__ import annotations

from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from truenorth.core.atomic import noted
from truenorth.core.errors import UsageError

LONGEST = 255  # bytes, of a file's name


def as_path(given: Any, what: str) -> Path:
    """A path of what was given to be read: a running command does not write over it.

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
    noted(path)
    return path


def is_file(path: Path) -> bool:
    """Whether there is such a file; a name that no file can have is none's, and a folder that cannot be looked into has none."""
    with suppress(OSError):
        return path.is_file()
    return False


def is_folder(path: Path) -> bool:
    """The same for a folder."""
    with suppress(OSError):
        return path.is_dir()
    return False


def unreadable(path: Path, error: OSError) -> UsageError:
    """That a file cannot be read, why, and which one of its folder may have been meant."""
    why = f"{path}: cannot be read ({error.strerror or error})"
    if not isinstance(error, FileNotFoundError):
        return UsageError(why)
    try:
        near = get_close_matches(path.name, [item.name for item in path.parent.iterdir()], n=1)
    except OSError:
        return UsageError(why)
    return UsageError(f"{why}; {near[0]} is there: was it meant?" if near else why)
