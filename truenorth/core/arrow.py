"""Columns of Arrow from ours, by their memory: Arrow's own conversions import pandas, which takes longer than a log.

And files by any name: Arrow itself takes names in UTF-8 only.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import pyarrow as pa


def arrow_file(path: Path, mode: Literal["rb", "wb"] = "rb") -> pa.OSFile:
    """A file that Arrow, or pandas by it, reads or writes, whatever bytes its name is made of."""
    import pyarrow as pa

    return pa.OSFile(os.fsencode(path), mode)


def numbers(column: ArrayLike, kind: pa.DataType) -> pa.Array:
    """A column of numbers, none of them absent."""
    import pyarrow as pa

    values = np.ascontiguousarray(column, dtype=kind.to_pandas_dtype())
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(values)])


def words(column: Sequence[str]) -> pa.StringArray:
    """A column of words, none of them absent."""
    import pyarrow as pa

    coded = [word.encode(errors="backslashreplace") for word in column]
    ends = np.cumsum([0, *map(len, coded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(coded), pa.py_buffer(ends), pa.py_buffer(b"".join(coded)))
