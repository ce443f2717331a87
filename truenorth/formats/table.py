"""From the columns of a log to a checked `ImuRecord` in SI units and our axes; what the log does not say is found, or asked."""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import DIMENSIONS, parse_quantity, parse_unit
from truenorth.formats.behaviour import (
    JUDGED,
    LARGEST_RATE,
    SURE_GYRO,
    GyroFacts,
    Reading,
    accel_readings,
    are_angles,
    gravity_level,
    gyro_facts,
    gyro_readings,
    is_usual,
    size,
)
from truenorth.formats.blank_rows import without_blank_rows
from truenorth.formats.checks import check_finite, check_order
from truenorth.formats.choice import choose
from truenorth.formats.chosen import Choice
from truenorth.formats.clocks import FEWEST, clock_of_log
from truenorth.formats.columns import Columns
from truenorth.formats.counts import counts_above, device_above, orientation_above
from truenorth.formats.guesses import UnsureError, in_words, take
from truenorth.formats.gyro_step import by_step
from truenorth.formats.layout import Layout, times, unit_factor
from truenorth.formats.names import heading_of, plain
from truenorth.formats.repeats import without_repeats
from truenorth.formats.turns import with_angles
from truenorth.records import COLUMNS, Guess, ImuRecord
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

RATE = re.compile(r"rate|gyr|omega|vel|speed|dps|rad_s|deg_s|(?:^|_)w(?:_|[xyz]|$)|ω")
ANGLE = re.compile(r"rot|ang|theta")
AT_REST = 2e-3  # by which the specific force at rest in ug differs from gravity, with the sensors' errors
CONTRADICTED = 1.0  # of the logarithm, by which gyros turn gravity too far in a unit that is not theirs
FULL_UP = 0.9  # of the specific force along an axis that points up


def record_of(columns: Columns, layout: Layout) -> ImuRecord:
    """The record of a log of named columns.

    Raises
    ------
    DataError
        Bad data, with place and column; gravity in no unit; stamps in bunches.
    UnsureError
        Two readings explain the log. What it offers holds what the caller has said: it may be given as it is.
    UsageError
        A unit of another dimension, or neither time nor rate.
    """
    try:
        return _record_of(columns, layout)
    except UnsureError as error:
        options = [_with_what_is_said(option, layout) for option in error.options]
        raise UnsureError(error.question, options, error.guesses) from None


def _with_what_is_said(option: Mapping[str, Any], layout: Layout) -> dict[str, Any]:
    said: dict[str, Mapping[str, str]] = {"columns": layout.columns, "units": layout.units}
    return {key: {**said[key], **value} if key in said else value for key, value in option.items()}


@np.errstate(
    over="ignore", invalid="ignore"
)  # a cell may hold 1e200: what is too large for any sensor is refused at the end
def _record_of(columns: Columns, layout: Layout) -> ImuRecord:
    source, columns = columns.path.name, with_angles(columns)
    choice = choose(columns, layout)
    guesses = choice.guesses
    columns, (gyro, accel) = without_blank_rows(columns, choice.labels[1:], lambda log: _sensors(log, layout, choice))
    if choice.doubt is not None:
        raise choice.doubt
    columns, kept = without_repeats(columns, choice, gyro, accel)
    if kept is not None:
        gyro, accel = gyro[kept], accel[kept]
    if columns.notes:
        guesses.insert(0, Guess("text", "; ".join(columns.notes), columns.why))
    said_above = _said_above(columns, layout, choice, accel)
    choice.units = {**said_above, **choice.units}
    choice.device |= {**columns.device, **device_above(columns.above, choice.labels[1:4])}
    time, layout = clock_of_log(columns, layout, choice, len(gyro), guesses)
    kind, units = _units(time, gyro, accel, layout, choice, said_above, source, guesses)
    layout = replace(layout, units={**layout.units, **units, "time": "s"}, kind=kind)
    if layout.axes is None:
        layout = _axes(columns, layout, choice, accel, guesses)
    else:
        guesses.append(Guess("axes", layout.axes, "as the caller says", 1.0, {"axes": layout.axes}))
    return finish(
        time, gyro, accel, kind, layout, source, labels=choice.labels, place=columns.place, taken_for=tuple(guesses)
    )


def _said_above(columns: Columns, layout: Layout, choice: Choice, accel: Array) -> dict[str, str]:
    """Sizes of counts that lines above the table name: of what has no unit otherwise, and no gravity in m/s^2 or g as it is."""
    found = {} if choice.documented else counts_above(columns.above)
    counted = bool(np.all(accel[:JUDGED] == np.round(accel[:JUDGED])))
    if not counted and accel_readings(gravity_level(accel), np.nan, ("rates",), ("m/s^2", "g")):
        found.pop("accel", None)
    return {key: unit for key, unit in found.items() if key not in choice.units and key not in layout.units}


