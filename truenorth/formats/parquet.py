"""Parquet: the documented columns, or others by name; the index `time` of a pandas table is a column like any other."""

from __future__ import annotations

from pathlib import Path

from truenorth.errors import DataError
from truenorth.formats.arrow import table_of, to_numpy
from truenorth.formats.layout import Layout
from truenorth.formats.table import choose, finish
from truenorth.records import ImuRecord


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a Parquet log; only the columns that are needed.

    Raises
    ------
    DataError
        A damaged file, a missing column, one that does not hold numbers, or an empty cell.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            choice = choose(file.schema_arrow.names, layout, path.name)
            table = file.read(columns=choice.names, use_threads=False)
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"{path.name}: the Parquet file is damaged or cut short ({error}); write it anew") from None

    for name in choice.names:
        kind = table.schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            wanted = "seconds, as numbers" if name == choice.time else "numbers"
            raise DataError(f"{path.name}: column {name} holds {kind}; expected {wanted}")
    values = to_numpy([table.column(name).cast(pa.float64()) for name in choice.names])
    time = None if choice.time is None else values[:, 0]
    gyro, accel = values[:, -6:-3], values[:, -3:]
    return finish(time, gyro, accel, choice.kind, layout, path.name, labels=choice.labels)


def write(record: ImuRecord, path: Path) -> None:
    """Write a record with the documented columns."""
    import pyarrow.parquet as pq

    pq.write_table(table_of(record), path)
