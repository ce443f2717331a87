"""Long tables: rows of several sensors below each other, each with the sensor's name in it, as phones and loggers write them.

``epoch_ms,sensor,x,y,z`` above ``1700000000123,accelerometer,0.1,0.2,9.8``; lines ``ACCE;app's time;sensor's time;x;y;z;accuracy``
of GetSensorData; ``Acc,123,0.1,0.2,9.8`` without a header; Android's numbers of sensors in a column of types. Each sensor's rows
become a table of their own, in which the lines of the others are empty, so that messages name lines of the file. Gyros and
accelerometers are then merged as those of a folder (:mod:`truenorth.formats.sensor_folder`).

Names decide what a sensor is: ``linear acceleration``, ``user acceleration`` and ``gravity`` are no accelerometers. Without these,
the sum of both is taken. Core Motion's are in g and point down at rest: their sign is turned.

Sources: Android, ``Sensor.TYPE_*`` and SensorEvent; the remarks at the top of GetSensorData's logs; Apple, CMDeviceMotion.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.behaviour import clock_readings, gravity_level
from truenorth.formats.columns import Columns, listed
from truenorth.formats.content import REMARKS_BYTES, text_of
from truenorth.formats.long_shape import OF_APP, OF_SENSOR, Shape, names_of
from truenorth.formats.names import clock_of, plain
from truenorth.formats.sensor_folder import Sensor, merged, sensor_of, with_gravity
from truenorth.formats.sensor_kinds import OF_ANDROID, USER, calibrated
from truenorth.formats.text import TextTable, without_a_cut_end
from truenorth.formats.units import split

Array = NDArray[np.float64]

GNSS_NAMES = {"long": "lon [deg]", "acc": "accuracy [m]"}
SAME = 0.1  # of the rows, from which on a clock that repeats is none
MOST_LATE = 1000.0  # steps, by which a row may stand after later ones
G, FASTEST = 9.80665, 20.0  # m/s^2; rad/s: no more is typical of a phone


def columns(path: Path, part: str, shape: Shape) -> Columns:
    """One part of a long table of some shape, ``imu``, ``gnss`` or ``mag``, as a table of its own.

    Raises
    ------
    DataError
        Rows that are damaged: with their line; sensors that are not there, or whose numbers are not what their names say.
    """
    tables, counts, notes = _tables(path, shape)
    kinds = {name: shape.kind(name) for name in counts}
    have = ", ".join(f"{name} ({count})" for name, count in counts.most_common())
    if shape.numbers:
        have += ", which are Android's numbers of sensors"
    kind = "gyro" if part == "imu" else part
    chosen = _one(path, [name for name in tables if kinds[name] == kind], kind, have)
    gyros = calibrated([name for name in tables if kinds[name] == "gyro"])
    if part != "imu":
        return _aid(path, tables[chosen], part, shape, None if not gyros else tables[gyros[0]], notes)
    gyro = _sensor(path, tables[chosen], "gyro", chosen, shape)
    accels, linear, gravity = (
        [_sensor(path, tables[name], "accel", name, shape) for name in tables if kinds[name] == kind]
        for kind in ("accel", "linear", "gravity")
    )
    if not accels and not linear:
        raise DataError(f"{path.name}: rows of {have}; expected those of an accelerometer as well: record it")
    whole = calibrated([sensor.name for sensor in accels])
    if len(whole) > 1:
        raise DataError(
            f"{path.name}: rows of several accelerometers: {', '.join(whole)}; expected one: save each apart"
        )
    accels = sorted(accels, key=lambda sensor: sensor.name not in whole)
    gyro, *others = _on_one_clock([gyro, *accels, *linear, *gravity])
    clock = _clock(path, gyro)
    gyro, *others = (_in_order(path, sensor, clock) for sensor in (gyro, *others))
    forces, gravities = others[: len(accels) + len(linear)], others[len(accels) + len(linear) :]
    if not clock:
        forces = forces[:1]
    accel = with_gravity(path, forces, gravities, clock)
    if shape.numbers:
        _check_numbers(path, gyro, accel, have)
    gyro, accel, words = _of_core_motion(gyro, accel, [sensor.name for sensor in forces])
    taken = {gyro.name, *accel.name.split(" + ")}
    left = ", ".join(f"{name} ({count})" for name, count in counts.items() if name not in taken)
    words += "; " + notes if notes else ""
    words += f"; rows of other sensors left out: {left}" if left else ""
    table = merged(path, gyro, accel, clock, gyro.clocks.get(clock, np.zeros(len(gyro.values))), words)
    return replace(table, why="a sensor's name in each row")


def _tables(path: Path, shape: Shape) -> tuple[dict[str, TextTable], Counter[str], str]:
    """The rows of each sensor, how many they are, and what is to be said of other lines."""
    text, _ = text_of(path)
    raw = text.splitlines()
    lines = [line.decode("utf-8", "replace") for line in raw]
    keys = [""] * len(lines)
    started, cut = False, ""
    kinds: dict[str, str | None] = {}
    last = max((k for k, line in enumerate(lines) if line.strip()), default=0)
    odd: list[int] = []
    head = ",".join(shape.header)
    for k, line in enumerate(lines):
        if not line.strip() or raw[k].lstrip().startswith(REMARKS_BYTES):
            continue
        key = shape.key(line)
        if key not in kinds:
            kinds[key] = shape.kind(key)
        started = started or kinds[key] is not None
        if not started or (head and ",".join(shape.dialect.cells(line)) == head):
            continue
        keys[k] = key
        if kinds[key] is None:
            odd.append(k)
    counts = Counter(key for key in keys if key)
    known = [name for name in counts if kinds[name] is not None]
    column = shape.header[shape.column] if shape.header else str(shape.column + 1)
    for k in odd:
        if k == last:
            cut, keys[k] = "the last line is cut: left out", ""
            continue
        near = get_close_matches(keys[k].casefold(), [name.casefold() for name in known], n=1, cutoff=0.7)
        word = re.match(r"[^\W\d]", keys[k]) is not None
        if not word or near or (shape.numbers and keys[k].isdecimal()):
            raise DataError(
                f"{path.name}: line {k + 1}, column {column}: {keys[k]!r}; expected the name of a sensor, one of {listed(known)}: "
                "repair the cell, or remove the line"
            )
    counts = Counter(key for key in keys if key)
    tables = {}
    for name in counts:
        if kinds[name] in (None, "other"):
            continue
        own = (
            b"\n".join(line if key == name else b"" for key, line in zip(keys, raw)) + text[len(text.rstrip(b"\r\n")) :]
        )
        skip = keys.index(name)
        names = names_of(name, shape, lines, [k for k, key in enumerate(keys) if key == name])
        table = TextTable(path, own, names, True, shape.dialect, skip)
        tables[name] = without_a_cut_end(table) if keys[last] == name else table
    return tables, counts, cut


def _one(path: Path, names: Sequence[str], kind: str, have: str) -> str:
    """The only sensor of a kind."""
    what = {"gyro": "gyros", "gnss": "a receiver", "mag": "a magnetometer"}[kind]
    found = calibrated(names)
    if not found:
        raise DataError(f"{path.name}: rows of {have}; expected those of {what} as well: record them")
    if len(found) > 1:
        raise DataError(
            f"{path.name}: rows of several sensors of one kind: {', '.join(found)}; expected one: save each apart"
        )
    return found[0]


def _sensor(path: Path, table: TextTable, sensor: str, name: str, shape: Shape) -> Sensor:
    """Rows of gyros or accelerometers."""
    of = Columns(path, table.names, table.read, table.column, table.place, True)
    if not {"x", "y", "z"} & {part for word in table.names for part in plain(split(word)[0]).split("_")}:
        raise DataError(
            f"{path.name}: {name}: no columns of x, y and z among {listed(table.names)}; name them in the header"
        )
    found = sensor_of(name, sensor, of)
    unit = split(name)[1]
    if shape.numbers or OF_ANDROID.match(name):
        unit = "rad/s" if sensor == "gyro" else "m/s^2"
    if unit:
        return replace(found, headings=tuple(f"{split(heading)[0]} [{unit}]" for heading in found.headings))
    return found


def _on_one_clock(sensors: Sequence[Sensor]) -> list[Sensor]:
    """GetSensorData's sensors on the app's clock, by the steps of their own: receivers have only the app's in common with them."""
    late = [
        float(np.median(sensor.clocks[OF_APP] - sensor.clocks[OF_SENSOR]))
        if {OF_APP, OF_SENSOR} <= sensor.clocks.keys()
        else np.nan
        for sensor in sensors
    ]
    if not np.isfinite(late).all():
        return list(sensors)
    shift = [late[0] if abs(one - late[0]) < 1.0 else one for one in late]
    return [replace(sensor, clocks={OF_APP: sensor.clocks[OF_SENSOR] + by}) for sensor, by in zip(sensors, shift)]


