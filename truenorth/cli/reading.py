"""Options by which every command reads a log."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from truenorth.records import Guess, ImuRecord

Log = Annotated[
    Path,
    typer.Argument(
        help="IMU log: text, .parquet, .feather, .npz, .mat, PSINS .imu, KF-GINS .txt/.bin, ROS bag.",
        show_default=False,
    ),
]
Axes = Annotated[
    str | None,
    typer.Option(
        help="Where x, y, z point: RFU (right, forward, up; the default), FRD, FLU, even FLD.",
        show_default=False,
    ),
]
Units = Annotated[
    str | None,
    typer.Option(
        help="Units of the columns, as 'deg/s,g' or 'gyro=deg/s'; else found or asked.",
        show_default=False,
    ),
]
Rate = Annotated[
    float | None,
    typer.Option(help="Samples a second, of a log without time, or with bad stamps.", show_default=False),
]
Columns = Annotated[
    str | None,
    typer.Option(
        help="Names of the columns in the log, as 'time=t,gyro_x=wx,gyro_y=-wy'; for .npz and .mat the variables.",
        show_default=False,
    ),
]
Format = Annotated[
    str | None, typer.Option("--format", help="Format, where the suffix does not tell.", show_default=False)
]
Kind = Annotated[
    str | None,
    typer.Option(help="What a row is, where the names do not tell: rates or increments.", show_default=False),
]
Topic = Annotated[str | None, typer.Option(help="Topic of a ROS bag with several IMUs.", show_default=False)]
From = Annotated[float | None, typer.Option("--from", help="Use the log from this time on, s.", show_default=False)]
To = Annotated[float | None, typer.Option("--to", help="Use the log up to this time, s.", show_default=False)]


def read_log(
    log: Path,
    *,
    axes: str | None,
    units: str | None,
    rate: float | None,
    columns: str | None,
    format: str | None,
    kind: str | None,
    topic: str | None,
    start: float | None,
    stop: float | None,
) -> ImuRecord:
    """Read a log as the options say, and cut the window out of it."""
    from truenorth.core.errors import DataError, UsageError
    from truenorth.formats import UnsureError, read_imu

    for option, value in (("--from", start), ("--to", stop)):
        if value is not None and not math.isfinite(value):
            raise UsageError(f"{option} {value}: expected seconds on the log's clock")
    if start is not None and stop is not None and start >= stop:
        raise UsageError(f"--from {start:g} --to {stop:g}: the window ends before it begins")
    try:
        record = read_imu(
            log,
            format=format,
            units=units,
            axes=axes,
            rate=rate,
            columns=names_of(columns),
            kind=kind,  # type: ignore[arg-type]  # checked there, with the choices in the message
            topic=topic,
        )
    except UnsureError as unsure:
        choices = " or ".join(as_options(option) for option in unsure.options)
        error = DataError(f"{unsure.question}; say which: {choices}")
        error.add_note("\n".join(map(in_line, unsure.guesses)))
        raise error from unsure
    if start is not None or stop is not None:
        record = record.between(start, stop)
    return record


def as_options(option: Mapping[str, Any]) -> str:
    """A reader's option as it is typed: ``{"units": {"gyro": "deg/s"}}`` is ``--units gyro=deg/s``."""
    words = []
    for key, value in option.items():
        text = ",".join(f"{name}={one}" for name, one in value.items()) if isinstance(value, Mapping) else str(value)
        words.append(f"--{key} {shlex.quote(text)}")
    return " ".join(words)


def in_line(guess: Guess) -> str:
    """What a log was taken for, in one line: what, value, how sure, why."""
    sure = "" if guess.probability > 0.995 else f" ({100 * guess.probability:.0f} % sure)"
    return f"{guess.what}: {guess.value}{sure}: {guess.why}"


def names_of(columns: str | None) -> dict[str, str] | None:
    """Our names of columns to the log's, of an option such as ``time=t,gyro_x=wx``.

    Raises
    ------
    UsageError
        No such pairs.
    """
    from truenorth.core.errors import UsageError

    if columns is None:
        return None
    pairs = [pair.partition("=") for pair in columns.split(",")]
    if any(not equals or not ours.strip() or not theirs.strip() for ours, equals, theirs in pairs):
        raise UsageError(f"--columns {columns!r}: expected pairs such as time=t,gyro_x=wx")
    return {ours.strip(): theirs.strip() for ours, _, theirs in pairs}


def numbers_of(text: str, option: str, count: int, meaning: str) -> list[float]:
    """The numbers of an option that takes several, with commas between them.

    Raises
    ------
    UsageError
        Other than `count` finite numbers.
    """
    from truenorth.core.errors import UsageError

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(math.isfinite(x) for x in numbers):
        raise UsageError(f"{option} {text!r}: expected {count} numbers with commas between them: {meaning}")
    return numbers
