"""Results for a person to read: one HTML page each."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.core.atomic import atomic_path, write_text
from truenorth.core.shown import page_of

__all__ = ["write_report"]


def write_report(result: Any, path: str | PathLike[str]) -> Path:
    """Write the HTML page of a result: one file, everything inside, works offline.

    Parameters
    ----------
    result : Alignment, Navigation or a registered type with a page
    path : path

    Raises
    ------
    UsageError
        A result that has no page, or a folder that cannot be written to.
    """
    target = Path(path)
    with atomic_path(target) as temporary:
        write_text(temporary, page_of(result))
    return target
