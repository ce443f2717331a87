"""Writers of records, by the suffix of the file."""

from __future__ import annotations

from importlib import import_module
from os import PathLike
from pathlib import Path

from truenorth.core.errors import UsageError
from truenorth.records import ImuRecord, Record

WRITERS = {".csv": "csv_out", ".parquet": "parquet", ".pq": "parquet", ".npz": "npz"}


def write_imu(record: ImuRecord, path: str | PathLike[str]) -> None:
    """Write a record as CSV, Parquet or npz, by the suffix; whole or not at all.

    `read_imu` gives the same bits back, whatever the format.

    Raises
    ------
    UsageError
        Another suffix, or a folder that cannot be written to.
    """
    write_record(record, path)


def write_record(record: Record, path: str | PathLike[str]) -> None:
    """Write a record of any kind as CSV, Parquet or npz, by the suffix; whole or not at all.

    The columns are the documented ones of :meth:`truenorth.records.Record.to_frame`; the reader of the kind gives the same
    record back: to the bit, but for angles, which stand in degrees and come back to rounding.

    Raises
    ------
    UsageError
        Another suffix, or a folder that cannot be written to.
    """
    from truenorth.core.atomic import atomic_path

    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise UsageError(f"{path}: cannot write {suffix or 'a file without a suffix'}; use .csv, .parquet or .npz")
    with atomic_path(path) as temporary:
        import_module(f"truenorth.formats.{WRITERS[suffix]}").write(record, temporary)
