"""What a person sees in the terminal: names of files and reasons are printed as they are, never read as markup."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def make_console(*, stderr: bool = False) -> Console:
    """A console that takes brackets for brackets, also those in the name of a log such as ``run[red].csv``."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)


@contextmanager
def stages(quiet: bool) -> Iterator[Callable[[str], None]]:
    """A spinner with the stage's name on standard error, where a person looks at it."""
    if quiet or not sys.stderr.isatty():
        yield lambda stage: None
        return
    from rich.text import Text

    with make_console(stderr=True).status("starting") as status:
        yield lambda stage: status.update(Text(stage))
