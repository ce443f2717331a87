"""Logs of devices and robots, one file each: a decoder that others keep well turns them into tables of named columns.

A module of this folder has

- `SUFFIXES` and `BEGINNINGS`: how its files are named and begin;
- `EXTRA`: what installs its decoder, ``pip install 'truenorth[EXTRA]'``; empty where none is needed;
- `AXES`: where x, y and z of its IMU point;
- ``tables(path, topic)``: tables by what they hold, ``imu``, ``gnss``, ``velocity``, ``poses``, ``mag``; each maps headings with
  their units, such as ``gyro_x [rad/s]``, to arrays. The clock is one and the same in all of them;
- where something is to be said of what it makes, `NOTES`: by what a table holds;
- where messages need what came before them, `Memory`: a stream hands one over, ``tables(path, topic, memory=...)``.

A new format is a new file here, and a line in `DEVICES`.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType

from truenorth.core.errors import DataError, TruenorthError, UsageError
from truenorth.formats.columns import Columns, columns_of_arrays

DEVICES = ("ubx", "sbf", "novatel", "xsens", "ulog", "dataflash", "mavlink", "ros", "vectornav", "gnsslogger", "kitti")
SUFFIXES = {
    ".ubx": "ubx",
    ".sbf": "sbf",
    ".gps": "novatel",
    ".novatel": "novatel",
    ".xbus": "xsens",
    ".ulg": "ulog",
    ".ulog": "ulog",
    ".tlog": "mavlink",
    ".bag": "ros",
    ".mcap": "ros",
    ".db3": "ros",
}
BEGINNINGS = {
    b"\xb5\x62": "ubx",
    b"$@": "sbf",
    b"\xaa\x44\x12": "novatel",
    b"\xaa\x44\x13": "novatel",
    b"#BEST": "novatel",
    b"#INS": "novatel",
    b"%INS": "novatel",
    b"#RAWIMU": "novatel",
    b"%RAWIMU": "novatel",
    b"\xfa\xff\x36": "xsens",
    b"ULog\x01\x12\x35": "ulog",
    b"\xa3\x95\x80": "dataflash",
    b"FMT,": "dataflash",
    b"#ROSBAG": "ros",
    b"\x89MCAP": "ros",
    b"SQLite format 3": "ros",
    b"$VN": "vectornav",
    b"# \n# Header Description": "gnsslogger",
    b"# \r\n# Header Description": "gnsslogger",
    b"#\n# Header Description": "gnsslogger",
    b"# Header Description": "gnsslogger",
    b"MessageType,utcTimeMillis": "gnsslogger",
    **dict.fromkeys((b"# Raw,", b"# Fix,Provider,", b"Fix,GPS,", b"Fix,gps,"), "gnsslogger"),  # without its remarks
    **dict.fromkeys((b"UncalAccel,", b"UncalGyro,", b"UncalMag,", b"# Uncal"), "gnsslogger"),  # nor other rows
}
FOLDERS = {"ros": ("metadata.yaml",), "kitti": ("timestamps.txt", "data")}  # what a folder of a format holds
WANTED = {
    "imu": "rates and specific forces",
    "gnss": "positions",
    "velocity": "velocities",
    "poses": "attitudes",
    "mag": "magnetic field",
}


def module_of(format: str) -> ModuleType:
    """The module that reads a format."""
    return import_module(f"truenorth.formats.devices.{format}")


def columns(path: Path, format: str, part: str, topic: str | None = None) -> Columns:
    """The columns of one part of a device's log.

    Raises
    ------
    UsageError
        The decoder is not installed, or a topic must be named.
    DataError
        A damaged log, or one without this part: the message lists what it has.
    """
    module = module_of(format)
    try:
        tables = module.tables(path, part, topic)
    except ImportError:
        raise UsageError(
            f"{path.name}: {format} logs need a decoder: pip install 'truenorth[{module.EXTRA}]'"
        ) from None
    except (TruenorthError, FileNotFoundError):
        raise
    except Exception as error:  # decoders let whatever a damaged file provokes through
        raise DataError(f"{path.name}: the {format} log is damaged or not of a known kind ({error})") from error
    table = tables.get(part)
    if not table or not len(next(iter(table.values()))):
        have = ", ".join(WANTED[name] for name, found in tables.items() if found) or "nothing that is read"
        raise DataError(f"{path.name}: no {WANTED[part]} in this {format} log; found {have}")
    said = getattr(module, "NOTES", {}).get(part)
    return replace(columns_of_arrays(path, table), notes=() if said is None else (said,))


def of_folder(path: Path) -> str | None:
    """The format of a folder; None where it holds none of these."""
    return next((name for name, inside in FOLDERS.items() if all((path / each).exists() for each in inside)), None)
