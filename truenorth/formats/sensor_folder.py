"""A folder that holds one text file for each sensor, as phones and simulators write an IMU's log: one table of both.

Gyros and accelerometers are found by the names of their files (``Gyroscope.csv``, ``gyro-0.csv``), x, y and z by their headings.
The clock stands in both files, or in a third one (``time.csv``) that has as many rows. Phones write an acceleration without
gravity as well, often under the plainest name: the file whose norm is gravity's is taken, or gravity's own file is added to the
other. The rows are the gyros'; accelerometers that were sampled at other times are interpolated.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.behaviour import accel_readings, gravity_level
from truenorth.formats.columns import Columns, columns_of_arrays, listed
from truenorth.formats.names import clock_of, heading_of, plain
from truenorth.formats.text import open_table
from truenorth.formats.units import split

Array = NDArray[np.float64]

SUFFIXES = (".csv", ".txt", ".tsv")
METADATA = "Metadata.csv"  # of the app Sensor Logger
GYRO = re.compile(r"gyro(?:scope|s)?(?:_?(?:meter|data|readings?|calibrated|uncalibrated))?(?:_?\d+)?")
ACCEL = re.compile(
    r"(?:total_?)?acc(?:el(?:eration|erometer|erometers|s)?)?(?:_?(?:data|readings?|calibrated|uncalibrated))?(?:_?\d+)?"
)
WITHOUT_GRAVITY = re.compile(r"(?:lin(?:ear)?|user)_?acc(?:el(?:eration|erometer)?)?(?:_?\d+)?")
GRAVITY = re.compile(r"gravity(?:_?\d+)?")
CLOCK = re.compile(r"time(?:_?stamps?)?")
GNSS = re.compile(r"(?:location|gps|gnss)(?:_?(?:gps|gnss|fused|data|location))?(?:_?\d+)?")
ODOMETER = re.compile(r"(?:odo(?:meter)?|wheel_?speed)(?:_?\d+)?")
SENSOR_LOGGER_CLOCKS = {"time", "seconds_elapsed"}
SENSOR_LOGGER = {"gyro": ("rad/s", "the app Sensor Logger writes rad/s, by the clocks of its files")}


@dataclass(frozen=True)
class Sensor:
    """The rows of one sensor: its clocks, and values (N, 3) of x, y and z."""

    name: str
    values: Array
    headings: tuple[str, ...]
    clocks: dict[str, Array]


def files_of(folder: Path) -> dict[str, list[Path]]:
    """Files by what their names say: ``gyro accel gravity linear`` (without gravity), ``clock gnss odometer``."""
    found: dict[str, list[Path]] = {}
    patterns = {
        "gyro": GYRO,
        "accel": ACCEL,
        "linear": WITHOUT_GRAVITY,
        "gravity": GRAVITY,
        "clock": CLOCK,
        "gnss": GNSS,
        "odometer": ODOMETER,
    }
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in SUFFIXES or not path.is_file():
            continue
        for part, pattern in patterns.items():
            if pattern.fullmatch(plain(path.stem)):
                found.setdefault(part, []).append(path)
    return found


def is_one(folder: Path) -> bool:
    """Whether a folder holds files of gyros and of accelerometers."""
    return folder.is_dir() and {"gyro", "accel"} <= files_of(folder).keys()


def hint(path: Path) -> str:
    """What to do with a file that has no IMU in it, where its folder has one file for each sensor."""
    if not is_one(path.parent):
        return ""
    files = files_of(path.parent)
    return f"; gyros are in {files['gyro'][0].name} and accelerometers in {files['accel'][0].name}: read their folder as one log"


def columns(folder: Path) -> Columns:
    """The log of a folder as columns of one table.

    Raises
    ------
    DataError
        Several gyros, no file of accelerometers that holds gravity, files that do not overlap in time.
    """
    files = files_of(folder)
    gyros = _calibrated(files["gyro"])
    if len(gyros) > 1:
        raise DataError(
            f"{folder.name}: {len(gyros)} files of gyros: {', '.join(path.name for path in gyros)}; expected one: move the "
            "others to another folder"
        )
    gyro = _sensor(gyros[0], "gyro")
    clock, times = _clock(folder, gyro, files)
    accel = with_gravity(
        folder,
        (_sensor(path, "accel") for path in [*_calibrated(files["accel"]), *files["accel"]]),
        (_sensor(path, "accel") for path in files.get("gravity", ())),
        clock,
    )
    values, signs = _specific_force(folder, accel)
    table = merged(folder, gyro, replace(accel, values=values), clock, times, signs)
    return replace(table, device=SENSOR_LOGGER) if set(gyro.clocks) >= SENSOR_LOGGER_CLOCKS else table


def merged(path: Path, gyro: Sensor, accel: Sensor, clock: str, times: Array, words: str = "") -> Columns:
    """One table of two sensors: rows of the gyros, with accelerometers interpolated to them.

    Parameters
    ----------
    path : Path
        Of the log, for messages.
    gyro, accel : Sensor
    clock : str
        The name of the clock of both; empty where there is none.
    times : (N,) array
        Of the gyros.
    words : str
        What else is to be said, such as ``"; signs turned"``.

    Raises
    ------
    DataError
        Sensors that do not overlap in time, or have other numbers of rows and no clock.
    """
    rows = (
        (times >= accel.clocks[clock][0]) & (times <= accel.clocks[clock][-1])
        if clock in accel.clocks
        else np.isfinite(times)
    )
    if clock not in accel.clocks and len(accel.values) != len(gyro.values):
        raise DataError(
            f"{path.name}: {gyro.name} has {len(gyro.values)} rows and {accel.name} {len(accel.values)}, without a clock of "
            "their own; expected as many of each"
        )
    if not rows.any():
        raise DataError(f"{path.name}: {gyro.name} and {accel.name} have no time in common by their column {clock}")
    force = accel.values if clock not in accel.clocks else at_times(times[rows], accel.clocks[clock], accel.values)
    table = {clock: times[rows]} if clock else {}
    table |= dict(zip(gyro.headings, gyro.values[rows].T)) | dict(zip(accel.headings, force.T))
    left = f", {len(times) - rows.sum()} rows of one of them alone left out" if not rows.all() else ""
    whole = columns_of_arrays(path, table)
    moved = clock in accel.clocks and not _same(times[rows], accel.clocks[clock])
    moved_words = "; accelerometers interpolated to them, which takes some of their white noise away" if moved else ""
    note = f"{gyro.name} and {accel.name}, rows of the gyros{left}{moved_words}{words}"
    return Columns(path, whole.names, whole.read, whole.column, named=True, notes=(note,), whole=whole.whole)


def _calibrated(paths: Sequence[Path]) -> list[Path]:
    """Files of calibrated values, where there are some."""
    return [path for path in paths if "uncal" not in path.stem.casefold()] or list(paths)


def _sensor(path: Path, sensor: str) -> Sensor:
    """One file: its columns of x, y and z, with headings of an IMU's log, and its clocks."""
    table = open_table(path)
    return sensor_of(path.name, sensor, Columns(path, table.names, table.read, table.column, table.place, table.named))


