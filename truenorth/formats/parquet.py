"""Parquet: the documented columns, or others by name; an index column `time` of pandas is a column like any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from truenorth.errors import DataError
from truenorth.formats.table import Layout, record_from_columns
from truenorth.records import COLUMNS, ImuRecord


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a Parquet log.

    Raises
    ------
    DataError
        A damaged file, a missing column, one that does not hold numbers, or an empty cell.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise DataError(f"{path.name}: the Parquet file is damaged or cut short ({error}); write it anew") from None

    def column(name: str) -> np.ndarray:
        values = table.column(name)
        if not (pa.types.is_floating(values.type) or pa.types.is_integer(values.type)):
            raise DataError(f"{path.name}: column {name} holds {values.type}; expected numbers")
        return np.asarray(values.to_numpy(), dtype=np.float64)

    return record_from_columns(table.column_names, column, layout, path.name)


def write(record: ImuRecord, path: Path) -> None:
    """Write a record with the documented columns."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    values = np.column_stack([record.time, record.gyro, record.accel])
    names = ("time", *COLUMNS[record.kind])
    pq.write_table(pa.table({name: values[:, i] for i, name in enumerate(names)}), path)
