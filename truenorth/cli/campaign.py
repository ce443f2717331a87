"""`truenorth campaign`: thousands of simulated runs of a plan, summarised and reported."""

from __future__ import annotations

import math
import os
from datetime import timedelta
from pathlib import Path
from typing import Annotated

from truenorth.cli.console import bar, drawing, make_console, print_written
from truenorth.cli.options import argument, command, option

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


@command(EXAMPLES)
def campaign(
    plan: Annotated[Path, argument("YAML file: scenarios, grid, methods, runs.")],
    output: Annotated[Path, option("Folder for the runs and the report.", "-o", "--output")],
    runs: Annotated[int | None, option("In place of the plan's own.", min=1, panel="Runs")] = None,
    workers: Annotated[int | None, option("Processes; one for each core without it.", min=1, panel="Runs")] = None,
    scheduler: Annotated[
        str | None, option("Dask scheduler, tcp://host:port, in place of processes.", panel="Runs")
    ] = None,
    resume: Annotated[
        bool,
        option(
            "Go on with the runs that the folder holds, or remove them and begin anew.",
            "--resume/--no-resume",
            panel="Runs",
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
    with bar("runs", pace) as progress:
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
    drawing()
    print_written(result.save())


def pace(done: int, left: int, seconds: float) -> str:
    """Runs a second and time left, in words, from what was done since the start.

    Blocks of runs end together: any shorter stretch would promise too much.
    """
    if not (done and seconds > 0):
        return ""
    rate = done / seconds
    return f"{rate:.3g} runs/s, {timedelta(seconds=math.ceil(left / rate))} left"
