"""`truenorth live`: heading while the log is still running."""

from __future__ import annotations

import json
import math
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.live_options import Aids, Turned
from truenorth.cli.options import argument, command, option
from truenorth.cli.reading import Place, Rows, names_of

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.live.answer import Answer
    from truenorth.live.session import Listener, Run, Session
    from truenorth.navigation import Navigation

EXAMPLES = """
\b
Examples:
  truenorth live replay:log.csv@10x --lat 34.246 --imu navigation
  truenorth live udp://:9000 --lat 48.1 --imu tactical --until "0.1 deg"
  cat /dev/ttyUSB0 | truenorth live - --lat 48.1 --units deg/s,g --json
  truenorth live serial:/dev/ttyUSB0?baud=921600 --lat 48.1 --nmea > hdt
  truenorth live tcp://192.0.2.7:5000 --lat 48.1 --page :8080
  truenorth live replay:log.csv@max --lat 34.246 -o quay --resume
  truenorth live udp://:9000 --gnss udp://:9001 --imu industrial --navigate
  truenorth live replay:log.csv@20x --odometer replay:odo.csv --imu tactical
  truenorth live udp://:9000 --indexer udp://:9003 --lat 40 --imu navigation
  truenorth live bag:today?topic=/imu --gnss bag:today --imu tactical
  truenorth live "zenoh:imu/data?type=sensor_msgs/msg/Imu" --lat 48.1

Rows are CSV lines (a header with our names, or time and six numbers), binary rows or the messages of a device, see docs/live.md.
Ctrl-C ends a run, or SIGTERM: the rows so far are aligned as `truenorth align` would.

Exit codes: 0 aligned or level_only; 2 wrong usage; 3 bad data; 4 the data cannot be aligned.
"""