def _clock(path: Path, gyro: Sensor) -> str:
    """The clock that all rows are taken by: the first one that hardly repeats; empty where there is none."""
    repeats = {name: 1.0 - len(np.unique(times)) / len(times) for name, times in gyro.clocks.items()}
    if not repeats:
        return ""
    best = next((name for name, share in repeats.items() if share < SAME / 10), min(repeats, key=lambda n: repeats[n]))
    if repeats[best] > SAME:
        raise DataError(
            f"{path.name}: {gyro.name}: column {best} says the same time in {100.0 * repeats[best]:.0f} % of the rows; expected a "
            "time of its own for each: log the time of the sensor's event"
        )
    return best


def _in_order(path: Path, sensor: Sensor, clock: str) -> Sensor:
    """Rows in order of time; of rows of one time the first."""
    if clock not in sensor.clocks:
        return sensor
    time = sensor.clocks[clock]
    kept, first = np.unique(time, return_index=True)
    step = float(np.median(np.diff(kept))) if len(kept) > 1 else 0.0
    behind = np.maximum.accumulate(time) - time
    if len(kept) > 1 and behind.max() > MOST_LATE * step:
        raise DataError(
            f"{path.name}: {sensor.name}, row {int(behind.argmax()) + 1}: column {clock} goes back by {behind.max():.6g}; expected "
            f"rows late by {MOST_LATE:.0f} steps at most, which are put in order: split the log where its clock was set"
        )
    return replace(sensor, values=sensor.values[first], clocks={clock: kept})