def _sensors(columns: Columns, layout: Layout, choice: Choice) -> tuple[Array, Array]:
    """Columns (N, 3) of the gyros and the accelerometers, with signs and scale; the log's own arrays where these are so."""
    names = tuple(name for name, _ in choice.sensors)
    signs = np.array([sign for _, sign in choice.sensors])
    gyro, accel = columns.whole.get(names[:3]), columns.whole.get(names[3:])
    as_they_are = np.all(signs == 1.0) and "scale" not in layout.columns
    if not as_they_are or gyro is None or accel is None or len(gyro) != len(accel):
        values = _scaled(columns, layout, names, columns.read(names, False) * signs)
        check_finite(values, choice.labels[1:], columns.path.name, columns.place)
        return values[:, :3], values[:, 3:]
    check_finite(gyro, choice.labels[1:4], columns.path.name, columns.place)
    check_finite(accel, choice.labels[4:], columns.path.name, columns.place)
    return gyro, accel


def _scaled(columns: Columns, layout: Layout, names: Sequence[str], values: Array) -> Array:
    """Counts times what the caller names as their scale: one value, or one for each column of the array."""
    reference = layout.columns.get("scale")
    if reference is None:
        return values
    if reference not in columns.names:
        raise DataError(f"{columns.path.name}: scale {reference!r} is missing; found {', '.join(columns.names)}")
    scale = columns.read([reference], False)[:, 0]
    if scale.size == 1:
        return values * scale[0]
    places = [_place_in_array(name) for name in names]
    whole = {sum(_array_of(other) == _array_of(name) for other in columns.names) for name in names}
    if whole != {scale.size}:
        raise DataError(
            f"{columns.path.name}: scale {reference!r} has shape {scale.shape}; expected one value, or one for each of the "
            f"{max(whole)} columns of {_array_of(names[0])!r}"
        )
    return values * scale[places]


def _array_of(name: str) -> str:
    return name.partition("[")[0] if "[" in name else name[:-2]


def _place_in_array(name: str) -> int:
    return int(name.partition("[")[2].rstrip("]")) if "[" in name else "xyz".index(name[-1])


# ------------------------------------------------------------------------------------------------- units


def _units(
    time: Array,
    gyro: Array,
    accel: Array,
    layout: Layout,
    choice: Choice,
    above: Container[str],
    source: str,
    guesses: list[Guess],
) -> tuple[Kind, dict[str, str]]:
    """Kind of the rows, and the units of the sensors."""
    said = {
        key: unit for key in ("gyro", "accel") if (unit := layout.units.get(key, choice.units.get(key))) is not None
    }
    kind: Kind | None = layout.kind or choice.kind
    for key, unit in said.items():
        who = (
            "as the caller says" if key in layout.units else "a line above the table" if key in above else "the heading"
        )
        guesses.append(Guess(f"unit of the {_sensor(key)}", unit, who, 1.0, {"units": {key: unit}}))
    if kind is None and "accel" in said:
        kind = "increments" if _dimension(said["accel"]) == DIMENSIONS["speed"][0] else "rates"
    if kind is not None and (choice.documented or len(said) == 2):
        if choice.documented and not said:
            _check_claim(time, gyro, accel, kind, source, guesses)
        return kind, said
    if len(time) < FEWEST:
        kind = kind or "rates"
        guesses.append(Guess("units", "SI where nothing is said", f"{len(time)} rows show nothing", 0.5))
        return kind, said
    interval = float(np.median(np.diff(time)))
    if "accel" not in said:
        kinds: tuple[Kind, ...] = ("rates", "increments") if kind is None else (kind,)
        level = gravity_level(accel)
        readings = accel_readings(level, interval, kinds)
        if not choice.named:
            readings = [r for r in readings if is_usual("accel", r.unit, r.kind)] or readings
        if not readings:
            raise DataError(f"{source}: {_no_gravity(level, accel, kinds[0], interval)}")
        options: list[dict[str, Any]] = [{"kind": r.kind, "units": {"accel": r.unit}} for r in readings]
        best = readings[0]
        # No other numbers are as large.
        exactly = best.unit == "ug" and abs(level * size("ug") / size("g") - 1.0) < AT_REST
        if not is_usual("accel", best.unit, best.kind) and not exactly:
            usual = ("m/s^2", "g") if best.kind == "rates" else ("m/s",)
            options = [options[0], *({"units": {"accel": unit}} for unit in usual)]
            raise UnsureError(
                f"{source}: the accelerometers look like {best.unit}, which few logs are in, and large forces, a log without "
                f"gravity or counts may by chance: {best.why}", options, guesses,
            )  # fmt: skip
        best = take("unit of the accelerometers", readings, options, source, guesses)
        kind, said["accel"] = best.kind, best.unit
    assert kind is not None
    if "gyro" not in said:
        facts = gyro_facts(time, gyro, accel, kind)
        asked = kind == "rates" and not facts.turned and _may_be_angles(choice.labels[1:4], layout)
        if asked and are_angles(time, gyro, accel, facts.turning.best_agreement):
            own = {"columns": dict(zip(COLUMNS["rates"], choice.labels[1:4]))}
            raise UnsureError(
                f"{source}: columns {', '.join(choice.labels[1:4])} turn gravity by what they change by, as angles do; expected "
                "rates: name the columns of the gyros", [own, {"units": {"gyro": "deg/s"}}, {"units": {"gyro": "rad/s"}}], guesses,
            )  # fmt: skip
        known = choice.device.get("gyro")
        if known is not None and not _contradicts(facts, known[0]):
            guesses.append(Guess("unit of the gyros", known[0], known[1], 1.0, {"units": {"gyro": known[0]}}))
            return kind, {**said, "gyro": known[0]}
        readings = by_step(gyro_readings(facts, kind, said["accel"]), gyro, kind)
        if not readings:
            raise DataError(
                f"{source}: the gyros' values are those of a gyro in no usual unit; say the unit, or check that these are the gyros"
            )
        _check_rare(facts, readings, gyro, kind, source, guesses)
        said["gyro"] = take(
            "unit of the gyros", readings, [{"units": {"gyro": r.unit}} for r in readings], source, guesses, SURE_GYRO
        ).unit
    return kind, said


