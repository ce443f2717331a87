"""`truenorth campaign`: thousands of simulated runs of a plan, summarised and reported."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Annotated

import typer

from truenorth.cli.console import make_console

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
A plan:
  name: which_gyro
  runs: 200
  scenarios: [static_kalman]        # names, files, or written out
  grid: {imu.gyro.bias: [0.003 deg/h, 0.01 deg/h, 0.03 deg/h]}
  methods: [kalman, oba]
  times: [120 s, 300 s]
\b
Examples:
  truenorth campaign which_gyro.yaml -o gyro
  truenorth campaign which_gyro.yaml -o gyro --workers 8
  truenorth campaign which_gyro.yaml -o gyro --scheduler tcp://head:8786
  truenorth campaign which_gyro.yaml -o gyro --runs 1000
\b
Started again on the same folder it goes on where it was.
\b
Exit codes: 0 done; 2 wrong usage; 3 a plan with a mistake.
"""


def campaign(
    plan: Annotated[Path, typer.Argument(help="YAML file: scenarios, grid, methods, runs.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the runs and the report.", show_default=False)
    ],
    runs: Annotated[int | None, typer.Option(min=1, help="In place of the plan's own.", show_default=False)] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; one for each core without it.", show_default=False)
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Dask scheduler, tcp://host:port, in place of processes.", show_default=False)
    ] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume/--no-resume", help="Go on with the runs that the folder holds, or remove them and begin anew."
        ),
    ] = True,
) -> None:
    """Simulate and align the runs of a plan, and report how large the errors are and whether sigma is honest."""
    from truenorth.campaign import read_plan, run_campaign

    chosen = read_plan(plan)
    if runs is not None:
        chosen = chosen.with_runs(runs)
    used = (
        workers or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else workers or os.cpu_count() or 1
    )
    with _bar() as progress:
        result = run_campaign(chosen, output, workers=used, scheduler=scheduler, resume=resume, progress=progress)
    console = make_console()
    table = result.summary
    last = table[table["time_s"] == table.groupby("case")["time_s"].transform("max")]
    for row in last[last["quantity"] == "phi_u"].to_dict("records"):
        honest = f"RMS/sigma {row['rms_over_sigma']:.2f} ({row['ratio_low']:.2f} to {row['ratio_high']:.2f} is honest)"
        console.print(
            f"{row['name']}, {row['method']}: heading RMS {row['rms']:.3g} arcmin over {row['runs']} runs, {honest}",
            soft_wrap=True,
        )
    for path in result.save():
        console.print(f"wrote {path}", soft_wrap=True)


@contextmanager
def _bar() -> Iterator[Callable[[int, int], None] | None]:
    """Runs done, runs a second and time left, on standard error where a person looks at it."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=make_console(stderr=True)) as progress:
        task = progress.add_task("runs", total=None, pace="")
        start: list[tuple[float, int]] = []  # when, and with how many that were there

        def tell(done: int, total: int) -> None:
            now = time.monotonic()
            if not start:
                start.append((now, done))
            since, before = start[0]
            words = pace(done - before, total - done, now - since)
            progress.update(task, completed=done, total=total, pace=words)

        yield tell


def pace(done: int, left: int, seconds: float) -> str:
    """Runs a second and time left, in words, from what was done since the start.

    Blocks of runs end together: any shorter stretch would promise too much.
    """
    if not (done and seconds > 0):
        return ""
    rate = done / seconds
    return f"{rate:.3g} runs/s, {timedelta(seconds=math.ceil(left / rate))} left"


campaign.__doc__ = f"{campaign.__doc__}\n{EXAMPLES}"
