"""One pass over a record: against NumPy's sums of the same rows, whatever the length and the rate."""

import numpy as np
import pytest

from truenorth.records import ImuRecord
from truenorth.records.one_pass import BLOCKS, passed, rows_of_cell


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("interval", [0.001, 0.01, 0.3, 1.0])
@pytest.mark.parametrize("count", [2, 9, 10, 11, 57, 1003])
def test_sums_are_those_of_the_rows(count, interval, kind):
    rng = np.random.default_rng(count)
    gyro, accel = 1e-3 * rng.standard_normal((count, 3)), rng.normal((0.0, 0.0, 9.8), 1.0, (count, 3))
    record = ImuRecord(interval * np.arange(1, count + 1), gyro, accel, kind)
    found, rows = passed(record), rows_of_cell(record)
    both, whole = np.hstack([gyro, accel]), count // rows
    cells = both[: whole * rows].reshape(whole, rows, 6).mean(axis=1).T
    np.testing.assert_allclose(found.cells, cells, rtol=1e-12, atol=1e-15)
    starts = np.linspace(0, count, min(BLOCKS, count) + 1).astype(int)[:-1]
    sums = np.add.reduceat(np.column_stack([record.steps, both]), starts, axis=0)
    np.testing.assert_allclose(found.blocks, sums, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.gyro, [gyro.sum(axis=0), (gyro**2).sum(axis=0)], rtol=1e-11, atol=1e-15)
    squares = (accel**2).sum(axis=1)
    np.testing.assert_allclose(found.force, (squares.min(), squares.max()), rtol=1e-15)


def test_rows_behind_each_other_in_memory_stay_apart():
    """A row is read as three numbers: what stands behind the last row of a part of a log is not in its sums."""
    whole = np.full((31, 3), np.nan)
    whole[:30] = 1.0
    record = ImuRecord(0.01 * np.arange(1, 31), whole[:30], whole[:30], "increments")
    found = passed(record)
    assert found.blocks.sum(axis=0).tolist() == pytest.approx([0.3, *[30.0] * 6])
    assert found.force == (3.0, 3.0)
    np.testing.assert_array_equal(found.cells, np.ones((6, 3)))
