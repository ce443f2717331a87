"""Which columns of a log are time, rates and specific forces: as the caller says, as they are called, or as they behave."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import DIMENSIONS, parse_unit
from truenorth.formats.behaviour import accel_readings, gravity_level
from truenorth.formats.blank_rows import is_empty
from truenorth.formats.chosen import Choice, with_time
from truenorth.formats.columns import Columns, listed, missing_column
from truenorth.formats.guesses import UnsureError
from truenorth.formats.layout import BLOCKS, Layout
from truenorth.formats.names import Heading, families, heading_of, plain, says_rates
from truenorth.formats.units import split
from truenorth.records import COLUMNS, Guess
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

CORE_MOTION = "accelerometer_acceleration"  # as apps write the field of that name, of Apple's framework
IPHONE = re.compile(r"timestamp_since_reboot|^motion_|^gyro_rotation")  # other columns of SensorLog
REFERENCE = re.compile(r"([^\[\]]+?)\s*\[\s*(\d+)\s*:\s*(\d+)\s*\]")


def choose(columns: Columns, layout: Layout) -> Choice:
    """Find the columns of an IMU.

    Raises
    ------
    DataError
        A column that is missing or there twice; the message lists those found and the nearest name.
    UnsureError
        Several sets of columns may be meant.
    """
    named = _named(columns, layout)
    if named is not None:
        kind: Kind = layout.kind or ("rates" if set(COLUMNS["rates"]) & set(named) else "increments")
        return _by_caller(columns, layout, named, kind)
    for kind in _by_size(columns.names):
        if all(ours in columns.names for ours in COLUMNS[kind]):
            _once(columns, COLUMNS[kind])
            choice = Choice(kind, (), [(ours, 1.0) for ours in COLUMNS[kind]], documented=True)
            return with_time(columns, layout, choice)
    found = _by_name(columns, layout)
    if found is not None:
        return with_time(columns, layout, found)
    near = [name for name in columns.names if name in {c for names in COLUMNS.values() for c in names}]
    if near:
        wanted = next(c for k in COLUMNS for c in COLUMNS[k] if near[0] in COLUMNS[k] and c not in columns.names)
        raise missing_column(columns, wanted, wanted)
    from truenorth.formats.unnamed import by_behaviour  # most logs name their columns

    return by_behaviour(columns, layout)


def _by_size(names: Sequence[str]) -> tuple[Kind, Kind]:
    rates, increments = (sum(c in names for c in COLUMNS[kind]) for kind in ("rates", "increments"))
    return ("rates", "increments") if rates >= increments else ("increments", "rates")


def _once(columns: Columns, names: Sequence[str]) -> None:
    for name in names:
        if columns.names.count(name) > 1:
            raise DataError(
                f"{columns.path.name}: column {name!r} is there {columns.names.count(name)} times; rename one"
            )


# ---------------------------------------------------------------------------------------------- by caller


def _named(columns: Columns, layout: Layout) -> dict[str, tuple[str, float]] | None:
    """The caller's columns by our names, with their signs; None where none of a sensor is named."""
    result: dict[str, tuple[str, float]] = {}
    for ours, text in layout.columns.items():
        if ours in ("time", "scale", "interval"):
            continue
        sign = 1.0 if text in columns.names or not text.startswith("-") else -1.0
        theirs = text if sign > 0.0 else text[1:]
        block = next((k for k, pair in BLOCKS.items() if ours in pair), None)
        if block is None:
            result[ours] = (theirs, sign)
            continue
        three = COLUMNS[block][:3] if ours == BLOCKS[block][0] else COLUMNS[block][3:]
        result |= {name: (part, sign) for name, part in zip(three, _parts(columns, theirs))}
    return result or None


