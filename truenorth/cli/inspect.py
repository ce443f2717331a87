"""`truenorth inspect`: what a log holds, and what is wrong with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from truenorth.cli.reading import Axes, Columns, Format, From, Log, Rate, To, Units, read_log

EXAMPLES = """
Examples:

  truenorth inspect log.csv

  truenorth inspect log.csv --lat 34.2 --plot log.png

  truenorth inspect bag/ --axes FLU --json
"""


def inspect(
    log: Log,
    lat: Annotated[
        float | None, typer.Option(help="Latitude, deg: lets the earth's rate be checked.", show_default=False)
    ] = None,
    axes: Axes = None,
    units: Units = None,
    rate: Rate = None,
    columns: Columns = None,
    format: Format = None,
    start: From = None,
    stop: To = None,
    plot: Annotated[Path | None, typer.Option(help="Write a figure (.png, .svg, .pdf).", show_default=False)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Look at a log: rate, gaps, frozen or saturated samples, likely unit and axes mistakes, motion, noise."""
    import math

    from truenorth.atomic import atomic_path, writable_folder
    from truenorth.quality import inspect as inspect_record

    if plot is not None:
        writable_folder(plot.parent)
    record = read_log(log, axes=axes, units=units, rate=rate, columns=columns, format=format, start=start, stop=stop)
    found = inspect_record(record, None if lat is None else math.radians(lat))
    if plot is not None:
        with atomic_path(plot) as path:
            found.plot().savefig(path)
    if as_json:
        print(json.dumps(found.to_dict(), allow_nan=False))
        return
    from rich.console import Console

    console = Console(highlight=False)
    console.print(found.table())
    colours = {"error": "red", "warning": "yellow", "note": "cyan"}
    for finding in found.findings:
        console.print(f"[{colours[finding.severity]}]{finding.severity}[/] ", end="")
        console.print(finding.message, markup=False, soft_wrap=True)
    if not found.findings:
        console.print("nothing wrong was found")
    if plot is not None:
        console.print(f"wrote {plot}", soft_wrap=True)


inspect.__doc__ = f"{inspect.__doc__}\n{EXAMPLES}"
