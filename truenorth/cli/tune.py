"""`truenorth tune`: search the noise figures to give a method in a scenario, and judge them on fresh data."""

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
A search:
  name: harbour
  scenario: quay
  method: kalman
  search: {accel.random_walk: [1 ug/sqrt(Hz), 1000 ug/sqrt(Hz)]}
  runs: 20
  trials: 40
\b
Examples:
  truenorth tune harbour.yaml -o harbour
  truenorth align ship.csv --lat 53.5 --imu harbour/tuned.yaml
\b
Exit codes: 0 done; 2 wrong usage; 3 a search with a mistake, or one without an answer.
"""


def tune(
    search: Annotated[Path, typer.Argument(help="YAML file: scenario, method, ranges.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the result.", show_default=False)],
) -> None:
    """Search for the specification with which a method errs least and says so honestly, with the extra 'tune'."""
    from truenorth.campaign.tuning import read_search
    from truenorth.campaign.tuning import tune as search_for
    from truenorth.core.atomic import writable_folder

    chosen = read_search(search)
    writable_folder(output)  # before the work, not after it
    with _bar() as progress:
        result = search_for(chosen, progress=progress)
    console = make_console()
    for row in result.judged.to_dict("records"):
        verdict = "honest" if row["in_band"] else "not honest"
        errors = f"RMS {row['rms']:.3g} arcmin ({row['rms_low']:.3g} to {row['rms_high']:.3g})"
        honesty = f"RMS/sigma {row['rms_over_sigma']:.2f}, NEES {row['nees']:.2f}: {verdict}"
        data = f"{row['answers']} runs of seed {row['seed']}, which the search never saw"
        console.print(f"{row['specification']}: {chosen.quantity} {errors}, {honesty}; {data}", soft_wrap=True)
    for path in result.save(output):
        console.print(f"wrote {path}", soft_wrap=True)


@contextmanager
def _bar() -> Iterator[Callable[[int, int], None] | None]:
    """Trials done and time left, on standard error where a person looks at it."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import Progress

    with Progress(console=make_console(stderr=True)) as progress:
        task = progress.add_task("trials", total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


tune.__doc__ = f"{tune.__doc__}\n{EXAMPLES}"