def _parts(columns: Columns, reference: str) -> list[str]:
    """The three columns of a block such as ``counts[0:3]``, or of an array of three."""
    match = REFERENCE.fullmatch(reference.strip())
    if match is not None:
        name, first, stop = match[1], int(match[2]), int(match[3])
        parts = [f"{name}[{i}]" for i in range(first, stop)]
        have = sum(other.startswith(f"{name}[") for other in columns.names)
        if have and (len(parts) != 3 or stop > have):
            raise DataError(
                f"{columns.path.name}: {reference!r}: variable {name!r} has {have} columns and no such three; expected "
                f"{name}[0:3] or the like"
            )
    elif "[" in reference:
        raise UsageError(
            f"{columns.path.name}: cannot read the reference {reference!r}; write it like counts, counts[0:3] or imu[6]"
        )
    else:
        name, parts = reference, [f"{reference}[{i}]" for i in range(3)]
        if f"{reference}_x" in columns.names:  # an array that has one of our names
            parts = [f"{reference}_{axis}" for axis in "xyz"]
        if reference in columns.names and columns.path.suffix.lower() not in (".npz", ".mat"):
            raise UsageError(
                f"{columns.path.name}: columns: 'gyro' and its like are for arrays; name single columns, such as gyro_x and accel_x"
            )
        have = sum(other.startswith(f"{name}[") for other in columns.names)
        if have > 3 or reference in columns.names:
            raise DataError(
                f"{columns.path.name}: {reference!r} has {have or 1} columns; expected three, x, y and z: of a larger array "
                f"name a part, such as {reference}[0:3]"
            )
    if parts[0] not in columns.names:
        whole = sorted({other.partition("[")[0] for other in columns.names})
        near = get_close_matches(name, whole, n=1)
        hint = f"; is it {near[0]!r}?" if near else ""
        raise DataError(f"{columns.path.name}: {name!r} is missing; found {listed(whole)}{hint}")
    return parts


def _by_caller(columns: Columns, layout: Layout, named: dict[str, tuple[str, float]], kind: Kind) -> Choice:
    other = "increments" if kind == "rates" else "rates"
    for ours, theirs in zip(COLUMNS[other], COLUMNS[kind]):  # where the caller's kind wins over the name
        named = {theirs if key == ours else key: value for key, value in named.items()}
    missing = [ours for ours in COLUMNS[kind] if ours not in named]
    found = families(columns.names) if missing and columns.named else {}
    for ours in missing:
        sets = found.get(ours.rpartition("_")[0], [])
        if ours in columns.names:
            named[ours] = (ours, 1.0)
        elif len(sets) == 1:
            named[ours] = (sets[0][ours[-1]].name, 1.0)
    if (sensor := _one_sensor(kind, named)) is not None and all(named[ours][0] in columns.names for ours in named):
        from truenorth.formats.unnamed import by_behaviour

        three = [named[ours][0] for ours in (COLUMNS[kind][:3] if sensor == "gyro" else COLUMNS[kind][3:])]
        both = by_behaviour(columns, layout, {sensor: three}).sensors
        named |= {ours: both[k] for k, ours in enumerate(COLUMNS[kind]) if ours not in named}
    for ours in COLUMNS[kind]:
        if ours not in named or named[ours][0] not in columns.names:
            raise missing_column(columns, ours, named.get(ours, (ours, 1.0))[0])
    _once(columns, [name for name, _ in named.values()])
    choice = Choice(kind, (), [named[ours] for ours in COLUMNS[kind]])
    choice.documented = all(name == ours for ours, (name, _) in named.items())
    choice.units = _units(columns, layout, [heading_of(name) for name, _ in choice.sensors], kind)
    given = {ours: f"{'-' if sign < 0.0 else ''}{name}" for ours, (name, sign) in named.items()}
    given |= {key: layout.columns[key] for key in ("time", "scale", "interval") if key in layout.columns}
    choice.guesses.append(Guess("columns", ", ".join(given.values()), "as the caller says", 1.0, {"columns": given}))
    return with_time(columns, layout, choice)


def _one_sensor(kind: Kind, named: Mapping[str, object]) -> str | None:
    """The one sensor of which all three columns are known, where none of the other's is."""
    have = ["".join(ours[-1] for ours in three if ours in named) for three in (COLUMNS[kind][:3], COLUMNS[kind][3:])]
    return {("xyz", ""): "gyro", ("", "xyz"): "accel"}.get((have[0], have[1]))


def _units(columns: Columns, layout: Layout, headings: Sequence[Heading | None], kind: Kind) -> dict[str, str]:
    """Units of a sensor that all of its headings agree on, and that fit the kind.

    Raises
    ------
    DataError
        Its headings name units of several sizes, and the caller none: near gravity's size no number shows which axis is off.
    """
    result = {}
    wanted = {"rates": ("angular_rate", "acceleration"), "increments": ("angle", "speed")}[kind]
    for sensor, part, dimension in zip(("gyro", "accel"), (headings[:3], headings[3:]), wanted):
        said = [(heading.name, heading.unit) for heading in part if heading is not None and heading.unit is not None]
        sizes = {parse_unit(unit) for _, unit in said}
        if len(sizes) > 1 and sensor not in layout.units:
            raise DataError(
                f"{columns.path.name}: the headings of one sensor name several units: {listed([name for name, _ in said])}; "
                "expected one for all three axes: correct the headings, or give the unit that holds for all (`units`)"
            )
        if len(sizes) == 1 and len(said) == len(part) and sizes.pop()[1] == DIMENSIONS[dimension][0]:
            result[sensor] = said[0][1]
    return result


