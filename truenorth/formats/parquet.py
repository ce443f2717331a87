"""Parquet: the documented columns, or others by name; the index `time` of a pandas table is a column like any other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.arrow import table_of, to_numpy
from truenorth.formats.layout import Layout
from truenorth.formats.table import choose, finish
from truenorth.records import ImuRecord, Record

Array = NDArray[np.float64]


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a Parquet log; only the columns that are needed.

    Raises
    ------
    DataError
        A damaged file, a missing column, one that does not hold numbers, or an empty cell.
    """
    choice = choose(names_of(path), layout, path.name)
    values = read_columns(path, choice.names)
    time = None if choice.time is None else values[:, 0]
    gyro, accel = values[:, -6:-3], values[:, -3:]
    return finish(time, gyro, accel, choice.kind, layout, path.name, labels=choice.labels)


def names_of(path: Path) -> list[str]:
    """The columns of a file.

    Raises
    ------
    DataError
        A damaged file.
    """
    with _opened(path) as file:
        return list(file.schema_arrow.names)


def read_columns(path: Path, names: Sequence[str]) -> Array:
    """Columns side by side, (N, len(names)); an empty cell is NaN.

    Raises
    ------
    DataError
        A damaged file, or a column that does not hold numbers.
    """
    import pyarrow as pa

    with _opened(path) as file:
        table = file.read(columns=list(names), use_threads=False)
    for name in names:
        kind = table.schema.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
            wanted = "seconds, as numbers" if pa.types.is_temporal(kind) else "numbers"
            raise DataError(f"{path.name}: column {name} holds {kind}; expected {wanted}")
    return to_numpy([table.column(name).cast(pa.float64()) for name in names])


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            yield file
    except (pa.ArrowException, OSError) as error:
        raise DataError(f"{path.name}: the Parquet file is damaged or cut short ({error}); write it anew") from None


def write(record: Record, path: Path) -> None:
    """Write a record with the documented columns."""
    import pyarrow.parquet as pq

    pq.write_table(table_of(record), path)