def _contradicts(facts: GyroFacts, unit: str) -> bool:
    """Whether gyros in the unit that their device writes turn too fast, or turn gravity too far, or not enough, for any error."""
    if facts.largest * size(unit) > 2.0 * LARGEST_RATE:
        return True
    return facts.turned and abs(np.log(facts.turning.best_scale * size(unit))) > CONTRADICTED


def _may_be_angles(names: Sequence[str], layout: Layout) -> bool:
    """Whether neither the caller nor their names say that columns are rates: ``rotX``, ``theta_x`` and unknown ones."""
    by_caller = "gyro" in layout.units or any(ours.startswith("gyro") for ours in layout.columns)
    headings = [heading_of(name) for name in names]
    rates = all(heading is not None and ANGLE.search(heading.family) is None for heading in headings)
    return not by_caller and not rates and not any(RATE.search(plain(name)) for name in names)


def _check_rare(
    facts: GyroFacts, readings: Sequence[Reading], gyro: Array, kind: Kind, source: str, guesses: list[Guess]
) -> None:
    """Ask where gyros look like a unit of few logs and do not turn gravity by it, or hold whole numbers, as counts do.

    A vehicle that turns about the vertical looks like a gyro at rest in such a unit. 16.4 counts for one deg/s, as of a common
    sensor, are nearly mrad/s.
    """
    best = readings[0]
    whole = bool(np.all(gyro[:JUDGED] == np.round(gyro[:JUDGED])))
    if is_usual("gyro", best.unit, kind) or (facts.turned and not whole):
        return
    usual = ("deg/s", "rad/s") if kind == "rates" else ("rad", "deg")
    options = [{"units": {"gyro": unit}} for unit in (best.unit, *usual)]
    raise UnsureError(
        f"{source}: the gyros look like {best.unit}, which few logs are in, and counts may by chance: {best.why}; if they are "
        "counts, say how large one is, such as 0.061 deg/s", options, guesses,
    )  # fmt: skip


def _sensor(key: str) -> str:
    return "gyros" if key == "gyro" else "accelerometers"


def _dimension(unit: str) -> Any:
    return (parse_quantity(unit) if unit[:1].isdigit() else parse_unit(unit))[1]


def _no_gravity(level: float, accel: Array, kind: Kind, interval: float) -> str:
    found = f"the accelerometers show {level:.4g} (median of the norm), which is gravity in no usual unit"
    if level == 0.0 or float(np.median(np.std(accel, axis=0))) > 0.5 * level:
        return f"{found}: a log whose gravity was taken out, or other columns; expected specific force"
    count = 9.80665 / level / (interval if kind == "increments" else 1.0)
    unit = f"{count / 9.80665:.4g} g" if kind == "rates" else f"{count * interval:.4g} m/s"
    return f"{found}; if they are counts, say how large one is, such as {in_words({'units': {'accel': unit}})}"


