"""Readers and writers of IMU logs, one format a file."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from truenorth.errors import DataError, UsageError
from truenorth.formats.table import layout_beside
from truenorth.records import ImuRecord

__all__ = ["FORMATS", "read_imu", "write_imu"]

FORMATS = ("csv", "parquet", "npz", "mat", "psins", "kf-gins", "kf-gins-binary", "ros")
SUFFIXES = {
    ".csv": "csv",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".npz": "npz",
    ".mat": "mat",
    ".imu": "psins",
    ".txt": "kf-gins",
    ".bin": "kf-gins-binary",
    ".bag": "ros",
    ".mcap": "ros",
    ".db3": "ros",
}
# What a file begins with tells what it is, whatever its name.
MAGIC = (
    (b"PAR1", "parquet"),
    (b"PK\x03\x04", "npz"),
    (b"MATLAB", "mat"),
    (b"#ROSBAG", "ros"),
    (b"\x89MCAP", "ros"),
    (b"SQLite format 3", "ros"),
)


def read_imu(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    units: str | None = None,
    axes: str | None = None,
    rate: float | None = None,
    columns: Mapping[str, str] | None = None,
    kind: str | None = None,
    topic: str | None = None,
) -> ImuRecord:
    """Read an IMU log into SI units and right-forward-up body axes.

    A small YAML file beside the log (``LOG.yaml`` for ``LOG.csv``) may hold the same options; those of the call win.

    Parameters
    ----------
    path : path
    format : str, optional
        One of `FORMATS`; told by the suffix when left out.
    units : str, optional
        Of the gyro and accelerometer columns, such as ``"deg/s,g"``.
    axes : str, optional
        Where the log's x, y and z point, such as ``"FRD"``; RFU when left out (KF-GINS: FRD, ROS: FLU).
    rate : float, optional
        Hz, for a log without time.
    columns : mapping, optional
        Our names (``time, gyro_x``, ...) to the log's; of ``.npz`` and ``.mat`` the variables.
    kind : {"rates", "increments"}, optional
        Where the names of the columns do not tell.
    topic : str, optional
        Of a ROS bag with several IMUs.

    Returns
    -------
    ImuRecord

    Raises
    ------
    UsageError
        No such file, an unknown format, unit or axes.
    DataError
        Bad data: with file, line and column.
    """
    path = Path(path)
    if not path.exists():
        raise UsageError(f"{path}: no such file")
    chosen = format or _format_of(path)
    if chosen not in FORMATS:
        raise UsageError(f"format {chosen!r} is not known; choose one of {', '.join(FORMATS)}")
    if path.is_file() and path.stat().st_size == 0:
        raise DataError(f"{path.name}: the file is empty; expected an IMU log")
    _check_content(path, chosen)
    layout = layout_beside(path, {"units": units, "axes": axes, "rate": rate, "columns": columns, "kind": kind})
    if chosen == "csv":
        from truenorth.formats import csv

        return csv.read(path, layout)
    if chosen == "parquet":
        from truenorth.formats import parquet

        return parquet.read(path, layout)
    if chosen in ("npz", "mat"):
        from truenorth.formats import arrays

        return arrays.read_npz(path, layout) if chosen == "npz" else arrays.read_mat(path, layout)
    if chosen == "psins":
        from truenorth.formats import psins

        return psins.read(path, layout)
    if chosen == "ros":
        from truenorth.formats import ros

        return ros.read(path, layout, topic)
    from truenorth.formats import kf_gins

    return kf_gins.read_text(path, layout) if chosen == "kf-gins" else kf_gins.read_binary(path, layout)


def write_imu(record: ImuRecord, path: str | PathLike[str]) -> None:
    """Write a record as CSV, Parquet or npz, by the suffix; whole or not at all.

    Raises
    ------
    UsageError
        Another suffix, or a folder that cannot be written to.
    """
    from truenorth.atomic import atomic_path

    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".csv", ".parquet", ".npz"):
        raise UsageError(f"{path}: cannot write {suffix or 'a file without a suffix'}; use .csv, .parquet or .npz")
    with atomic_path(path) as temporary:
        if suffix == ".csv":
            from truenorth.formats import csv

            csv.write(record, temporary)
        elif suffix == ".parquet":
            from truenorth.formats import parquet

            parquet.write(record, temporary)
        else:
            from truenorth.formats import arrays

            arrays.write_npz(record, temporary)


def _format_of(path: Path) -> str:
    if path.is_dir():
        return "ros"
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise UsageError(
            f"{path.name}: the suffix {suffix or '(none)'} names no format; rename it or give --format, one of "
            f"{', '.join(FORMATS)}"
        )
    return SUFFIXES[suffix]


def _check_content(path: Path, chosen: str) -> None:
    if path.is_dir():
        return
    with path.open("rb") as file:
        head = file.read(16)
    found = next((name for magic, name in MAGIC if head.startswith(magic)), None)
    binary = {"parquet", "npz", "mat", "ros"}
    if found == chosen or (found is None and chosen not in binary):
        return
    what = f"holds {found} data" if found else "does not begin as such a file does"
    advice = f"rename it or give --format {found}" if found else "name its format with --format"
    raise DataError(f"{path.name}: read as {chosen}, but it {what}; {advice}")
