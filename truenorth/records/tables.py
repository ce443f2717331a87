"""Times and numbers of a caller's pandas table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError

Array = NDArray[np.float64]


def numbers_of(table: Any, names: Sequence[str]) -> Array:
    """(N, len(names)) values of columns; what is absent is NaN.

    Raises
    ------
    UsageError
        A column that holds no numbers.
    """
    try:
        return np.array(table[list(names)].to_numpy(dtype=np.float64, na_value=np.nan))
    except (TypeError, ValueError):
        raise UsageError(f"record: {', '.join(names)} of the table are not all numbers; convert them") from None


def times_of(table: Any) -> Array:
    """(N,) seconds of the column or index ``time``: since 1970 where it holds dates.

    Raises
    ------
    UsageError
        No time, or something else than seconds, durations and dates.
    """
    import pandas as pd

    named = "time" in table.columns
    time = table["time"] if named else table.index
    kind = getattr(time.dtype, "kind", "O")
    if not named and time.name != "time" and kind in "iu":
        raise UsageError(
            "record: a table without time, its index counts rows; expected a column or an index `time` in s, or of dates: "
            "at 100 Hz table.assign(time=np.arange(len(table)) / 100)"
        )
    if kind == "m":
        return _seconds(pd.to_timedelta(time), "timedelta64[ns]")
    if kind == "M":
        return _seconds(pd.to_datetime(time, utc=True), "datetime64[ns]")
    try:
        return np.array(time, dtype=np.float64)
    except (TypeError, ValueError):
        pass
    try:
        return _seconds(pd.to_datetime(time, format="ISO8601", utc=True), "datetime64[ns]")
    except (TypeError, ValueError):
        pass
    try:
        return _seconds(pd.to_timedelta(time), "timedelta64[ns]")
    except (TypeError, ValueError):
        raise UsageError(
            f"record: time of the table begins with {time[0] if not named else time.iloc[0]!r}; expected seconds, dates "
            "(ISO 8601 where they are text) or durations"
        ) from None


def _seconds(stamps: Any, unit: str) -> Array:
    """Of dates since 1970, or of durations; what is absent is NaN."""
    stamps = stamps.to_numpy(unit)
    return np.where(np.isnat(stamps), np.nan, stamps.astype(np.int64) * 1e-9)
