"""Results on disk: a summary, the history, and one page that tells a person what to think of them."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.atomic import atomic_path, writable_folder

if TYPE_CHECKING:
    from truenorth.alignment import Alignment

__all__ = ["save_alignment", "write_report"]


def write_report(result: Alignment, path: str | PathLike[str]) -> Path:
    """Write the HTML page of a result: one file, everything inside, works offline.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    from truenorth.report.page import alignment_page

    target = Path(path)
    page = alignment_page(result)
    with atomic_path(target) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return target


def save_alignment(result: Alignment, folder: str | PathLike[str]) -> list[Path]:
    """Write summary.json, history.parquet (where there is a history) and report.html; each whole or not at all.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    target = writable_folder(folder)
    written = [target / "summary.json"]
    with atomic_path(written[0]) as temporary:
        temporary.write_text(json.dumps(result.summary(), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    if result.history is not None:
        written.append(target / "history.parquet")
        with atomic_path(written[-1]) as temporary:
            result.to_frame().to_parquet(temporary)
    written.append(write_report(result, target / "report.html"))
    return written
