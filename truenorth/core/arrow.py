"""Columns of Arrow from ours, by their memory: Arrow's own conversions import pandas, which takes longer than a log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import pyarrow as pa


def numbers(column: ArrayLike, kind: pa.DataType) -> pa.Array:
    """A column of numbers, none of them absent."""
    import pyarrow as pa

    values = np.ascontiguousarray(column, dtype=kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(values)])


def words(column: Sequence[str]) -> pa.StringArray:
    """A column of words, none of them absent."""
    import pyarrow as pa

    coded = [word.encode() for word in column]
    ends = np.cumsum([0, *map(len, coded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(coded), pa.py_buffer(ends), pa.py_buffer(b"".join(coded)))
