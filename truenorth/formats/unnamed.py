"""Columns of an IMU whose names do not say what they are: accelerometers show gravity, gyros are the three next to them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.core.units import DIMENSIONS, parse_unit
from truenorth.formats.behaviour import accel_readings, gravity_level, is_usual
from truenorth.formats.chosen import MOST_COLUMNS, Choice, with_time
from truenorth.formats.clock_face import FEWEST
from truenorth.formats.columns import Columns, listed
from truenorth.formats.guesses import UnsureError
from truenorth.formats.layout import Layout
from truenorth.formats.names import plain
from truenorth.formats.others import are_forces, is_doubtful, needs_a_question, others_of, quaternions
from truenorth.formats.units import split, unit_in
from truenorth.records import COLUMNS, Guess

Array = NDArray[np.float64]

AXIS = re.compile(r"(?<![a-z])[xyz](?![a-z])|(?<=[a-z])[xyz](?![a-z])")
VEHICLES = {"roll": "x", "pitch": "y", "yaw": "z", "long": "x", "lat": "y", "vert": "z"}
VEHICLE = re.compile(r"(?<![a-z])(?:roll|pitch|yaw)(?=_?rate)|(?<=rate_)(?:roll|pitch|yaw)|(?<=acc_)(?:long|lat|vert)")
PART = re.compile(r"(.+)\[\d+\]")  # a column of an array, and no unit behind a name


def by_behaviour(columns: Columns, layout: Layout, given: Mapping[str, list[str]] | None = None) -> Choice:
    """Of columns whose names do not tell: a clock increases, accelerometers show gravity, gyros are the three next to them.

    The three columns of ``gyro`` or of ``accel`` may be `given`: then those of the other sensor are looked for.
    """
    known = dict(given or {})
    source, whole = columns.path.name, columns
    if columns.rows:  # of arrays those of the most rows: other devices' may come first, and be many
        most = max(columns.rows.values())
        columns = replace(columns, names=[name for name in columns.names if columns.rows[name] == most])
    numbers = {}
    for name in columns.names[:MOST_COLUMNS]:
        try:
            numbers[name] = columns.read([name], True)[:, 0]
        except DataError:
            continue  # text
    longest = max((len(v) for v in numbers.values()), default=0)
    numbers = {name: v for name, v in numbers.items() if len(v) == longest}
    choice = Choice(None, (), [], named=False)
    if longest >= 3:
        choice = with_time(whole if "time" in layout.columns else columns, layout, choice)
    # No sensor's values increase in each of many rows: a counter's do, or those of a clock where the rate is given.
    skip = set(choice.time) | {
        name for name, v in numbers.items() if np.all(v[1:] > v[:-1] if longest > FEWEST else np.diff(v) == 1.0)
    }
    skip |= {name for three in known.values() for name in three}
    free = [name for name, v in numbers.items() if name not in skip and np.isfinite(v).all()]
    left_out = others_of(free, [list(three.values()) for three in _threes(free).values()]) if columns.named else set()
    blocks, forces = _sets(columns, choice, numbers, free, left_out, columns.named)
    surely = {name for name in left_out if not is_doubtful(name)}
    if surely < left_out and (
        not forces or len(blocks) < 2 - len(known)
    ):  # names that may be those of sensors all the same
        blocks, forces = _sets(columns, choice, numbers, free, surely)
    if known:
        forces = [known["accel"]] if "accel" in known else forces
        blocks = [*(blocks if "accel" in known else forces), *known.values()]
    from truenorth.formats.sensor_folder import hint

    gyros = bool(forces) and any("gyr" in plain(name) for name in forces[0])  # counts of theirs with an offset
    if longest >= 3 and forces and len(blocks) < 2 and not gyros:
        raise DataError(
            f"{source}: columns {' '.join(forces[0])} show gravity, and no other three may be gyros among "
            f"{listed(whole.names)}; expected rates about three axes next to specific forces: name the columns of the gyros"
            + hint(columns.path)
        )
    if longest < 3 or not forces or len(blocks) < 2:
        raise DataError(
            f"{source}: no columns of an IMU among {listed(whole.names)}; expected time, gyro_x .. accel_z (rates "
            "in SI units) or dtheta_x .. dvel_z (increments), or other usual names: name the columns"
            + hint(columns.path)
        )
    others = [block for block in blocks if block not in forces] if len(forces) == 1 else []
    if len(forces) > 1 or len(others) > 1:
        sensor, several = ("accel", forces) if len(forces) > 1 else ("gyro", others)
        options = [{"columns": {f"{sensor}_{axis}": name for axis, name in zip("xyz", block)}} for block in several]
        raise UnsureError(
            f"{source}: {len(several)} sets of three columns may be the {'accelerometers' if sensor == 'accel' else 'gyros'}: "
            + ", ".join(" ".join(block) for block in several), options, choice.guesses,
        )  # fmt: skip
    names = [*others[0], *forces[0]]
    if left_out & set(forces[0]) and any("grav" in plain(name) for name in forces[0]):
        raise UnsureError(
            f"{source}: no other columns than {' '.join(forces[0])} show gravity, and they show nothing else by their names: name "
            "the columns of the accelerometers",
            [{"columns": {f"accel_{axis}": name for axis, name in zip("xyz", forces[0])}}], choice.guesses,
        )  # fmt: skip
    if left_out & set(others[0]) and needs_a_question(others[0], forces[0]):
        raise UnsureError(
            f"{source}: columns {' '.join(forces[0])} show gravity, and no other three may be gyros than {' '.join(others[0])}, "
            "which by their names are no rates: name the columns of the gyros",
            [{"columns": {f"gyro_{axis}": name for axis, name in zip("xyz", others[0])}}], choice.guesses,
        )  # fmt: skip
    why = f"the norm of columns {' '.join(forces[0])} is gravity's; {' '.join(others[0])} are the three others"
    choice.sensors = [(name, 1.0) for name in names]
    choice.units = {**choice.units, **_units(names)}
    choice.guesses.append(Guess("columns", ", ".join(names), why, 1.0, {"columns": dict(zip(COLUMNS["rates"], names))}))
    return choice


def _sets(
    columns: Columns,
    choice: Choice,
    numbers: dict[str, Array],
    names: list[str],
    left_out: set[str],
    strictly: bool = False,
) -> tuple[list[list[str]], list[list[str]]]:
    """Threes of columns that may be sensors, and those of them that show gravity."""
    free = [name for name in names if name not in left_out]
    turned = quaternions({name: numbers[name] for name in free})
    free = [name for name in free if name not in turned]
    at = {name: columns.names.index(name) - k for k, name in enumerate(free)}  # changes where a column is left out
    groups = [list(part) for _, part in groupby(free, _variable)]
    blocks = [block for group in groups for block in _blocks(group, at)]
    clock = columns.clock(choice.time[0])[0] if choice.time else np.empty(0)
    interval = float(np.median(np.diff(clock))) if len(clock) > 1 else np.nan
    forces = [
        block for block in blocks
        if _constant(values := np.column_stack([numbers[name] for name in block]))
        and any(
            is_usual("accel", reading.unit, reading.kind)
            for scale in (1.0, 1e-3, 1e-6, 1e-9, 1e-4)
            for reading in accel_readings(gravity_level(values), interval * scale, ("rates", "increments"))
        )
    ]  # fmt: skip
    blocks = [block for block in blocks if block in forces or not (strictly and are_forces(block))]
    still = [block for block in blocks if not any(np.ptp(numbers[name]) > 0.0 for name in block)]
    forces = _without(still, forces)
    others = _without(still, [block for block in blocks if block not in forces])
    blocks = [block for block in blocks if block in forces or block in others]
    alone = [pair for group in groups if (pair := _pair(group, blocks, forces))]
    return (
        alone[0] if len(alone) == 1 else (blocks, forces)
    )  # one variable is an IMU by itself, whatever the others are


def _units(names: list[str]) -> dict[str, str]:
    """Units of rates and specific forces that the headings of three columns agree on."""
    result = {}
    for sensor, dimension, three in (("gyro", "angular_rate", names[:3]), ("accel", "acceleration", names[3:])):
        said = {unit_in(split(name)[1] or "") for name in three}
        unit = said.pop()
        if not said and unit is not None and parse_unit(unit)[1] == DIMENSIONS[dimension][0]:
            result[sensor] = unit
    return result


def _without(still: list[list[str]], blocks: list[list[str]]) -> list[list[str]]:
    """The blocks that change, or all where none does: what never changes, as a covariance, is no sensor if there is another."""
    return [block for block in blocks if block not in still] or blocks


def _blocks(group: list[str], at: dict[str, int]) -> list[list[str]]:
    """Threes of columns: those whose names differ by x, y and z alone, in that order, and of the others each three in a row.

    A row ends where `at` changes: no column is missing inside a three.
    """
    threes = _threes(group)
    taken = {name: stem for stem, three in threes.items() for name in three.values()}
    blocks: list[list[str]] = []
    for (is_three, _), names in groupby(group, lambda name: (name in taken, name not in taken and at[name])):
        run = list(names)
        if is_three:
            blocks += [[threes[stem][axis] for axis in "xyz"] for stem in dict.fromkeys(taken[name] for name in run)]
        else:
            blocks += [run[i : i + 3] for i in range(0, len(run) - 2, 3)]
    return [block for k, block in enumerate(blocks) if block not in blocks[:k]]


def _threes(names: list[str]) -> dict[str, dict[str, str]]:
    """Headings that differ by x, y and z alone: by what they have in common, and by axis."""
    axes: dict[str, dict[str, str]] = {}
    for name in names:
        for stem, axis in _of_axis(name):
            axes.setdefault(stem, {}).setdefault(axis, name)
    return {stem: three for stem, three in axes.items() if len(three) == 3}


def _of_axis(name: str) -> list[tuple[str, str]]:
    """A heading without its axis, and the axis: x, y or z as a word or at the end of one, or that which a vehicle rolls about."""
    words = plain(split(name)[0])
    found = [(AXIS.sub("*", words, count=1), match[0]) for match in AXIS.finditer(words)][:1]
    turned = VEHICLE.search(words)
    return found or ([(VEHICLE.sub("*", words, count=1), VEHICLES[turned[0]])] if turned else [])


def _variable(name: str) -> str:
    """The array that a column belongs to, as ``u`` of ``u[3]``; nothing for the columns of a table."""
    of_array = PART.fullmatch(name)
    return of_array[1] if of_array else ""


def _pair(
    group: list[str], blocks: list[list[str]], forces: list[list[str]]
) -> tuple[list[list[str]], list[list[str]]] | None:
    """The blocks of a variable that has two, and the one of them that shows gravity; None of any other variable."""
    own = [block for block in blocks if block[0] in group]
    shown = [block for block in own if block in forces]
    return (own, shown) if len(own) == 2 and len(shown) == 1 else None


def _constant(values: Array) -> bool:
    """Whether the norm of three columns stays about the same, as gravity does."""
    norm = np.linalg.norm(values, axis=1)
    low, middle, high = np.quantile(norm, [0.25, 0.5, 0.75])
    return bool(middle > 0.0 and (high - low) < 0.3 * middle)