def sensor_of(name: str, sensor: str, table: Columns) -> Sensor:
    """The gyros (``gyro``) or accelerometers (``accel``) in a table of theirs alone; `name` says which, in messages.

    Raises
    ------
    DataError
        No columns of x, y and z.
    """
    plainly: dict[str, str] = {}
    own = [column for column in table.names if (found := heading_of(column)) is not None and found.sensor == sensor]
    for column in dict.fromkeys((*own, *table.names)) if table.named else ():
        bare, _ = split(column)
        words = plain(bare).split("_")
        heading = heading_of(column)
        axis = heading.axis if heading is not None else words[-1] if words[-1] in "xyz" else words[0]
        if axis in ("x", "y", "z") and not clock_of(column)[0]:
            plainly.setdefault(axis, column)
    if set(plainly) != set("xyz"):
        raise DataError(f"{name}: no columns of x, y and z among {listed(table.names)}")
    names = [plainly[axis] for axis in "xyz"]
    units = [split(column)[1] for column in names]
    headings = tuple(
        f"{'angular_rate' if sensor == 'gyro' else 'acceleration'}_{a}" + (f" [{u}]" if u else "")
        for a, u in zip("xyz", units)
    )
    clocks = {column: table.clock(column)[0] for column in table.names if clock_of(column)[0]}
    return Sensor(name, table.read(names, False), headings, clocks)


