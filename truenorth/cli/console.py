"""What a person sees in the terminal: names of files and reasons are printed as they are, never read as markup."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def make_console(*, stderr: bool = False) -> Console:
    """A console that takes brackets for brackets, also those in the name of a log such as ``run[red].csv``."""
    from rich.console import Console

    return Console(stderr=stderr, highlight=False, markup=False, emoji=False)
