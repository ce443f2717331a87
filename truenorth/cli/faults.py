"""`truenorth faults`: spoil simulated logs in all ways that are known, and count the wrong answers that pass in silence."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from truenorth.cli.console import make_console, print_written, stages
from truenorth.cli.options import command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth faults
  truenorth faults --procedure rotary --procedure swaying --runs 20
  truenorth faults --fault "late gyros" --fault none --seed 7 -o faults
\b
Exit codes: 0 no wrong answer passed in silence; 1 some did; 2 wrong usage.
"""


@command(EXAMPLES)
def faults(
    procedure: Annotated[list[str] | None, option("One or more; all without it.", panel="Trials")] = None,
    fault: Annotated[
        list[str] | None, option("One or more; all without it. 'none' is a sound log.", panel="Trials")
    ] = None,
    runs: Annotated[int, option("Of each procedure with each fault.", min=1, panel="Trials")] = 3,
    seed: Annotated[int, option("Of motions, errors, and sizes of the faults.", min=0, panel="Trials")] = 0,
    workers: Annotated[int, option("Processes that share the sound logs.", min=1, panel="Trials")] = 1,
    output: Annotated[
        Path | None, option("Folder for trials and tables; trials that it holds are not done again.", "-o", "--output")
    ] = None,
    before: Annotated[Path | None, option("trials.csv of an earlier version, for a column of faults.md.")] = None,
) -> None:
    """Try faults of logs, clocks, places and specifications on every procedure, with drawn sizes."""
    import pandas as pd
    from rich.table import Table

    from truenorth.campaign.fault_pages import keeper, page, read_trials
    from truenorth.campaign.faults import OUTCOMES, run_faults, table
    from truenorth.core.atomic import atomic_files, writable_folder, write_text
    from truenorth.core.errors import UsageError
    from truenorth.core.paths import is_file

    if before is not None and not is_file(before):
        raise UsageError(f"{before}: cannot be read (No such file)")
    folder = None if output is None else writable_folder(output)
    done = [] if folder is None else read_trials(folder / "trials.csv")
    keep = None if folder is None else keeper(folder / "trials.csv", done)
    with stages(False) as tell:
        how: dict[str, Any] = {"done": done, "workers": workers, "keep": keep, "progress": tell}
        trials = run_faults(procedure or (), fault or (), runs=runs, seed=seed, **how)
    rows = table(trials)
    console = make_console()
    shown = Table(box=None, pad_edge=False)
    for title in ("procedure", "fault", *OUTCOMES, "worst, sigmas"):
        shown.add_column(title, justify="left" if title in ("procedure", "fault") else "right")
    for row in rows:
        worst = f"{row['worst']:.1f}" if row["silent"] else ""
        shown.add_row(row["procedure"], row["fault"], *(str(row[name] or "") for name in OUTCOMES), worst)
    console.print(shown)
    if folder is not None:
        whole = read_trials(folder / "trials.csv")
        with atomic_files() as file:
            pd.DataFrame(table(whole)).to_csv(file(folder / "faults.csv"), index=False)
            text = page(whole, [] if before is None else read_trials(before))
            write_text(file(folder / "faults.md"), text)
        print_written(folder / name for name in ("trials.csv", "faults.csv", "faults.md"))
    if any(row["silent"] or row["crash"] for row in rows):
        raise typer.Exit(1)
