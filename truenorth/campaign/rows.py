"""The rows of a campaign: one for each quantity of each method on each run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import pyarrow as pa

from truenorth.core.arrow import numbers, words

_WORD = pa.dictionary(pa.int32(), pa.string())
SCHEMA = pa.schema(
    [
        ("case", pa.int32()),
        ("method", _WORD),
        ("run", pa.int32()),
        ("time_s", pa.float64()),
        ("quantity", _WORD),
        ("value", pa.float64()),
        ("sigma", pa.float64()),
        ("unit", _WORD),
        ("status", _WORD),
        ("reason", pa.string()),
    ]
)


class Row(NamedTuple):
    """A quantity of a run.

    Attributes
    ----------
    case, run : int
    method : str
    time_s : float
        Length of the log that was used.
    quantity : str
        ``outcome`` stands once for each method, run and time, with the status and its reason.
    value : float
        An error, estimated minus true; NaN where there is none.
    sigma : float
        What the method says of it.
    unit, status, reason : str
    """

    case: int
    method: str
    run: int
    time_s: float
    quantity: str
    value: float = math.nan
    sigma: float = math.nan
    unit: str = "1"
    status: str = ""
    reason: str = ""


def table_of(rows: Sequence[Row]) -> Any:
    """An Arrow table of rows, as the shards hold it."""
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(SCHEMA)
    arrays = []
    for field, column in zip(SCHEMA, columns, strict=True):
        if pa.types.is_dictionary(field.type):
            arrays.append(_listed(column))
        elif field.type == pa.string():
            arrays.append(words(column))
        else:
            arrays.append(numbers(column, field.type))
    return pa.Table.from_arrays(arrays, schema=SCHEMA)


def _listed(column: Sequence[str]) -> Any:
    """Words by their place in a list of those that differ: as Arrow does it, without its functions, which load in .03 s."""
    places = {word: at for at, word in enumerate(dict.fromkeys(column))}
    at = [places[word] for word in column]
    return pa.DictionaryArray.from_arrays(numbers(at, _WORD.index_type), words(list(places)))
