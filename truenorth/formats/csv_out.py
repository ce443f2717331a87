"""Records as CSV."""

from __future__ import annotations

from pathlib import Path

from truenorth.formats.arrow import table_of
from truenorth.records import Record


def write(record: Record, path: Path) -> None:
    """Write a record as CSV with the documented columns; every number reads back to the same bits."""
    import pyarrow.csv as pc

    table = table_of(record)
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        pc.write_csv(table, file, pc.WriteOptions(include_header=False))
