"""Rows without a value of a sensor, as of phones: left out and counted; single empty cells stay faults."""

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.formats import read_imu

TIME = 0.01 * np.arange(400)
GYRO = 0.1 * np.sin(3.0 * TIME)[:, None] * [0.2, -0.5, 1.0]
UNITS = {"gyro": "rad/s", "accel": "m/s^2", "time": "s"}
NAMES = "time,gyroX,gyroY,gyroZ,accX,accY,accZ,rotationRateX,rotationRateY,rotationRateZ"


def log(tmp_path, empty):
    """A log some cells of which are empty: rows to the columns."""
    rows = []
    for k, (t, w) in enumerate(zip(TIME, GYRO)):
        cells = [f"{value:.9f}" for value in (t, *w, 0.3, -0.2, 9.8)] + [""] * 3
        for column in empty.get(k, ()):
            cells[column] = ""
        rows.append(",".join(cells))
    (tmp_path / "log.csv").write_text("\n".join([NAMES, *rows]) + "\n")
    return tmp_path / "log.csv"


@pytest.mark.parametrize("columns", [(1, 2, 3), (4, 5, 6), (1, 2, 3, 4, 5, 6)])
def test_rows_without_a_sensor_are_left_out_and_counted(tmp_path, columns):
    rows = [3, 50, 51, 399]
    record = read_imu(log(tmp_path, dict.fromkeys(rows, columns)), units=UNITS)
    there = np.delete(np.arange(400), rows)
    np.testing.assert_allclose(record.time, TIME[there], atol=1e-9)
    np.testing.assert_allclose(record.gyro, GYRO[there], atol=1e-9)
    (said,) = [guess.value for guess in record.taken_for if guess.what == "text"]
    assert "rows without a value of each sensor left out: 4, the first is line 5" in said


@pytest.mark.parametrize("empty", [{7: (2,)}, {7: (1, 2, 3), 8: (4,)}, dict.fromkeys(range(1, 400, 4), (1, 2, 3))])
def test_single_cells_and_many_rows_are_faults(tmp_path, empty):
    with pytest.raises(DataError, match=r"line \d, column gyro[XY]: ''; expected a number"):
        read_imu(log(tmp_path, empty), units=UNITS)


def test_columns_without_any_value_are_no_second_set(tmp_path):
    """Their rates were offered as an answer that then ended with an empty cell."""
    record = read_imu(log(tmp_path, {}), units=UNITS)
    np.testing.assert_allclose(record.gyro, GYRO, atol=1e-9)
