"""What every reader shares: a table of named columns becomes a checked `ImuRecord` in SI units and our axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import DataError, UsageError
from truenorth.records import COLUMNS, ImuRecord
from truenorth.units import DIMENSIONS, parse_unit

Array = NDArray[np.float64]

DIMENSION_OF = {"rates": ("angular_rate", "acceleration"), "increments": ("angle", "speed")}


@dataclass(frozen=True)
class Layout:
    """How a log is to be read; options of the call win over a YAML file beside the log.

    Attributes
    ----------
    columns : mapping
        Our column name to the log's.
    units : str or None
        Units of gyro and accelerometer columns, such as ``"deg/s,g"``; SI when left out.
    axes : str
        Where x, y and z point, such as ``"FRD"``.
    rate : float or None, Hz
        For a log without a time column.
    time_unit : str
    kind : {"rates", "increments"} or None
        Read off the column names when left out.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: str | None = None
    axes: str = "RFU"
    rate: float | None = None
    time_unit: str = "s"
    kind: Literal["rates", "increments"] | None = None


def layout_beside(path: Path, given: Mapping[str, Any]) -> Layout:
    """The layout from ``LOG.yaml`` beside ``LOG.csv``, where it exists, with the options that were given on top.

    Raises
    ------
    DataError
        A key of the file that is not known; the message names file and key.
    """
    known = {item.name for item in fields(Layout)}
    values: dict[str, Any] = {}
    beside = path.with_suffix(".yaml")
    if beside.is_file() and beside != path:
        import yaml

        try:
            content = yaml.safe_load(beside.read_text(encoding="utf-8")) or {}
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            raise DataError(f"{beside}: not a YAML file: {error}") from None
        if not isinstance(content, Mapping):
            raise DataError(f"{beside}: expected keys such as columns, units, axes and rate, found {content!r}")
        for key, value in content.items():
            if key not in known:
                raise DataError(f"{beside}: key {key!r} is not known; known: {', '.join(sorted(known))}")
            values[key] = value
    values |= {key: value for key, value in given.items() if value is not None}
    return Layout(**values)


def record_from_columns(
    names: list[str],
    get: Callable[[str], Array],
    layout: Layout,
    source: str,
) -> ImuRecord:
    """Pick, scale and turn the columns of a table.

    Parameters
    ----------
    names : list of str
        The columns there are.
    get : callable
        Gives one column by its name in the log.
    layout : Layout
    source : str
        File name; messages begin with it.

    Raises
    ------
    DataError
        A column that is missing; the message lists those found and the nearest name.
    """
    kind = layout.kind or _kind_of(names, layout, source)
    gyro, accel = (
        np.column_stack([get(_named(name, names, layout, source)) for name in COLUMNS[kind][group]])
        for group in (slice(0, 3), slice(3, 6))
    )
    time = None
    if layout.rate is None or layout.columns.get("time", "time") in names:
        time = get(_named("time", names, layout, source)) * _factor(layout.time_unit, "time")
    return finish(time, gyro, accel, kind, layout, source)


def finish(
    time: Array | None, gyro: Array, accel: Array, kind: Literal["rates", "increments"], layout: Layout, source: str
) -> ImuRecord:
    """Units, axes and time of arrays that were read; the record checks itself."""
    from truenorth.attitude import body_axes

    units = (layout.units or "").split(",") if layout.units else []
    if units:
        if len(units) != 2:
            raise UsageError(f"units {layout.units!r}; expected two, of gyro and accelerometer, such as 'deg/s,g'")
        gyro_dimension, accel_dimension = DIMENSION_OF[kind]
        gyro = gyro * _factor(units[0], gyro_dimension)
        accel = accel * _factor(units[1], accel_dimension)
    if time is None:
        if layout.rate is None or not layout.rate > 0.0:
            raise UsageError(f"{source}: no time column, and rate {layout.rate}; give the samples a second with --rate")
        time = np.arange(1, len(gyro) + 1) / layout.rate
    record = ImuRecord(time, gyro, accel, kind, source)
    C = body_axes(layout.axes)
    return record if np.array_equal(C, np.eye(3)) else record.rotated(C)


def _factor(unit: str, dimension: str) -> float:
    factor, found = parse_unit(unit)
    wanted, example = DIMENSIONS[dimension]
    if found != wanted:
        raise UsageError(
            f"unit {unit.strip()!r} is not one of {dimension.replace('_', ' ')}; expected something like that of {example!r}"
        )
    return factor


def _kind_of(names: list[str], layout: Layout, source: str) -> Literal["rates", "increments"]:
    scores: dict[Literal["rates", "increments"], int] = {
        kind: sum(layout.columns.get(name, name) in names for name in COLUMNS[kind]) for kind in ("rates", "increments")
    }
    if max(scores.values()) == 0:
        raise DataError(
            f"{source}: no column of an IMU: found {', '.join(names) or 'none'}; expected time, gyro_x .. accel_z (rates in "
            "SI units) or dtheta_x .. dvel_z (increments), or name them with --columns or a YAML file beside the log"
        )
    return max(scores, key=lambda kind: scores[kind])


def _named(name: str, names: list[str], layout: Layout, source: str) -> str:
    wanted = layout.columns.get(name, name)
    if wanted in names:
        return wanted
    near = get_close_matches(wanted, names, n=1)
    hint = f"; is it {near[0]!r}? Then --columns {name}={near[0]}" if near else ""
    if name == "time":
        hint += "; for a log without time give --rate"
    raise DataError(f"{source}: column {wanted!r} is missing; found {', '.join(names)}{hint}")


def with_defaults(layout: Layout, **defaults: Any) -> Layout:
    """A format's own layout where nobody asked for another."""
    blank = Layout()
    return replace(layout, **{k: v for k, v in defaults.items() if getattr(layout, k) == getattr(blank, k)})