# ------------------------------------------------------------------------------------------------ by name


def _by_name(columns: Columns, layout: Layout) -> Choice | None:
    """The columns by their headings; None where they do not tell."""
    if not columns.named:
        return None
    found = families(columns.names)
    sets: dict[Kind, tuple[list[dict[str, Heading]], list[dict[str, Heading]]]] = {
        "rates": (found["gyro"], found["accel"]),
        "increments": (found["dtheta"], found["dvel"]),
    }
    for kind in sorted(
        sets, key=lambda kind: kind != layout.kind
    ):  # the caller's first: it wins over names that say another
        gyros, accels = sets[kind]
        if not gyros or not accels:
            continue
        gyros = _calibrated(_with_values(columns, [axes for axes in gyros if not _of_angles(axes)]))
        if not gyros:
            continue
        accels = _calibrated(_with_gravity(columns, _with_values(columns, accels)) if len(accels) > 1 else accels)
        if len(gyros) > 1 or len(accels) > 1:
            several = gyros if len(gyros) > 1 else accels
            sensor = BLOCKS[kind][0 if several is gyros else 1]
            choices = [{"columns": {f"{sensor}_{axis}": axes[axis].name for axis in "xyz"}} for axes in several]
            raise UnsureError(
                f"{columns.path.name}: {len(several)} sets of columns look like {sensor}: "
                + ", ".join(axes["x"].name for axes in several), choices,
            )  # fmt: skip
        headings = [*(gyros[0][axis] for axis in "xyz"), *(accels[0][axis] for axis in "xyz")]
        names = [heading.name for heading in headings]
        _once(columns, names)
        said = accels[0]["x"].unit
        if said is not None and kind == "rates" and parse_unit(said)[1] == DIMENSIONS["speed"][0]:
            kind = "increments"
        ours = COLUMNS[kind]
        down = _points_down(columns, accels[0])
        signed = [f"-{name}" if down and k > 2 else name for k, name in enumerate(names)]
        why = "their names" + ("; an iPhone's accelerations point down at rest: their signs are turned" if down else "")
        guess = Guess("columns", ", ".join(names), why, 1.0, {"columns": dict(zip(ours, signed))})
        shown = kind if kind == "increments" or said is not None or says_rates(names[3:]) else None
        return Choice(
            shown,
            (),
            [(name, -1.0 if down and k > 2 else 1.0) for k, name in enumerate(names)],
            _units(columns, layout, headings, layout.kind or kind),
            guesses=[guess],
        )
    return None


def _points_down(columns: Columns, axes: dict[str, Heading]) -> bool:
    """Whether accelerations are as an iPhone's framework has them, in g and down at rest: so SensorLog writes them."""
    if axes["x"].family != CORE_MOTION or not any(IPHONE.search(plain(split(name)[0])) for name in columns.names):
        return False
    if axes["x"].unit is not None:
        return axes["x"].unit.casefold() == "g"
    values = columns.read([axes[axis].name for axis in "xyz"], True)
    return abs(gravity_level(values[np.isfinite(values).all(axis=1)]) - 1.0) < 0.2


def _calibrated(sets: list[dict[str, Heading]]) -> list[dict[str, Heading]]:
    """Of several sets of one sensor those that the log does not call uncalibrated."""
    return [axes for axes in sets if "uncal" not in axes["x"].family] or sets


def _with_values(columns: Columns, sets: list[dict[str, Heading]]) -> list[dict[str, Heading]]:
    """Of several sets of one sensor those that have values at all."""
    if len(sets) < 2:
        return sets
    return [axes for axes in sets if not is_empty(columns, [axes[axis].name for axis in "xyz"])] or sets


def _of_angles(axes: dict[str, Heading]) -> bool:
    """Whether headings such as ``rotX (deg)`` are those of angles; ``gyro_x_deg`` is careless for deg/s."""
    unit = axes["x"].unit
    turned = re.search(r"rot|ang", axes["x"].family) is not None and "rate" not in axes["x"].family
    return turned and axes["x"].sensor == "gyro" and unit is not None and parse_unit(unit)[1] == DIMENSIONS["angle"][0]


def _with_gravity(columns: Columns, sets: list[dict[str, Heading]]) -> list[dict[str, Heading]]:
    """Of several sets of accelerations those that hold gravity, which an IMU's do."""
    good = []
    for axes in sets:
        values = columns.read([axes[axis].name for axis in "xyz"], True)
        if accel_readings(gravity_level(values[np.isfinite(values).all(axis=1)]), np.nan, ("rates",)):
            good.append(axes)
    return good or sets