def _check_numbers(path: Path, gyro: Sensor, accel: Sensor, have: str) -> None:
    """Refuse numbers of sensors that are not Android's, as far as the values show."""
    force, rate = gravity_level(accel.values), float(np.median(np.linalg.norm(gyro.values, axis=1)))
    if not (0.7 * G < force < 1.3 * G and rate < FASTEST):
        raise DataError(
            f"{path.name}: rows of {have}; but {accel.name} shows {force:.3g} m/s^2 and {gyro.name} {rate:.3g} rad/s (medians of "
            "the norm); expected gravity and rates of a phone: write names of sensors instead of numbers"
        )


def _of_core_motion(gyro: Sensor, accel: Sensor, names: Sequence[str]) -> tuple[Sensor, Sensor, str]:
    """Both sensors in Android's signs, and what was done, in words."""
    if any(USER.fullmatch(plain(name)) for name in names) and gravity_level(accel.values) < 0.5 * G:
        rates = replace(gyro, headings=tuple(f"{split(heading)[0]} [rad/s]" for heading in gyro.headings))
        words = f"; signs of {accel.name} turned: a user acceleration in g is Core Motion's, which point down at rest"
        return rates, replace(accel, values=-accel.values), words
    if " + " in accel.name and "lin" not in plain(accel.name):
        return gyro, accel, "; signs as on Android: those of an iPhone are opposite, which its log does not show"
    return gyro, accel, ""


def _unit(times: Array) -> str | None:
    """The unit of a clock of gyros, which have a usual rate."""
    steps = np.diff(np.unique(times))
    readings = clock_readings(float(np.median(steps)), float(times[0])) if len(steps) else []
    return max(readings, key=lambda reading: reading.probability).unit if readings else None


def _aid(path: Path, table: TextTable, part: str, shape: Shape, gyros: TextTable | None, notes: str) -> Columns:
    """The rows of a receiver or of a magnetometer, on the clock of the gyros."""
    clocks = [name for name in table.names if clock_of(name)[0]]
    names = [f"column {k + 1}" if name in clocks[1:] else name for k, name in enumerate(table.names)]
    unit = clock_of(clocks[0])[1] if clocks else None
    if gyros is not None and clocks:
        of = Columns(path, gyros.names, gyros.read, gyros.column, gyros.place, True)
        read = {name: of.clock(name) for name in clocks if name in gyros.names}
        rows = Sensor("", np.zeros((0, 3)), (), {name: times for name, (times, _) in read.items()})
        chosen = OF_APP if OF_APP in rows.clocks else _clock(path, rows) or clocks[0]
        unit = clock_of(chosen)[1] or (None if read.get(chosen, (0, ""))[1] is not None else _unit(rows.clocks[chosen]))
        names = [f"column {k + 1}" if name in clocks else name for k, name in enumerate(table.names)]
        names[table.names.index(chosen)] = chosen
        clocks = [chosen]
    if clocks:
        names[names.index(clocks[0])] = f"time [{unit}]" if unit else "time"
    words = [plain(split(name)[0]) for name in names]
    plainly = {axis: words.index(axis) for axis in "xyz" if axis in words}
    if part == "mag":
        for k, name in enumerate(names):
            axis = words[k].split("_")[-1]
            unit = split(name)[1] or ("uT" if shape.numbers else "")
            names[k] = f"mag_{axis}" + (f" [{unit}]" if unit else "") if axis in ("x", "y", "z") else name
    elif len(plainly) == 3 and not {"lat", "latitude"} & set(words):
        place = table.read([table.names[plainly[axis]] for axis in "xy"], True)
        beyond = np.flatnonzero((np.abs(place[:, 0]) > 90.0) | (np.abs(place[:, 1]) > 180.0))
        if beyond.size:
            raise DataError(
                f"{path.name}: {table.place(int(beyond[0]))}: {place[beyond[0], 0]:.9g}, {place[beyond[0], 1]:.9g}; expected "
                "latitude, longitude and altitude as x, y and z of a receiver: name the columns lat, lon and alt"
            )
        for axis, name in zip("xyz", ("lat [deg]", "lon [deg]", "alt [m]")):
            names[plainly[axis]] = name
    else:
        names = [GNSS_NAMES.get(word, name) for word, name in zip(words, names)]
    table = replace(table, names=names)
    said = (notes,) if notes else ()
    return Columns(path, names, table.read, table.column, table.place, True, said, "a sensor's name in each row")
