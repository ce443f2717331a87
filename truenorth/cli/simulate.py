"""`truenorth simulate`: from a scenario file to logs, truth and a figure."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from truenorth.cli.console import drawing, make_console, print_written
from truenorth.cli.options import argument, command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth simulate --list
  truenorth simulate quay -o quay
  truenorth simulate my_scenario.yaml -o result --seed 7 --csv
  truenorth simulate van -o runs --runs 20 --no-plot
  truenorth simulate van --show > my_scenario.yaml

Exit codes: 0 done; 2 wrong usage; 3 a scenario with a mistake.
"""


@command(EXAMPLES)
def simulate(
    scenario: Annotated[str | None, argument("A YAML file, or the name of a scenario that ships with us.")] = None,
    output: Annotated[Path | None, option("Folder for the results.", "-o", "--output", panel="Files")] = None,
    seed: Annotated[int | None, option("In place of the scenario's own.", min=0, panel="Runs")] = None,
    run: Annotated[int, option("Number of the run; it draws its own errors.", min=0, panel="Runs")] = 0,
    runs: Annotated[
        int | None, option("So many runs from --run on, each in a folder of its own.", min=1, panel="Runs")
    ] = None,
    csv: Annotated[bool, option("Logs and truth as CSV instead of Parquet.", "--csv", panel="Files")] = False,
    plot: Annotated[bool, option("Also draw figure.png.", "--plot/--no-plot", panel="Files")] = True,
    list_: Annotated[bool, option("List the scenarios that ship with us.", "--list", panel="The scenario")] = False,
    show: Annotated[
        bool, option("Print the scenario with all its defaults; simulate nothing.", "--show", panel="The scenario")
    ] = False,
) -> None:
    """Simulate a scenario: the IMU's log and those of its aiding sensors, and the truth that made them."""
    from truenorth.core.errors import UsageError
    from truenorth.simulation.scenario import read_scenario, shipped

    console = make_console()
    if list_:
        width = max(map(len, shipped()))
        for name, description in shipped().items():
            console.print(f"{name:{width}}  {description}", soft_wrap=True)
        return
    if scenario is None:
        raise UsageError("no scenario; name a YAML file or one of those that `truenorth simulate --list` shows")
    chosen = read_scenario(scenario)
    if show:
        import yaml

        print(yaml.safe_dump(chosen.to_mapping(), sort_keys=False, allow_unicode=True, width=110), end="")
        return
    if output is None:
        raise UsageError("no output folder; name one with -o")
    from truenorth.core.atomic import writable_folder
    from truenorth.simulation.folder import check_folder, save_run

    writable_folder(output)  # before the work, not after it
    plot = plot and drawing()
    drawn_with = chosen.seed if seed is None else seed
    suffix: Any = "csv" if csv else "parquet"
    numbers = range(run, run + (1 if runs is None else runs))
    for number in numbers:  # all of them before the first is written
        check_folder(chosen, _folder(output, runs, number), suffix, plot)
    shared = None if chosen.is_drawn or len(numbers) == 1 else chosen.ideal()
    paths: list[Path] = []
    for number in _with_bar(numbers):
        simulated = chosen.simulate(seed=drawn_with, run=number, ideal=shared)
        folder = _folder(output, runs, number)
        paths = save_run(chosen, simulated, folder, seed=drawn_with, run=number, suffix=suffix, plot=plot)
    if runs is None:
        print_written(paths)
    else:
        console.print(f"wrote {len(numbers)} runs into {output}", soft_wrap=True)


def _folder(output: Path, runs: int | None, number: int) -> Path:
    return output if runs is None else output / f"run_{number:04d}"


def _with_bar(numbers: range) -> Iterable[int]:
    """The runs, with a progress bar on standard error where there are several and a person looks at it."""
    if len(numbers) == 1 or not sys.stderr.isatty():
        return numbers
    from rich.progress import track

    return track(numbers, description="simulating", console=make_console(stderr=True))
