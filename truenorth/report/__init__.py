"""Results on disk: a summary, the history, and one page that tells a person what to think of them."""

from __future__ import annotations

import json
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.core.atomic import atomic_files, atomic_path, writable_folder

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.navigation import Navigation

__all__ = ["save_alignment", "write_report"]


def write_report(result: Alignment | Navigation, path: str | PathLike[str]) -> Path:
    """Write the HTML page of a result: one file, everything inside, works offline.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    from truenorth.alignment import Alignment

    target = Path(path)
    if isinstance(result, Alignment):
        from truenorth.report.page import alignment_page

        page = alignment_page(result)
    else:
        from truenorth.report.navigation import navigation_page

        page = navigation_page(result)
    with atomic_path(target) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return target


def save_alignment(result: Alignment, folder: str | PathLike[str]) -> list[Path]:
    """Write summary.json, history.parquet (where there is a history) and report.html; each whole or not at all.

    All are written before the first takes its name, so that an interrupt leaves the files of an earlier result
    together; its history.parquet is removed where this result has none.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    from truenorth.navigation.start import navigation_block
    from truenorth.report.page import alignment_page

    target = writable_folder(folder)
    summary, history, report = (target / name for name in ("summary.json", "history.parquet", "report.html"))
    with atomic_files() as file:
        content = result.summary() | {"navigation": navigation_block(result)}  # what `truenorth navigate` goes on from
        text = json.dumps(content, indent=2, allow_nan=False) + "\n"
        file(summary).write_text(text, encoding="utf-8")
        if result.history is not None:
            result.to_frame().to_parquet(file(history))
        file(report).write_text(alignment_page(result), encoding="utf-8")
    if result.history is None:
        history.unlink(missing_ok=True)
        return [summary, report]
    return [summary, history, report]
