"""Days of NMEA sentences: RMC and ZDA hold dates, GGA the time of day alone.

Sentences that show one time are of one day. What has no date stands on the day of the dated one before it (of the first one where
none is), and midnight passes where the time goes back by half a day. Dates count from 1970 in UTC, as the receiver stamps them:
without leap seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

Array = NDArray[np.float64]

DAY = 86400.0
FIRST_YEAR = 80  # of two digits: 1980 to 2079
AROUND = 9  # dates, whose middle shows that one came early or late at midnight
EPOCH = date(1970, 1, 1).toordinal()


def midnight_of(kind: str, cells: Sequence[str], where: str) -> float:
    """Seconds since 1970 of the day that RMC or ZDA names; NaN where the cell is empty.

    Raises
    ------
    DataError
        What is no date.
    """
    if kind == "ZDA":
        written, parts = "/".join(cells[2:5]), cells[2:5]
    else:
        written = cells[9].zfill(6) if len(cells) > 9 and cells[9] else ""
        parts = [written[:2], written[2:4], written[4:]]
    if not written.strip("0/"):
        return math.nan
    try:
        day, month, year = map(int, parts)
        if kind == "RMC":
            year += 1900 if year >= FIRST_YEAR else 2000
        return DAY * (date(year, month, day).toordinal() - EPOCH)
    except ValueError:
        wanted = "ddmmyy" if kind == "RMC" else "day, month and year"
        raise DataError(f"{where}: date {written!r}; expected {wanted}") from None


def midnights(clock: Array, dates: Array) -> Array:
    """The midnight, s, before each of some sentences: since 1970 where any has a date, else the first one is zero.

    Parameters
    ----------
    clock, dates : (N,) arrays
        Seconds of the day, and the day's midnight, NaN without a date.
    """
    steps = np.diff(clock)
    days = DAY * np.concatenate([[0.0], np.cumsum(1.0 * (steps < -DAY / 2) - (steps > DAY / 2))])
    known = np.flatnonzero(np.isfinite(dates))
    if not known.size:
        return days
    runs = np.concatenate([[0], np.cumsum(steps != 0.0)])
    origins = dates[known] - days[known]
    if np.any(origins != origins[0]):
        around = np.lib.stride_tricks.sliding_window_view(np.pad(origins, AROUND // 2, mode="edge"), AROUND)
        middle = np.median(around, axis=1)
        origins = np.where(np.abs(origins - middle) == DAY, middle, origins)
        fallen = np.maximum.accumulate(origins) - origins == DAY
        origins = origins + DAY * fallen  # a date that stands still over midnight: the clock goes on
    own = np.searchsorted(runs[known], runs)  # the first dated sentence of the same time, or a later one
    before = np.maximum(np.searchsorted(known, np.arange(len(clock)), side="right") - 1, 0)
    of_run = (own < len(known)) & (runs[known[np.minimum(own, len(known) - 1)]] == runs)
    return np.asarray(days + origins[np.where(of_run, own, before)])
