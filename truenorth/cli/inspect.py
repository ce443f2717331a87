"""`truenorth inspect`: what a log holds, and what is wrong with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from truenorth.cli.console import make_console, print_written
from truenorth.cli.files import LAYOUT
from truenorth.cli.options import AsJson, command, option
from truenorth.cli.reading import Log, ReadingWindow, in_line
from truenorth.cli.wording import in_options
from truenorth.core.language import retold
from truenorth.core.language import translated as _

FIGURES = (".png", ".svg", ".pdf")

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth inspect log.csv
  truenorth inspect log.csv --lat 34.2 --plot log.png
  truenorth inspect bag/ --axes FLU --json
  truenorth inspect any.csv --write-layout
  truenorth inspect day1.csv --write-layout day2.yaml
"""


@command(EXAMPLES)
def inspect(
    context: typer.Context,
    log: Log,
    reading: ReadingWindow,
    lat: Annotated[float | None, option("Latitude, deg: lets the earth's rate be checked.")] = None,
    plot: Annotated[Path | None, option("Write a figure (.png, .svg, .pdf).", panel="Files")] = None,
    layout: Annotated[
        str | None,
        option(
            "Write what the log was taken for as LOG.yaml next to it, or as the file that is named.",
            LAYOUT,
            metavar="[<file.yaml>]",
            panel="Files",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Look at a log: what it is taken for, rate, gaps, frozen or saturated samples, mistakes of units and axes, motion, noise."""
    from truenorth.core.atomic import atomic_path, writable_folder
    from truenorth.core.errors import DataError, UsageError
    from truenorth.core.position import Position

    place = None if lat is None else Position.from_degrees(lat, 0.0, 0.0)
    if plot is not None:
        if plot.suffix.lower() not in FIGURES:
            raise UsageError(f"--plot {plot}: cannot draw into this kind of file; use {', '.join(FIGURES)}")
        writable_folder(plot.parent)
    from truenorth.formats import write_layout
    from truenorth.quality import inspect as inspect_record

    try:
        record = reading.read(log)
    except DataError as error:
        for line in getattr(error, "__notes__", []):  # what was found before the question
            make_console(stderr=as_json).print(line, soft_wrap=True)
        raise
    found = inspect_record(record, None if place is None else place.lat)
    if plot is not None:
        with atomic_path(plot) as path:
            found.plot().savefig(path)
    written = (
        None
        if layout is None
        else write_layout(record, log, layout or None, replace=context.find_root().params["force"])
    )
    if as_json:
        taken = [guess._asdict() for guess in record.taken_for]
        print(json.dumps(found.to_dict() | {"taken_for": taken}, allow_nan=False))
        return
    console = make_console()
    for guess in record.taken_for:
        console.print(_("taken for {guess}").format(guess=in_line(guess)), soft_wrap=True)
    console.print(found.table())
    colours = {"error": "red", "warning": "yellow", "note": "cyan"}
    for finding in found.findings:
        console.print(finding.severity, end=" ", style=colours[finding.severity])
        console.print(in_options(retold(finding.message)), soft_wrap=True)
    if not found.findings:
        console.print(_("nothing wrong was found"))
    print_written(path for path in (plot, written) if path is not None)