@command(EXAMPLES)
def live(
    source: Annotated[
        str,
        argument(
            "replay:FILE@10x, follow:FILE, - (standard input), udp://:PORT, tcp://HOST:PORT, serial:/dev/NAME?baud=RATE, "
            "bag:BAG?topic=NAME, zenoh:KEY."
        ),
    ],
    where: Place,
    rows: Rows,
    aids: Aids,
    turned: Turned,
    imu: Annotated[
        str | None, option("Specification: a preset or a YAML file. Without it, it is inferred from the rows.")
    ] = None,
    method: Annotated[str, option("As for `truenorth align`.")] = "auto",
    until: Annotated[
        str | None,
        option("Stop, or navigate on, when heading is as good as this: '0.1 deg' (one sigma).", panel="Answers"),
    ] = None,
    navigate: Annotated[
        bool,
        option(
            "Go on to navigation: at --until, when the base leaves its place, or by the page.",
            "--navigate",
            panel="Answers",
        ),
    ] = False,
    clock: Annotated[str, option("Time of a row: device (where it has one), or arrival.", panel="Answers")] = "device",
    every: Annotated[float, option("Seconds between two answers.", panel="Answers")] = 1.0,
    share: Annotated[float, option("Part of one core for solutions.", panel="Answers")] = 0.1,
    output: Annotated[
        Path | None,
        option("Folder for the rows as they come, and the result.", "-o", "--output", panel="Kept in a folder"),
    ] = None,
    resume: Annotated[bool, option("Go on with the rows in the folder.", "--resume", panel="Kept in a folder")] = False,
    as_json: Annotated[
        bool, option("Print each answer as a JSON object on one line.", "--json", panel="Shown as")
    ] = False,
    nmea: Annotated[bool, option("Print each heading as NMEA HDT and PASHR.", "--nmea", panel="Shown as")] = False,
    to: Annotated[
        str | None,
        option("Where these lines go: udp://HOST:PORT, or tcp://:PORT at which clients may listen.", panel="Shown as"),
    ] = None,
    page: Annotated[
        str | None, option("Show a page in the browser, at this address such as :8080 (loopback).", panel="Shown as")
    ] = None,
) -> None:
    """Find heading while the log is still running: watch it converge, stop when it is good."""
    from truenorth.core.errors import UsageError
    from truenorth.core.language import retold
    from truenorth.core.units import parse
    from truenorth.formats.layout import layout_for
    from truenorth.live.sending import open_sink
    from truenorth.live.session import Session

    if resume and output is None:
        raise UsageError("--resume needs the folder of the earlier run; expected -o FOLDER")
    if as_json and nmea:
        raise UsageError("--json and --nmea both print on standard output; expected one of them")
    if to is not None and not (as_json or nmea):
        raise UsageError(f"--to {to}: nothing to send; expected --json or --nmea with it")
    if not (every > 0.0 and 0.0 < share <= 1.0):
        raise UsageError(f"--every {every:g}, --share {share:g}: expected seconds above 0, and a part of 1")
    if clock not in ("device", "arrival"):
        raise UsageError(f"--clock {clock!r}: expected device or arrival")
    place = where.position()
    if place is None and aids.gnss is None and aids.master is None:
        raise UsageError("no place; expected --lat (and --lon), --gnss SOURCE, or --master SOURCE with positions")
    if turned.indexer is not None and navigate:
        raise UsageError("--navigate with --indexer: an IMU that is turned in its body does not navigate; expected one")
    goal = None if until is None else parse(until, "angle")
    say = partial(print, flush=True) if to is None else open_sink(to)
    given = {"units": rows.units, "axes": rows.axes, "columns": names_of(rows.columns), "kind": rows.kind}
    session = Session(
        source,
        place,
        imu,
        layout=layout_for(Path(source), given),
        feeds=[*turned.feeds(), *aids.feeds(place, source)],
        turner=turned.turner(),
        aids=turned.sources() | aids.sources(),
        method=method,
        share=share,
        every=every,
        until=goal,
        navigate=navigate,
        by_arrival=clock == "arrival",
        folder=output,
        resume=resume,
        opened=lambda name: print(f"truenorth: rows from {name}; Ctrl-C ends the run", file=sys.stderr, flush=True),
    )
    lines = None if not (as_json or nmea) else _line_listener(say, as_json)
    with _listeners(session, lines, page, goal) as listeners, _ended_by_sigterm():
        alignment = session.run(listeners)
    result: Alignment | Navigation = session.navigation or alignment
    if session.without:
        print(f"truenorth: {retold(session.without)}", file=sys.stderr)
    if as_json:
        say(json.dumps({"final": True} | result.summary(), allow_nan=False))
    paths = [] if output is None else result.save(output)
    if not (as_json or nmea):
        from truenorth.cli.print_alignment import print_alignment

        print_alignment(alignment, paths if session.navigation is None else [])
        if session.navigation is not None:
            from truenorth.cli.navigate import print_navigation

            print_navigation(session.navigation, paths)
    if result.status not in ("aligned", "level_only", "navigated"):
        raise typer.Exit(4)


def _line_listener(say: Callable[[str], None], as_json: bool) -> Listener:
    from truenorth.live.outputs import json_line, nmea_lines

    def listener(run: Run, answer: Answer | None, note: str) -> None:
        if answer is not None:
            for line in [json_line(answer)] if as_json else nmea_lines(answer):
                say(line)

    return listener


@contextmanager
def _ended_by_sigterm() -> Iterator[None]:
    """A service that is stopped has its answer, too."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _listeners(
    session: Session, lines: Listener | None, page: str | None, goal: float | None
) -> Iterator[list[Listener]]:
    from truenorth.live.outputs import view

    found: list[Listener] = [] if lines is None else [lines]
    wished = math.radians(0.1) if goal is None else goal
    server = None
    if page is not None:
        from truenorth.live.page import serve

        server = serve(page, wished, session.go if session.navigate else None)
        found.append(server.publish)
        print(f"page: {server.address}", file=sys.stderr, flush=True)
    try:
        if lines is not None or not sys.stderr.isatty():
            yield found
            return
        from rich.live import Live

        from truenorth.cli.console import make_console

        with Live(console=make_console(stderr=True), refresh_per_second=4) as screen:
            found.append(lambda run, answer, note: screen.update(view(run, answer, wished, note)))
            yield found
    finally:
        if server is not None:
            server.close()
