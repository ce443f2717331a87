"""Arrow's columns and ours, by their memory: Arrow's own conversions import pandas, which takes longer than a log."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.arrow import numbers
from truenorth.records import Record

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]


def to_numpy(columns: list[pa.ChunkedArray]) -> Array:
    """Columns of float64 side by side, (N, len(columns)); what is absent is NaN."""
    values = np.empty((len(columns[0]), len(columns)))
    for i, column in enumerate(columns):
        start = 0
        for chunk in column.chunks:
            stop = start + len(chunk)
            buffer = np.frombuffer(chunk.buffers()[1], dtype=np.float64)
            values[start:stop, i] = buffer[chunk.offset : chunk.offset + len(chunk)]
            if chunk.null_count:
                values[start:stop, i][[not valid for valid in chunk.is_valid().to_pylist()]] = np.nan
            start = stop
    return values


def table_of(record: Record) -> pa.Table:
    """A record with the documented columns."""
    return table_from({"time": record.time, **record.columns()})


def table_from(columns: Mapping[str, Array], index: str | None = None) -> pa.Table:
    """Columns (N,) as a table; the column named `index` is the index where pandas reads it."""
    import pyarrow as pa

    arrays = [numbers(column, pa.float64()) for column in columns.values()]
    table = pa.Table.from_arrays(arrays, names=list(columns))
    if index is None:
        return table
    kinds = {"pandas_type": "float64", "numpy_type": "float64", "metadata": None}
    described = [{"name": name, "field_name": name, **kinds} for name in columns]
    pandas = {"index_columns": [index], "column_indexes": [], "columns": described}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})
