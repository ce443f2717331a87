"""Named arrays, as NumPy and MATLAB keep them: one for each column, one for each sensor, or one for all.

``columns`` maps our names to variables. A variable may be a part of an array, ``counts[0:3]`` or ``imu[6]``, its columns
counted from 0; ``scale`` names what the sensor arrays are multiplied with, one value or one for each column of the array;
``interval`` names a single value, the sampling interval, where there is no time. A field of a MATLAB struct is
``trj.imu``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.formats.layout import BLOCKS, Kind, Layout
from truenorth.formats.table import choose, finish, named_kind, unit_factor
from truenorth.records import COLUMNS, ImuRecord

Array = NDArray[np.float64]

REFERENCE = re.compile(r"([^\[\]]+?)\s*(?:\[\s*(\d+)\s*(?::\s*(\d+)\s*)?\])?")
INTERVAL_NAMES = ("ts", "Ts", "dt", "interval")


def record_from_arrays(variables: Mapping[str, Any], layout: Layout, source: str) -> ImuRecord:
    """A record from the variables of a file.

    Raises
    ------
    DataError
        A variable that is missing or has another shape; the message lists those found.
    UsageError
        A reference that cannot be read, or neither time nor interval nor rate.
    """
    kind = _kind_of_blocks(variables, layout)
    if kind is None:
        return _record_from_vectors(variables, layout, source)
    gyro, accel = (_block(variables, layout, ours, source) for ours in BLOCKS[kind])
    time = None
    if "time" in layout.columns or "time" in variables:
        time = _part(variables, layout.name("time"), source)[0]
        if time.size != max(time.shape):
            raise DataError(f"{source}: time {layout.name('time')!r} has shape {time.shape}; expected (N,)")
        time = time.reshape(-1)
    if not len(gyro) == len(accel) == (len(gyro) if time is None else len(time)):
        sizes = f"{len(gyro)} and {len(accel)} rows" + ("" if time is None else f", time {len(time)}")
        raise DataError(f"{source}: gyro and accelerometer have {sizes}; expected as many of each")
    kind = layout.kind or kind
    return finish(time, gyro, accel, kind, layout if time is not None else _rated(variables, layout, source), source)


def _record_from_vectors(variables: Mapping[str, Any], layout: Layout, source: str) -> ImuRecord:
    """A record of one variable for each column."""
    names = [name for name, value in variables.items() if np.ndim(value) == 1]
    if not any(layout.name(ours) in names for kind in COLUMNS for ours in COLUMNS[kind]):
        raise DataError(
            f"{source}: no variables of an IMU; found {', '.join(variables) or 'none'}; expected time, gyro and accel, (N,) and "
            "(N, 3), or dtheta and dvel, or name them with --columns gyro=...,accel=..."
        )
    if layout.name("time") not in names:
        layout = _rated(variables, layout, source)
    columns = {ours: name for ours, name in layout.columns.items() if ours != "interval"}
    layout = replace(layout, columns=columns)
    choice = choose(names, layout, source)
    values = {name: _numbers(variables[name], name, source) for name in choice.names}
    if len({len(column) for column in values.values()}) != 1:
        sizes = ", ".join(f"{name} {len(column)}" for name, column in values.items())
        raise DataError(f"{source}: columns of different length ({sizes}); expected as many of each")
    time = None if choice.time is None else values[choice.time]
    sensors = np.column_stack([values[name] for name in choice.sensors])
    return finish(time, sensors[:, :3], sensors[:, 3:], choice.kind, layout, source, labels=choice.labels)


def _kind_of_blocks(variables: Mapping[str, Any], layout: Layout) -> Kind | None:
    """Rates or increments, whichever arrays of three columns are there; None without any."""
    asked = named_kind(lambda ours: ours in layout.columns, BLOCKS)
    if asked is not None:
        return asked
    return named_kind(lambda ours: ours in variables and np.ndim(variables[ours]) == 2, BLOCKS)


def _part(variables: Mapping[str, Any], reference: str, source: str) -> tuple[Array, slice]:
    """The array that a reference such as ``counts[0:3]`` names, and which columns of the whole it is."""
    match = REFERENCE.fullmatch(reference.strip())
    if match is None:
        raise UsageError(
            f"{source}: cannot read the reference {reference!r}; write it like counts, counts[0:3] or imu[6]"
        )
    name, first, last = match.groups()
    if name not in variables:
        near = get_close_matches(name, variables, n=1)
        hint = f"; is it {near[0]!r}?" if near else ""
        raise DataError(f"{source}: variable {name!r} is missing; found {', '.join(variables) or 'none'}{hint}")
    values = _numbers(variables[name], name, source)
    if first is None:
        return values, slice(None)
    columns = slice(int(first), int(last or int(first) + 1))
    if values.ndim != 2 or not columns.start < columns.stop <= values.shape[1]:
        raise DataError(f"{source}: {reference!r}: variable {name!r} has shape {values.shape} and no such columns")
    return values[:, columns], columns


def _block(variables: Mapping[str, Any], layout: Layout, ours: str, source: str) -> Array:
    """A sensor's three columns, (N, 3), scaled."""
    reference = layout.name(ours)
    values, columns = _part(variables, reference, source)
    if values.ndim == 2 and values.shape[0] == 3 != values.shape[1]:
        values = values.T  # MATLAB users keep time in either direction
    if values.ndim != 2 or values.shape[1] != 3:
        raise DataError(
            f"{source}: {reference!r} has shape {values.shape}; expected (N, 3): {ours} x, y and z. Of a larger array name "
            f"a part, such as {reference}[0:3]"
        )
    if "scale" not in layout.columns:
        return values
    scale = np.atleast_1d(_part(variables, layout.columns["scale"], source)[0])
    width = np.shape(variables[reference.partition("[")[0].strip()])[-1] if columns != slice(None) else 3
    if scale.shape not in ((1,), (width,)):
        raise DataError(
            f"{source}: scale {layout.columns['scale']!r} has shape {scale.shape}; expected one value, or one for each of "
            f"the {width} columns of {reference.partition('[')[0]!r}"
        )
    return values * (scale[columns] if scale.size > 1 else scale)


def _rated(variables: Mapping[str, Any], layout: Layout, source: str) -> Layout:
    """The layout of a log without time, with its rate: the one that was given, or that of the interval it names."""
    if layout.rate is not None:
        return layout
    if "interval" not in layout.columns:
        known = [name for name in INTERVAL_NAMES if name in variables and np.size(variables[name]) == 1]
        hint = f" (is it {known[0]!r}?)" if known else ""
        raise UsageError(
            f"{source}: no variable {layout.name('time')!r} among {', '.join(variables)}; name it with --columns time=..., "
            f"or the sampling interval with --columns interval=...{hint}, or give --rate"
        )
    interval = _part(variables, layout.columns["interval"], source)[0]
    if interval.size != 1 or not 0.0 < interval.item() < np.inf:
        raise DataError(f"{source}: interval {layout.columns['interval']!r} is {interval}; expected one positive time")
    return replace(layout, rate=1.0 / (interval.item() * unit_factor("time", "rates", layout)))


def _numbers(value: Any, name: str, source: str) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.ndim > 2:
        raise DataError(
            f"{source}: variable {name!r} is an array of {array.dtype} of shape {array.shape}; expected numbers, (N,) or (N, 3)"
        )
    return array.astype(np.float64)
