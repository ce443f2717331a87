"""What every reader shares: named columns of a log become a checked `ImuRecord` in SI units and our axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import DIMENSIONS, parse_quantity, parse_unit
from truenorth.formats.layout import ARRAY_ONLY, Kind, Layout
from truenorth.records import COLUMNS, ImuRecord

Array = NDArray[np.float64]

DIMENSION_OF: dict[Kind, Mapping[str, str]] = {
    "rates": {"gyro": "angular_rate", "accel": "acceleration", "time": "time"},
    "increments": {"gyro": "angle", "accel": "speed", "time": "time"},
}


@dataclass(frozen=True)
class Choice:
    """The columns of a log that are needed, by the log's names."""

    kind: Kind
    time: str | None
    sensors: tuple[str, ...]

    @property
    def names(self) -> list[str]:
        """Time, where there is one, and the six sensor columns."""
        return [*([] if self.time is None else [self.time]), *self.sensors]

    @property
    def labels(self) -> tuple[str, ...]:
        """Seven names for messages."""
        return (self.time or "time", *self.sensors)


def choose(names: Sequence[str], layout: Layout, source: str) -> Choice:
    """Find the columns that are needed among those there are.

    Parameters
    ----------
    names : sequence of str
        The columns there are.
    layout : Layout
    source : str
        File name; messages begin with it.

    Raises
    ------
    DataError
        A column that is missing or there twice; the message lists those found and the nearest name.
    """
    for key in ARRAY_ONLY:
        if key in layout.columns:
            raise UsageError(
                f"{source}: columns: {key!r} is for arrays; name single columns, such as gyro_x and accel_x"
            )
    kind = named_kind(lambda ours: layout.name(ours) in names or ours in layout.columns)
    if kind is None:
        raise DataError(
            f"{source}: no column of an IMU among {', '.join(names) or '(none)'}; expected time, gyro_x .. accel_z (rates "
            "in SI units) or dtheta_x .. dvel_z (increments), or name them with --columns or a YAML file beside the log"
        )
    time = None
    if layout.rate is None or layout.name("time") in names:
        time = _found("time", names, layout, source)
    sensors = tuple(_found(ours, names, layout, source) for ours in COLUMNS[kind])
    return Choice(layout.kind or kind, time, sensors)


def named_kind(there: Callable[[str], bool], columns: Mapping[str, Sequence[str]] = COLUMNS) -> Kind | None:
    """Rates or increments, whichever has more of its columns there; None without any."""
    rates, increments = (sum(map(there, columns[kind])) for kind in ("rates", "increments"))
    if not rates and not increments:
        return None
    return "rates" if rates >= increments else "increments"


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
            raise UsageError(f"{source}: no time in the log; give the samples a second with --rate")
        time = np.arange(1, len(gyro) + 1) / layout.rate
    else:
        check_order(time, labels[0], source, place)
        time = time * unit_factor("time", kind, layout)
    record = ImuRecord(
        time, gyro * unit_factor("gyro", kind, layout), accel * unit_factor("accel", kind, layout), kind, source
    )
    axes = (layout.axes or axes).strip().upper()
    if axes == "RFU":
        return record
    from truenorth.core.attitude import body_axes  # compiled code: not for a log that needs no turning

    return record.rotated(body_axes(axes))


def unit_factor(sensor: str, kind: Kind, layout: Layout) -> float:
    """What a column is multiplied with: SI for one of its units, or for one count where a number stands before the unit."""
    text = layout.units.get(sensor)
    if text is None:
        return 1.0
    factor, found = parse_quantity(text) if text[:1].isdigit() or text[:1] == "." else parse_unit(text)
    dimension = DIMENSION_OF[kind][sensor]
    wanted, example = DIMENSIONS[dimension]
    if found != wanted:
        unit = example.partition(" ")[2]
        raise UsageError(
            f"units: {sensor} {kind if sensor != 'time' else ''} cannot be in {text!r}; expected a unit of "
            f"{dimension.replace('_', ' ')}, such as {unit}"
        )
    return factor


def _found(ours: str, names: Sequence[str], layout: Layout, source: str) -> str:
    wanted = layout.name(ours)
    if names.count(wanted) == 1:
        return wanted
    if wanted in names:
        raise DataError(f"{source}: column {wanted!r} is there {names.count(wanted)} times; rename one")
    taken = {layout.name(name) for columns in COLUMNS.values() for name in ("time", *columns)}
    spare = {name.lower(): name for name in names if name not in taken}
    near = [spare[name] for name in get_close_matches(wanted.lower(), spare, n=1)]
    hint = f"; is it {near[0]!r}? Then --columns {ours}={near[0]}" if near else ""
    if ours == "time":
        hint += "; for a log without time give --rate"
    raise DataError(f"{source}: column {wanted!r} is missing; found {', '.join(names)}{hint}")


def check_finite(values: Array, labels: Sequence[str], source: str, place: Callable[[int], str]) -> None:
    """Refuse NaN and inf among the columns (N, len(labels)) of a file, by place and column."""
    finite = np.isfinite(values)
    if not finite.all():
        row, column = (int(i) for i in np.argwhere(~finite)[0])
        raise DataError(
            f"{source}: {place(row)}, column {labels[column]}: {values[row, column]}; expected a finite number: remove "
            "the row or repair the log"
        )


def check_order(time: Array, label: str, source: str, place: Callable[[int], str]) -> None:
    """Refuse time that does not increase, by its place in the file."""
    bad = np.flatnonzero(np.diff(time) <= 0)
    if bad.size:
        k = int(bad[0]) + 1
        what = "repeats" if time[k] == time[k - 1] else "goes back"
        raise DataError(
            f"{source}: {place(k)}, column {label}: time {what} ({time[k - 1]:.15g}, then {time[k]:.15g}); expected "
            "strictly increasing time: sort the log or drop the repeated rows"
        )
