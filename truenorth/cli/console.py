"""What a person sees in the terminal: names of files and reasons are printed as they are, never read as markup."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.core.language import translated as _

if TYPE_CHECKING:
    from rich.console import Console

Progress = Callable[[int, int], None]  # done and total
COMPILING = "truenorth.core.kernel_store"  # the log that has a line for each kernel that is compiled
WITHOUT_TERMINAL = 400  # columns: wider than any table of ours


def make_console(*, stderr: bool = False) -> Console:
    """A console that takes brackets for brackets, also those in the name of a log such as ``run[red].csv``.

    A file or a pipe has no width: tables keep their columns whole there, and sentences their lines.
    """
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    width = None if stream.isatty() or "COLUMNS" in os.environ else WITHOUT_TERMINAL
    return Console(stderr=stderr, highlight=False, markup=False, emoji=False, width=width)


def drawing() -> bool:
    """Whether figures can be drawn; where not, it says so once: the rest is written all the same."""
    from truenorth.core.shown import NO_FIGURES, can_draw

    able = can_draw()
    if not able:
        print(f"truenorth: {NO_FIGURES}; none is written", file=sys.stderr)
    return able


@contextmanager
def stages(quiet: bool) -> Iterator[Callable[[str], None]]:
    """A spinner with the stage's name on standard error, where a person looks at it."""
    if quiet or not sys.stderr.isatty():
        yield lambda stage: None
        return
    from rich.text import Text

    with make_console(stderr=True).status("starting") as status:
        yield lambda stage: status.update(Text(stage))


class _Compiling(logging.Handler):
    """Says once why the first answer on a computer takes a minute."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print the note where the first kernel is compiled."""
        log = logging.getLogger(COMPILING)
        log.removeHandler(self)
        log.setLevel(logging.NOTSET)
        make_console(stderr=True).print(
            "compiling, once on this computer: the first answer takes up to a minute longer "
            "(truenorth warm compiles for all commands)"
        )


def explain_compiling() -> None:
    """Where a person looks at standard error, say what the wait is for when something has to be compiled."""
    if sys.stderr.isatty():
        log = logging.getLogger(COMPILING)
        log.addHandler(_Compiling())
        log.setLevel(logging.INFO)
        log.propagate = False


def in_reader_s_words(status: str) -> str:
    """A status as programs read it, and what it means where the reader's language is another."""
    from truenorth.core.language import language
    from truenorth.state.titles import TITLES

    return status if language() == "en" else f"{status} {_(TITLES[status])}"


def print_written(paths: Iterable[Path]) -> None:
    """Say which files were written."""
    console = make_console()
    for path in paths:
        console.print(_("wrote {path}").format(path=path), soft_wrap=True)


@contextmanager
def bar(
    what: str, pace: Callable[[int, int, float], str] = lambda done, left, seconds: ""
) -> Iterator[Progress | None]:
    """A function of done and total that moves a bar on standard error; None where no person looks at it.

    `pace` says in words how fast it goes, from what was done since the start, what is left, and the seconds it took.
    """
    if not sys.stderr.isatty():
        yield None
        return
    import time

    from rich import progress as rich

    columns = (
        rich.TextColumn(what),
        rich.BarColumn(),
        rich.MofNCompleteColumn(),
        rich.TextColumn("{task.fields[pace]}"),
    )
    with rich.Progress(*columns, console=make_console(stderr=True)) as shown:
        task = shown.add_task(what, total=None, pace="")
        start: list[tuple[float, int]] = []  # when, and with how many that were there

        def tell(done: int, total: int) -> None:
            now = time.monotonic()
            if not start:
                start.append((now, done))
            since, before = start[0]
            shown.update(task, completed=done, total=total, pace=pace(done - before, total - done, now - since))

        yield tell
