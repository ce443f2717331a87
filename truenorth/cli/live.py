"""`truenorth live`: heading while the log is still running."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.options import grouped
from truenorth.cli.reading import Rows, names_of

if TYPE_CHECKING:
    from truenorth.live.aligner import Aligner
    from truenorth.live.answer import Answer
    from truenorth.live.session import Listener

EXAMPLES = """
\b
Examples:
  truenorth live replay:log.csv@10x --lat 34.246 --imu navigation
  truenorth live udp://:9000 --lat 48.1 --imu tactical --until "0.1 deg" -o quay
  cat /dev/ttyUSB0 | truenorth live - --lat 48.1 --units deg/s,g --json
  truenorth live serial:/dev/ttyUSB0?baud=921600 --lat 48.1 --nmea > heading.nmea
  truenorth live tcp://192.0.2.7:5000 --lat 48.1 --page :8080
  truenorth live replay:log.csv@max --lat 34.246 -o quay --resume

Rows are CSV lines (a header with our names, or time and six numbers) or binary rows, see docs/live.md. Ctrl-C ends a run: the
rows so far are aligned as `truenorth align` would.

Exit codes: 0 aligned or level_only; 2 wrong usage; 3 bad data; 4 the data cannot be aligned.
"""


def live(
    source: Annotated[
        str,
        typer.Argument(
            help="replay:FILE@10x, - (standard input), udp://:PORT, tcp://HOST:PORT, serial:/dev/NAME?baud=RATE.",
            show_default=False,
        ),
    ],
    lat: Annotated[float, typer.Option(help="Latitude, deg, north positive.", show_default=False)],
    rows: Rows,
    lon: Annotated[float, typer.Option(help="Longitude, deg, east positive.")] = 0.0,
    alt: Annotated[float, typer.Option(help="Height above the ellipsoid, m.")] = 0.0,
    position_sigma: Annotated[float, typer.Option(help="One-sigma error of that position, m.")] = 10.0,
    imu: Annotated[
        str | None,
        typer.Option(
            help="Specification: a preset or a YAML file. Without it, it is inferred from the rows.", show_default=False
        ),
    ] = None,
    method: Annotated[str, typer.Option(help="As for `truenorth align`.")] = "auto",
    until: Annotated[
        str | None,
        typer.Option(help="Stop when heading is as good as this, such as '0.1 deg' (one sigma).", show_default=False),
    ] = None,
    every: Annotated[float, typer.Option(help="Seconds between two answers.")] = 1.0,
    share: Annotated[float, typer.Option(help="Part of one core for solutions.")] = 0.1,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder for the rows as they come, and the result.", show_default=False),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the rows in the folder.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print each answer as a JSON object on one line.")] = False,
    nmea: Annotated[bool, typer.Option("--nmea", help="Print each heading as NMEA HDT and PASHR.")] = False,
    page: Annotated[
        str | None,
        typer.Option(help="Show a page in the browser, at this address such as :8080 (loopback).", show_default=False),
    ] = None,
) -> None:
    """Find heading while the log is still running: watch it converge, stop when it is good."""
    from truenorth.core.errors import UsageError
    from truenorth.core.position import Position
    from truenorth.core.units import parse
    from truenorth.formats.layout import layout_for
    from truenorth.live.session import Session

    if resume and output is None:
        raise UsageError("--resume needs the folder of the earlier run; expected -o FOLDER")
    if as_json and nmea:
        raise UsageError("--json and --nmea both print on standard output; expected one of them")
    if not (every > 0.0 and 0.0 < share <= 1.0):
        raise UsageError(f"--every {every:g}, --share {share:g}: expected seconds above 0, and a part of 1")
    goal = None if until is None else parse(until, "angle")
    given = {"units": rows.units, "axes": rows.axes, "columns": names_of(rows.columns), "kind": rows.kind}
    place = Position.from_degrees(lat, lon, alt, horizontal_sigma=position_sigma, vertical_sigma=2.0 * position_sigma)
    session = Session(
        source,
        place,
        imu,
        layout=layout_for(Path(source), given),
        method=method,
        share=share,
        every=every,
        until=goal,
        folder=output,
        resume=resume,
        opened=lambda name: print(f"truenorth: rows from {name}; Ctrl-C ends the run", file=sys.stderr, flush=True),
    )
    with _listeners(as_json, nmea, page, goal) as listeners:
        result = session.run(listeners)
    if as_json:
        print(json.dumps({"final": True} | result.summary(), allow_nan=False), flush=True)
    paths = [] if output is None else result.save(output)
    if not (as_json or nmea):
        from truenorth.cli.print_alignment import print_alignment

        print_alignment(result, paths)
    if result.status not in ("aligned", "level_only"):
        raise typer.Exit(4)


@contextmanager
def _listeners(as_json: bool, nmea: bool, page: str | None, goal: float | None) -> Iterator[list[Listener]]:
    from truenorth.live.outputs import json_line, nmea_lines, view

    found: list[Listener] = []
    wished = math.radians(0.1) if goal is None else goal

    def printed(aligner: Aligner, answer: Answer | None, note: str) -> None:
        if answer is not None:
            for line in [json_line(answer)] if as_json else nmea_lines(answer):
                print(line, flush=True)

    if as_json or nmea:
        found.append(printed)
    server = None
    if page is not None:
        from truenorth.live.page import serve

        server = serve(page, wished)
        found.append(server.publish)
        print(f"page: {server.address}", file=sys.stderr, flush=True)
    try:
        if as_json or nmea or not sys.stderr.isatty():
            yield found
            return
        from rich.live import Live

        from truenorth.cli.console import make_console

        with Live(console=make_console(stderr=True), refresh_per_second=4) as screen:
            found.append(lambda aligner, answer, note: screen.update(view(aligner, answer, wished, note)))
            yield found
    finally:
        if server is not None:
            server.close()


live.__doc__ = f"{live.__doc__}\n{EXAMPLES}"
live = grouped(live)