def _clock(folder: Path, gyro: Sensor, files: dict[str, list[Path]]) -> tuple[str, Array]:
    """The name and the times of the gyros' clock; no name where there is none."""
    for name, times in gyro.clocks.items():
        if np.all(np.diff(times) > 0.0):
            return name, times
    for path in files.get("clock", ()):
        table = open_table(path)
        times = Columns(path, table.names, table.read, table.column, table.place, table.named).clock(table.names[0])[0]
        if len(times) == len(gyro.values):
            return table.names[0], times
    if gyro.clocks:
        name = next(iter(gyro.clocks))
        raise DataError(
            f"{folder.name}: {gyro.name}: column {name} does not always increase; expected one row for each sample, in order"
        )
    return "", np.zeros(len(gyro.values))


def with_gravity(source: Path, accels: Iterable[Sensor], gravities: Iterable[Sensor], clock: str) -> Sensor:
    """The accelerometers that hold gravity, or the sum of those without it and of gravity's own rows.

    Raises
    ------
    DataError
        There are none.
    """
    seen = []
    for sensor in accels:
        level = gravity_level(sensor.values)
        if accel_readings(level, np.nan, ("rates",)):
            return sensor
        seen.append((sensor, level))
    for gravity in gravities:
        sensor, _ = seen[0]
        if clock in gravity.clocks and clock in sensor.clocks:
            both = sensor.values + at_times(sensor.clocks[clock], gravity.clocks[clock], gravity.values)
            if accel_readings(gravity_level(both), np.nan, ("rates",)):
                return Sensor(f"{sensor.name} + {gravity.name}", both, sensor.headings, sensor.clocks)
    sensor, level = seen[0]
    raise DataError(
        f"{source.name}: {sensor.name} shows {level:.3g} (median of the norm), which is gravity in no usual unit: the phone took "
        "gravity out; expected the specific force: record the total acceleration, or gravity in a file of its own"
    )


def _specific_force(folder: Path, accel: Sensor) -> tuple[Array, str]:
    """Accelerations in Android's signs, and what was done, in words: Apple's are opposite, so that at rest they point down.

    No log shows which of the two it has: a phone that lies on its screen looks alike. Sensor Logger writes it into a file.
    Source: https://github.com/tszheichoi/awesome-sensor-logger, COORDINATES.md and README.md.
    """
    path = folder / METADATA
    about = dict.fromkeys(("platform", "standardisation"), "")
    if path.is_file():
        with (
            path.open(newline="", encoding="utf-8", errors="replace") as file,
            suppress(csv.Error),
        ):  # a cell without an end
            row = next(csv.DictReader(file), {})
            about |= {plain(key): (value or "").strip().casefold() for key, value in row.items() if key}
    if about["platform"] == "ios" and about["standardisation"] != "true":
        return (
            -accel.values,
            f"; signs of {accel.name} turned: {METADATA} says ios, whose accelerations point down at rest",
        )
    if not about["platform"] and " + " in accel.name:  # Android writes the sum as well
        return accel.values, "; signs as on Android: those of an iPhone are opposite, which its log does not show"
    return accel.values, ""


def at_times(times: Array, clock: Array, values: Array) -> Array:
    """Values at other times; as they are where the times are the same."""
    if _same(times, clock):
        return values
    return np.column_stack([np.interp(times, clock, values[:, i]) for i in range(3)])


def _same(times: Array, clock: Array) -> bool:
    return len(times) == len(clock) and bool(np.array_equal(times, clock))
