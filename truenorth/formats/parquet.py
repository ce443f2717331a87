"""Parquet and Feather: the documented columns, or others by name; the index `time` of a pandas table is a column like any other.

A folder of numbered parts, as a live run leaves its rows, is one table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.arrow import arrow_file
from truenorth.core.errors import DataError
from truenorth.formats.arrow import table_of, to_numpy
from truenorth.formats.columns import Columns
from truenorth.formats.content import LARGEST
from truenorth.records import Record

Array = NDArray[np.float64]


def columns(path: Path, format: str) -> Columns:
    """The columns of a file, read when they are asked for.

    Raises
    ------
    DataError
        A damaged file; when read, a column that does not hold numbers.
    """
    import pyarrow as pa
    import pyarrow.feather as pf
    import pyarrow.parquet as pq

    @contextmanager
    def opened(path: Path) -> Iterator[Any]:
        """A Parquet file; of a Feather file its columns."""
        try:
            with arrow_file(path) as raw:
                if format == "feather":
                    yield pf.read_table(raw)
                else:
                    with pq.ParquetFile(raw) as file:
                        yield file
        except MemoryError:  # Arrow's own is an ArrowException, too
            raise
        except (pa.ArrowException, OSError) as error:
            what = format.capitalize()
            raise DataError(f"{path.name}: the {what} file is damaged or cut short ({error}); write it anew") from None

    def table(names: Sequence[str]) -> pa.Table:
        wanted = list(dict.fromkeys(names))
        if path.is_dir():
            return pa.concat_tables([columns_of(part, wanted) for part in parts_of(path)])
        return columns_of(path, wanted)

    def columns_of(path: Path, wanted: list[str]) -> pa.Table:
        with opened(path) as file:
            if format == "feather":
                return file.select(wanted)
            if 8 * file.metadata.num_rows * len(wanted) > LARGEST:  # equal values take next to nothing in the file
                raise DataError(
                    f"{path.name}: holds more than {LARGEST >> 30} GiB; expected a log that fits into memory: cut it into parts"
                )
            return file.read(wanted, use_threads=False)

    def names_of(path: Path) -> list[str]:
        with opened(path) as file:  # no table without rows: to make one, pyarrow loads pandas
            return list(file.column_names if format == "feather" else file.schema_arrow.names)

    def read(names: Sequence[str], gaps: bool = False) -> Array:
        found = table(names)
        if not found.num_rows:
            raise DataError(f"{path.name}: columns and no rows; expected numbers in them")
        for name in names:
            kind = found.schema.field(name).type
            if not (pa.types.is_floating(kind) or pa.types.is_integer(kind)):
                wanted = "seconds, as numbers" if pa.types.is_temporal(kind) else "numbers"
                raise DataError(f"{path.name}: column {name} holds {kind}; expected {wanted}")
        return to_numpy([found.column(name).cast(pa.float64(), safe=False) for name in names])

    return Columns(
        path, names_of(parts_of(path)[0] if path.is_dir() else path), read, lambda name: table([name]).column(name)
    )


def parts_of(folder: Path) -> list[Path]:
    """The numbered parts of one table, as a live run writes its rows."""
    return sorted(folder.glob("[0-9]*.parquet"))


def write(record: Record, path: Path) -> None:
    """Write a record with the documented columns."""
    import pyarrow.parquet as pq

    with arrow_file(path, "wb") as file:
        pq.write_table(table_of(record), file)
