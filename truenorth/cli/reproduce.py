"""`truenorth reproduce`: a published system, its figures and its claims, settled."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from truenorth.cli.console import make_console

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Studies:
  rotary    Self-alignment of a rotary SINS on a swaying ship
  transfer  Transfer alignment with residual time delay and lever arm
  damping   Double-filter external damping of a marine INS over 48 h
  static    Kalman filters for static alignment, with ten and with eight states
  odometer  Odometer-aided alignment on the move, from azimuth errors of 1 to 60 deg
  networks  Internal damping networks by design, and a fuzzy damping ratio (related work)
  gyro_free Angular rate from twelve accelerometers (related work)
  all       All of them, and index.html: which claims hold, in part, or not
\b
Examples:
  truenorth reproduce static -o static
  truenorth reproduce static --runs 50 --seed 3 -o static50
  truenorth reproduce all --runs 20 -o papers
\b
Exit codes: 0 done; 2 wrong usage.
"""


def reproduce(
    name: Annotated[str, typer.Argument(help="The study.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the results.", show_default=False)],
    runs: Annotated[
        int | None, typer.Option(min=2, help="Of each case; the study's own without it.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of all random numbers.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="That share the runs.")] = 1,
    full: Annotated[
        bool, typer.Option("--full", help="The paper's own lengths, where the study shortens them.")
    ] = False,
) -> None:
    """Reproduce a published system: figures.csv, the paper's figures, and claims.md with what holds."""
    from truenorth.core.atomic import writable_folder
    from truenorth.papers import STUDIES, save_all
    from truenorth.papers import reproduce as reproduced

    writable_folder(output)  # before the work, not after it
    names = list(STUDIES) if name == "all" else [name]
    with _stages() as progress:
        studies = {
            each: reproduced(each, runs=runs, seed=seed, full=full, workers=workers, progress=progress)
            for each in names
        }
    console = make_console()
    for study in studies.values():
        for claim in study.claims:
            console.print(f"{claim.verdict}: {claim.text}", soft_wrap=True)
    for path in save_all(studies, output) if name == "all" else studies[name].save(output):
        console.print(f"wrote {path}", soft_wrap=True)


@contextmanager
def _stages() -> Iterator[Callable[[str], None] | None]:
    """A spinner with the stage's name on standard error, where a person looks at it."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.text import Text

    with make_console(stderr=True).status("starting") as status:
        yield lambda stage: status.update(Text(stage))


reproduce.__doc__ = f"{reproduce.__doc__}\n{EXAMPLES}"