def _check_claim(time: Array, gyro: Array, accel: Array, kind: Kind, source: str, guesses: list[Guess]) -> None:
    """Ask where documented names, which mean SI, stand over numbers that look like another unit."""
    unit = "rad/s" if kind == "rates" else "rad"
    force = "m/s^2" if kind == "rates" else "m/s"
    guesses.append(Guess("units", f"{unit}, {force}", "the documented names mean SI"))
    if len(time) < FEWEST:
        return
    if not accel_readings(gravity_level(accel), float(np.median(np.diff(time))), (kind,), (force,)):
        return  # what is no gravity in SI, the checks of plausibility name
    readings = by_step(gyro_readings(gyro_facts(time, gyro, accel, kind), kind, force), gyro, kind)
    if readings and readings[0].unit != unit:
        best = readings[0]
        claim = next((r.why for r in readings if r.unit == unit), f"in {unit} they cannot be a gyro's")
        options = [{"units": {"gyro": best.unit, "accel": force}}, {"units": {"gyro": unit, "accel": force}}]
        raise UnsureError(
            f"{source}: the gyros' columns have the documented names, which mean {unit}, but look like {best.unit}: {best.why}; "
            f"{claim}", options, guesses,
        )  # fmt: skip


# -------------------------------------------------------------------------------------------------- axes


def _axes(columns: Columns, layout: Layout, choice: Choice, accel: Array, guesses: list[Guess]) -> Layout:
    mean = np.array([np.median(a) for a in accel.T])
    size_ = float(np.linalg.norm(mean))
    up = mean / size_ if size_ > 0.0 else np.zeros(3)
    axis = int(np.argmax(np.abs(up)))
    shown = f"the specific force points along ({up[0]:+.2f}, {up[1]:+.2f}, {up[2]:+.2f}), which is up at rest"
    if (orientation := orientation_above(columns.above)) is not None:
        shown = f"x, y and z are the sensor's own, the line orientation {orientation} is of a camera and not applied; {shown}"
    headerless = not columns.named and choice.time and columns.names.index(choice.time[0]) == 0
    if headerless and layout.kind == "increments" and up[2] < -FULL_UP:
        guesses.append(
            Guess("axes", "FRD", f"{shown}; rows of time and increments, z down, are KF-GINS's", 1.0, {"axes": "FRD"})
        )
        return replace(layout, axes="FRD")
    if axis == 2 and up[2] > 0.0:
        why = f"{shown}; which of x and y is forward, no log shows"
        guesses.append(Guess("axes", "RFU", why, 1.0, {"axes": "RFU"}))
    else:
        guesses.append(Guess("axes", "RFU", f"{shown}: this is doubtful", 0.5, {"axes": "RFU"}))
    return layout


def finish(
    time: Array | None,
    gyro: Array,
    accel: Array,
    kind: Kind,
    layout: Layout,
    source: str,
    *,
    axes: str = "RFU",
    labels: Sequence[str] | None = None,
    place: Callable[[int], str] = lambda row: f"row {row + 1}",
    taken_for: tuple[Guess, ...] = (),
) -> ImuRecord:
    """Check values as they were read, then give them our units, axes and time.

    Parameters
    ----------
    time : (N,) array or None
        None is made from the rate; the first sample's interval ends at ``1 / rate``.
    gyro, accel : (N, 3) arrays
    kind : {"rates", "increments"}
    layout : Layout
    source : str
    axes : str
        The format's own, where the layout has none.
    labels : sequence of str, optional
        What the file calls time and the six columns.
    place : callable
        Where a row stands in the file, in words.
    taken_for : tuple of Guess

    Raises
    ------
    DataError
        A number that is not finite, or time that does not increase: with place and column of the file.
    UsageError
        A unit of another dimension, or no time and no rate.
    """
    labels = labels or ("time", *COLUMNS[kind])
    for name, values in (("time", time), ("gyro", gyro), ("accel", accel)):
        if values is not None:
            first = {"time": 0, "gyro": 1, "accel": 4}[name]
            check_finite(values.reshape(len(values), -1), labels[first:], source, place)
    if time is None:
        if layout.rate is None:
            raise UsageError(f"{source}: no time in the log; give the rate")
        time = np.arange(1, len(gyro) + 1) / layout.rate
    else:
        check_order(time, labels[0], source, place)
        time = times(time, unit_factor("time", kind, layout))
    rates, forces = times(gyro, unit_factor("gyro", kind, layout)), times(accel, unit_factor("accel", kind, layout))
    record = ImuRecord(time, rates, forces, kind, source, taken_for)
    axes = (layout.axes or axes).strip().upper()
    if axes == "RFU":
        return record
    from truenorth.core.attitude import body_axes  # compiled code: not for a log that needs no turning

    return record.rotated(body_axes(axes))
