"""Tables of callers: the time of a record, however pandas holds it, and what cannot be one."""

import numpy as np
import pandas as pd
import pytest

import truenorth as tn
from tests.helpers import raises_naming

START = 1_709_632_800  # s: 2024-03-05T10:00:00 UTC
SINCE = 0.01 * np.arange(1, 9)
NAMES = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
ROWS = pd.DataFrame(np.arange(48.0).reshape(8, 6), columns=NAMES)
DATES = pd.to_datetime(np.round(1e9 * SINCE).astype(np.int64) + START * 10**9)


@pytest.mark.parametrize("where", ["column", "index", "index without a name"])
@pytest.mark.parametrize(
    ("time", "start"),
    [
        (SINCE, 0),
        (SINCE.astype(str), 0),
        (pd.array(SINCE, dtype="Float64"), 0),
        (pd.to_timedelta(SINCE, unit="s"), 0),
        (pd.to_timedelta(SINCE, unit="s").to_pytimedelta(), 0),
        (pd.to_timedelta(SINCE, unit="s").astype("timedelta64[ms]"), 0),
        (pd.to_timedelta(SINCE, unit="s").astype(str), 0),
        (DATES, START),
        (DATES.astype("datetime64[ms]"), START),
        (DATES.to_pydatetime(), START),
        (DATES.tz_localize("UTC").tz_convert("Europe/Berlin"), START),
        (DATES.strftime("%Y-%m-%dT%H:%M:%S.%f"), START),
        (DATES.strftime("%Y-%m-%d %H:%M:%S.%f+00:00"), START),
    ],
)
def test_seconds_durations_and_dates_are_one_time(time, start, where):
    """Dates are seconds since 1970, as in every reader: a table and the file of another sensor have one clock."""
    table = ROWS.assign(time=time) if where == "column" else ROWS.set_index(pd.Index(time))
    table.index.name = "time" if where == "index" else None
    record = tn.ImuRecord.of(table)
    np.testing.assert_allclose(record.time - start, SINCE, rtol=0, atol=3e-7)
    np.testing.assert_array_equal(np.hstack([record.gyro, record.accel]), ROWS.to_numpy())


@pytest.mark.parametrize("index", [None, np.arange(5, 13)])
def test_a_row_number_is_no_time(index):
    """At 100 Hz a log of 200 s was one of 20,000 s, its base seemed to drift."""
    with raises_naming(tn.UsageError, "without time", "np.arange"):
        tn.ImuRecord.of(ROWS if index is None else ROWS.set_index(index))


def test_what_is_no_time_is_named():
    for time in (
        ["start", *SINCE[1:].astype(str)],
        pd.period_range("2024-03", periods=8),
        [None, *SINCE[1:].astype(str)],
    ):
        with raises_naming(tn.TruenorthError, "time"):
            tn.ImuRecord.of(ROWS.assign(time=time))
    dates = DATES.to_series(index=ROWS.index)
    dates[3] = pd.NaT
    with raises_naming(tn.DataError, "row 4", "time"):
        tn.ImuRecord.of(ROWS.assign(time=dates))


def test_values_that_are_no_numbers_are_named():
    table = ROWS.assign(time=SINCE)
    with raises_naming(tn.UsageError, "gyro_x", "numbers"):
        tn.ImuRecord.of(table.assign(gyro_y="fast"))
    with raises_naming(tn.DataError, "row 3", "accel_x"):
        tn.ImuRecord.of(table.convert_dtypes().assign(accel_x=pd.array([1.0, 2.0, None] + 5 * [3.0], dtype="Float64")))
