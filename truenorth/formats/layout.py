"""How a log is to be read: by the options of the call, and by a small YAML file next to the log."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import is_file
from truenorth.core.units import DIMENSIONS, parse_quantity, parse_unit
from truenorth.core.yaml_file import read_mapping, unknown_key
from truenorth.records import COLUMNS
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

BLOCKS: dict[str, tuple[str, str]] = {"rates": ("gyro", "accel"), "increments": ("dtheta", "dvel")}
ARRAY_ONLY = (*BLOCKS["rates"], *BLOCKS["increments"], "scale", "interval")
DIMENSION_OF: dict[Kind, dict[str, str]] = {
    "rates": {"gyro": "angular_rate", "accel": "acceleration", "time": "time"},
    "increments": {"gyro": "angle", "accel": "speed", "time": "time"},
}
SLOWEST, FASTEST = 1e-6, 1e9  # Hz, of a rate that is given
KNOWN_COLUMNS = ("time", *COLUMNS["rates"], *COLUMNS["increments"], *ARRAY_ONLY)


@dataclass(frozen=True)
class Layout:
    """How a log is to be read."""

    # our column names to the log's; a minus before the latter turns the sign. For ``.npz`` and ``.mat`` also ``gyro, accel``
    # (``dtheta, dvel``) to arrays of three columns, ``scale`` to what the sensor values are multiplied with, and ``interval``
    # to the sampling interval.
    columns: Mapping[str, str] = field(default_factory=dict)
    # of ``gyro``, ``accel`` and ``time``; SI where left out. A number before the unit (``0.05 deg/s``) is the size of one
    # count.
    units: Mapping[str, str] = field(default_factory=dict)
    axes: str | None = None  # where x, y and z point, such as ``"FRD"``; None leaves it to the format
    rate: float | None = None  # Hz; for a log without time
    kind: Kind | None = None  # by the names of the columns when left out
    topic: str | None = None  # of a ROS bag with several IMUs


def layout_for(path: Path, given: Mapping[str, Any]) -> Layout:
    """The layout in ``LOG.yaml`` next to ``LOG.csv``, where that exists, with the options of the call on top.

    Raises
    ------
    DataError
        A key of the file that is not known or holds a wrong value; the message names file and key.
    UsageError
        The same in the options of the call.
    """
    return Layout(**options_for(path, given, _checked))


def options_for(
    path: Path, given: Mapping[str, Any], checked: Callable[[Mapping[Any, Any]], dict[str, Any]]
) -> dict[str, Any]:
    """The options in the YAML file next to a log with those of the call, where they are not None, on top.

    Parameters
    ----------
    checked : callable
        Refuses what is wrong with a UsageError, and gives the rest in the form that readers want.

    Raises
    ------
    DataError
        Something is wrong in the file; the message names it.
    UsageError
        The same in the options of the call.
    """
    values: dict[str, Any] = {}
    nearby = path.with_suffix(".yaml") if path.name else path / ".yaml"
    if is_file(nearby):
        try:
            values = checked(read_mapping(nearby))
        except UsageError as error:
            raise DataError(f"{nearby} (the layout of {path.name}): {error}") from None
    return values | checked({key: value for key, value in given.items() if value is not None})


def without_imu(content: Mapping[Any, Any], known: Sequence[str]) -> dict[Any, Any]:
    """What a layout says of a log's other sensors than its IMU: a device's log holds both, and has one layout.

    Parameters
    ----------
    known : sequence of str
        Options of the other sensor, which stay.
    """
    mine = {"columns": KNOWN_COLUMNS, "units": ("gyro", "accel")}
    left = {
        key: value for key, value in content.items() if key in (*mine, *known) or key not in Layout.__dataclass_fields__
    }
    for key, names in mine.items():
        if isinstance(left.get(key), Mapping):
            left[key] = {name: text for name, text in left[key].items() if name not in names or name == "time"}
    return left


def _checked(content: Mapping[Any, Any]) -> dict[str, Any]:
    known = [item.name for item in fields(Layout)]
    values = dict(content)
    for key in values:
        if key not in known:
            raise UsageError(unknown_key("layout", key, known))
    if "columns" in values:
        values["columns"] = _columns(values["columns"])
    if "units" in values:
        values["units"] = _units(values["units"])
    if "rate" in values:
        values["rate"] = _rate(values["rate"])
    if values.get("kind", "rates") not in BLOCKS:
        raise UsageError(f"kind {values['kind']!r} is not known; use rates or increments")
    for key in ("axes", "topic"):
        if not isinstance(values.get(key, ""), str):
            raise UsageError(f"{key} is {values[key]!r}; expected text")
    return values


def _columns(value: Any) -> dict[str, str]:
    return _texts("columns", value, KNOWN_COLUMNS, "our names to the log's, such as gyro_x: wx")


def _texts(what: str, value: Any, known: Sequence[str], wanted: str) -> dict[str, str]:
    """A mapping of known keys to texts."""
    if not isinstance(value, Mapping):
        raise UsageError(f"{what} are {value!r}; expected {wanted}")
    for key in value:
        if key not in known:
            raise UsageError(unknown_key(what, key, known))
    return {key: str(text) for key, text in value.items()}


def _units(value: Any) -> dict[str, str]:
    names = ("gyro", "accel", "time")
    if isinstance(value, str) and "=" in value:
        value = {key.strip(): text.strip() for key, _, text in (part.partition("=") for part in value.split(","))}
    if isinstance(value, str):
        parts = [part.strip() for part in value.split(",")]
        if len(parts) not in (2, 3) or not all(parts):
            raise UsageError(
                f"units {value!r}; expected those of gyro and accelerometer, such as 'deg/s,g' (or 'deg/s,g,ms')"
            )
        return dict(zip(names, parts))
    return _texts("units", value, names, "text such as 'deg/s,g', or gyro: deg/s and accel: g")


def _rate(value: Any) -> float:
    from truenorth.core.units import parse

    rate = parse(value, "frequency") if isinstance(value, str) else value
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not SLOWEST <= rate <= FASTEST:
        raise UsageError(f"rate is {value!r}; expected samples a second, such as 100")
    return float(rate)


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


def times(values: Array, factor: float) -> Array:
    """Values in another unit; as they are where it is the same."""
    return values if factor == 1.0 else values * factor
