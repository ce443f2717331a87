"""Dates of a log, in whatever order of day and month: ``11/03/2021`` is read by what the log itself shows.

A number above 12 is a day. Where midnight passes, the number that goes up by one is the day. Else nobody knows, the month is taken
to stand first, and what is returned says so. A year of two digits is one of this century.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

YEAR_LAST = r"^(\d{1,2})([-/.])(\d{1,2})\2(\d{4}|\d{2})(?=\D|$)"
UNDERSCORED = r"^(\d{4})_(\d\d)_(\d\d)_(\d\d)_(\d\d)_(\d\d(?:\.\d+)?)$"  # ``2026_06_15_18_59_10.238``
MONTHS = 12
UNKNOWN = "dates, the month first: no number of theirs shows that it is not the day; write ISO dates to be sure"


def is_date(cell: str) -> bool:
    """Whether a cell of text looks like a date."""
    begins = re.match(r"\s*\d{1,2}\.\d{1,2}\.\d{4} ", cell) is not None
    return "-" in cell or "/" in cell or begins or re.match(UNDERSCORED, cell.strip()) is not None


def dates_of(cells: pd.Series) -> tuple[Array, str]:
    """Seconds since 1970 of dates in text, and what they are, in words.

    Parameters
    ----------
    cells : Series of str
        Without blanks around them.

    Raises
    ------
    ValueError
        A cell that is no date, or of another form than the others.
    """
    cells = cells.str.replace(UNDERSCORED, r"\1-\2-\3T\4:\5:\6", regex=True)
    parts = cells.str.extract(YEAR_LAST)
    if parts[0].isna().any() or not re.match(YEAR_LAST, cells.iloc[0]):
        return _seconds(cells), "dates"
    first, second = parts[0].astype(np.int64).to_numpy(), parts[2].astype(np.int64).to_numpy()
    day_first, what = _order(first, second, parts[1].iloc[0])
    day, month = (0, 2) if day_first else (2, 0)
    rest = cells.str.replace(YEAR_LAST, "", regex=True)
    year = parts[3].where(parts[3].str.len() == 4, "20" + parts[3])
    iso = year + "-" + parts[month].str.zfill(2) + "-" + parts[day].str.zfill(2) + rest
    return _seconds(iso), what


def _order(first: NDArray[Any], second: NDArray[Any], mark: str) -> tuple[bool, str]:
    """Whether the day stands first in dates of two such numbers, and what to say of them."""
    if first.max() > MONTHS and second.max() > MONTHS:
        raise ValueError("both numbers before the year are more than 12 somewhere")
    if first.max() > MONTHS:
        return True, "dates, the day first"
    if second.max() > MONTHS:
        return False, "dates, the month first"
    moved = {"first": np.any(np.diff(first) == 1), "second": np.any(np.diff(second) == 1)}
    if moved["first"] != moved["second"]:
        return bool(moved["first"]), f"dates, the {'day' if moved['first'] else 'month'} first: it changes at midnight"
    return (True, "dates, the day first") if mark == "." else (False, UNKNOWN)


def _seconds(cells: pd.Series) -> Array:
    import pandas as pd

    try:
        stamps = pd.to_datetime(cells, format="ISO8601", utc=True)
    except ValueError:
        stamps = pd.to_datetime(cells, format="mixed", utc=True)
    return np.asarray(stamps.to_numpy("datetime64[ns]").astype(np.int64) * 1e-9, dtype=np.float64)
