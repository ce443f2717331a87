"""Readers and writers of logs of the IMU and of aiding sensors, one format a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from truenorth.core.lazy import lazy
from truenorth.core.paths import as_path, unreadable
from truenorth.core.plugins import plugin, plugins
from truenorth.formats import devices
from truenorth.formats.detect import FORMATS, SUFFIXES, format_of
from truenorth.formats.guesses import UnsureError, write_layout
from truenorth.formats.layout import Layout, layout_for
from truenorth.formats.opening import columns_of
from truenorth.formats.table import record_of
from truenorth.formats.zipped import unpacked
from truenorth.records import ImuRecord

if TYPE_CHECKING:
    from truenorth.formats.aiding import read_encoder, read_height, read_odometer, read_velocity
    from truenorth.formats.gnss import read_gnss
    from truenorth.formats.poses import read_master, read_trajectory
    from truenorth.formats.writing import write_imu, write_record

__all__ = [
    "FORMATS",
    "UnsureError",
    "read_encoder",
    "read_gnss",
    "read_height",
    "read_imu",
    "read_master",
    "read_odometer",
    "read_trajectory",
    "read_velocity",
    "write_imu",
    "write_layout",
    "write_record",
]

# An IMU's log alone is read without the readers of all that may aid it.
__getattr__, _ = lazy(
    __name__,
    {
        "read_encoder": "aiding",
        "read_gnss": "gnss",
        "read_height": "aiding",
        "read_master": "poses",
        "read_odometer": "aiding",
        "read_trajectory": "poses",
        "read_velocity": "aiding",
        "write_imu": "writing",
        "write_record": "writing",
    },
)


def __dir__() -> list[str]:
    return sorted(__all__)


READERS = {
    "mat": ("mat", "read"),
    "psins": ("psins", "read"),
    "kf-gins": ("kf_gins", "read_text"),
    "kf-gins-binary": ("kf_gins", "read_binary"),
}


def read_imu(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    units: str | Mapping[str, str] | None = None,
    axes: str | None = None,
    rate: float | None = None,
    columns: Mapping[str, str] | None = None,
    kind: Literal["rates", "increments"] | None = None,
    topic: str | None = None,
) -> ImuRecord:
    """Read an IMU log into SI units and right-forward-up body axes.

    What the log and the call do not say is found by the names of its columns, and by its numbers: what a clock does, what
    gravity is, how far the gyros turn it. Where that leaves two readings, the reader asks: it raises `UnsureError`, which names
    both. The record's ``taken_for`` holds what was found, and why. A small YAML file next to the log (``LOG.yaml`` for
    ``LOG.csv``) may hold the same options; those of the call win.

    Parameters
    ----------
    path : path
        A file, which may be packed (gzip, zstd, bzip2, lz4), a folder (a ROS 2 bag, one file for each sensor), or a zip archive of
        such a folder.
    format : str, optional
        One of `FORMATS`, or of a plug-in; by suffix and content when left out.
    units : str or mapping, optional
        Of the gyro and accelerometer columns and of time, such as ``"deg/s,g"``, ``"deg/s,g,ms"`` or
        ``{"gyro": "0.05 deg/s", "time": "us"}`` (a number is the size of one count). Documented names mean SI.
    axes : str, optional
        Where the log's x, y and z point, such as ``"FRD"``; RFU when left out (KF-GINS: FRD, ROS: FLU). A left-handed set, such
        as ``"FLD"``, is one too.
    rate : float, optional
        Hz, for a log without time, or whose stamps are worse than its sampling: these give only the start then.
    columns : mapping, optional
        Our names (``time, gyro_x``, ...) to the log's; a minus turns the sign: ``{"gyro_y": "-wy"}``. In ``.npz`` and
        ``.mat`` files, variables: ``gyro`` and ``accel`` (``dtheta`` and ``dvel``) to arrays of three columns, which may be a
        part of a larger one (``"counts[0:3]"``, counted from 0), ``scale`` to what multiplies them, ``interval`` to the
        sampling interval.
    kind : {"rates", "increments"}, optional
        What a row is, where the names of the columns are wrong.
    topic : str, optional
        Of a ROS bag with several IMUs.

    Returns
    -------
    ImuRecord
        Time counts from 1970 where the log's clock holds dates.

    Raises
    ------
    UsageError
        No such file, an unknown format, column, unit or axes.
    DataError
        Bad data: with file, line (or row) and column.
    UnsureError
        Two readings explain the log: it names both, and the option that says which.
    """
    path = as_path(path, "log")
    given = {"units": units, "axes": axes, "rate": rate, "columns": columns, "kind": kind, "topic": topic}
    try:
        if (own := _plugged(path, format)) is not None:
            plugged: ImuRecord = own(path, layout_for(path, given))
            return plugged
        with unpacked(path) as log:
            return _read(log, format, layout_for(path, given))
    except OSError as error:
        raise unreadable(path, error) from None


def _read(path: Path, format: str | None, layout: Layout) -> ImuRecord:
    chosen = format_of(path, format)
    if chosen in devices.DEVICES:
        layout = replace(layout, axes=layout.axes or devices.module_of(chosen).AXES)
        return record_of(devices.columns(path, chosen, "imu", layout.topic), layout)
    if chosen not in READERS:
        return record_of(columns_of(path, chosen), layout)
    module, function = READERS[chosen]
    reader = getattr(import_module(f"truenorth.formats.{module}"), function)
    record: ImuRecord = reader(path, layout)
    return record


def _plugged(path: Path, format: str | None) -> Callable[..., ImuRecord] | None:
    """The reader of a plug-in, where the format or the suffix is not one of ours."""
    name = path.suffix.lstrip(".").lower() if format is None else format
    if name in FORMATS or f".{name}" in SUFFIXES or not name:
        return None
    return plugin("truenorth.formats", name) if name in plugins("truenorth.formats") else None
