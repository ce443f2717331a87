"""Options by which every command reads a log, and of the place where it was taken."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.options import argument, option

if TYPE_CHECKING:
    from truenorth.core.position import Position
    from truenorth.records import Guess, ImuRecord

Log = Annotated[
    Path, argument("IMU log: text, .parquet, .feather, .npz, .mat, PSINS .imu, KF-GINS .txt/.bin, ROS bag.")
]
Calibrated = Annotated[Path | None, option("YAML file of known bias, scale factor and misalignment, taken off first.")]


@dataclass(frozen=True)
class Place:
    """Where the IMU stands."""

    PANEL: ClassVar = "Place"
    lat: Annotated[float | None, option("Latitude, deg, north positive.")] = None
    lon: Annotated[float, option("Longitude, deg, east positive.")] = 0.0
    alt: Annotated[float, option("Height above the ellipsoid, m.")] = 0.0
    position_sigma: Annotated[float, option("One-sigma error of that position, m.")] = 10.0

    def position(self) -> Position | None:
        """The position; None: no latitude was given."""
        from truenorth.core.position import Position

        if self.lat is None:
            return None
        sigmas = {"horizontal_sigma": self.position_sigma, "vertical_sigma": 2 * self.position_sigma}
        return Position.from_degrees(self.lat, self.lon, self.alt, **sigmas)


@dataclass(frozen=True)
class Rows:
    """What the rows of a log are."""

    PANEL: ClassVar = "The log"
    axes: Annotated[
        str | None, option("Where x, y, z point: RFU (right, forward, up; the default), FRD, FLU, even FLD.")
    ] = None
    units: Annotated[str | None, option("Units of the columns, as 'deg/s,g' or 'gyro=deg/s'; else found or asked.")] = (
        None
    )
    columns: Annotated[
        str | None,
        option("Names of the columns in the log, as 'time=t,gyro_x=wx,gyro_y=-wy'; for .npz and .mat the variables."),
    ] = None
    kind: Annotated[str | None, option("What a row is, where the names do not tell: rates or increments.")] = None


@dataclass(frozen=True)
class Reading(Rows):
    """How a log is read."""

    rate: Annotated[float | None, option("Samples a second, of a log without time, or with bad stamps.")] = None
    format: Annotated[str | None, option("Format, where the suffix does not tell.", "--format")] = None
    topic: Annotated[str | None, option("Topic of a ROS bag with several IMUs.")] = None
    stop: Annotated[float | None, option("Use the log up to this time, s.", "--to")] = None

    def read(self, log: Path) -> ImuRecord:
        """The log, up to --to."""
        return self._read(log, None)

    def _read(self, log: Path, start: float | None) -> ImuRecord:
        from truenorth.core.errors import DataError, UsageError
        from truenorth.formats import UnsureError, read_imu

        for name, value in (("--from", start), ("--to", self.stop)):
            if value is not None and not math.isfinite(value):
                raise UsageError(f"{name} {value}: expected seconds on the log's clock")
        if start is not None and self.stop is not None and start >= self.stop:
            raise UsageError(f"--from {start:g} --to {self.stop:g}: the window ends before it begins")
        try:
            record = read_imu(
                log,
                format=self.format,
                units=self.units,
                axes=self.axes,
                rate=self.rate,
                columns=names_of(self.columns),
                kind=self.kind,  # type: ignore[arg-type]  # checked there, with the choices in the message
                topic=self.topic,
            )
        except UnsureError as unsure:
            choices = " or ".join(as_options(option) for option in unsure.options)
            error = DataError(f"{unsure.question}; say which: {choices}")
            error.add_note("\n".join(map(in_line, unsure.guesses)))
            raise error from unsure
        return record if start is None and self.stop is None else record.between(start, self.stop)


@dataclass(frozen=True)
class ReadingWindow(Reading):
    """How a log is read, and from when on."""

    start: Annotated[float | None, option("Use the log from this time on, s.", "--from")] = None

    def read(self, log: Path) -> ImuRecord:
        """The log from --from to --to."""
        return self._read(log, self.start)


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
