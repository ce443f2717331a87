"""Parquet: the documented columns, or others by name; the index `time` of a pandas table is a column like any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import DataError
from truenorth.formats.layout import Layout
from truenorth.formats.table import choose, finish
from truenorth.records import COLUMNS, ImuRecord


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

    def column(name: str) -> NDArray[np.float64]:
        values = table.column(name)
        if not (pa.types.is_floating(values.type) or pa.types.is_integer(values.type)):
            wanted = "seconds, as numbers" if name == choice.time else "numbers"
            raise DataError(f"{path.name}: column {name} holds {values.type}; expected {wanted}")
        return np.asarray(values.to_numpy(), dtype=np.float64)

    time = None if choice.time is None else column(choice.time)
    sensors = np.column_stack([column(name) for name in choice.sensors])
    return finish(time, sensors[:, :3], sensors[:, 3:], choice.kind, layout, path.name, labels=choice.labels)


def write(record: ImuRecord, path: Path) -> None:
    """Write a record with the documented columns."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    values = np.column_stack([record.time, record.gyro, record.accel])
    names = ("time", *COLUMNS[record.kind])
    pq.write_table(pa.table({name: values[:, i] for i, name in enumerate(names)}), path)
