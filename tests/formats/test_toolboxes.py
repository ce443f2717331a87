"""Arrays and binary rows that MATLAB toolboxes write: PSINS and NaveGo, read without options."""

import numpy as np
import pytest
from scipy.io import savemat

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import DataError
from truenorth.formats import read_gnss, read_imu, read_master

TIME = np.arange(1, 301) / 100
RNG = np.random.default_rng(4)
INCREMENTS = np.column_stack([RNG.normal(0.0, 1e-6, (300, 3)), RNG.normal([0.0, 0.0, 0.0981], 1e-4, (300, 3))])
FIXES = np.column_stack(
    [RNG.normal(0.0, 1.0, (300, 3)), 0.6 + 1e-6 * TIME, 1.9 - 1e-6 * TIME, np.full(300, 380.0), TIME]
)


@pytest.mark.parametrize("width", ["<f8", "<f4"])
def test_binary_rows_of_psins_have_time_last(tmp_path, width):
    rows = np.column_stack([INCREMENTS, TIME]).astype(width)
    rows.tofile(tmp_path / "imu.bin")
    record = read_imu(tmp_path / "imu.bin")
    assert record.kind == "increments"
    np.testing.assert_allclose(record.time, TIME, rtol=0, atol=1e-12 if width == "<f8" else 1e-6)
    np.testing.assert_array_equal(np.hstack([record.gyro, record.accel]), rows[:, :6].astype(float))


def test_a_clock_of_four_bytes_late_in_a_day_is_evenly_spaced(tmp_path):
    late = 80000.0 + TIME  # where a number of four bytes has steps of 8 ms
    np.column_stack([INCREMENTS, late])[::2].astype("<f4").tofile(tmp_path / "imu.bin")
    record = read_imu(tmp_path / "imu.bin")
    np.testing.assert_allclose(np.diff(record.time), 0.02, rtol=0.01)


def test_binary_rows_of_kf_gins_have_time_first(tmp_path):
    np.column_stack([TIME, INCREMENTS]).tofile(tmp_path / "imu.bin")
    record = read_imu(tmp_path / "imu.bin")
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_array_equal(record.accel[:, 2], -INCREMENTS[:, 5])  # forward, right, down


@pytest.mark.parametrize(
    ("column", "value", "words"), [(6, 0.5, "row 101.*column t"), (3, np.nan, "row 101.*column ax")]
)
def test_a_damaged_row_of_psins_is_named(tmp_path, column, value, words):
    rows = np.column_stack([INCREMENTS, TIME])
    rows[100, column] = value
    rows.tofile(tmp_path / "imu.bin")
    with pytest.raises(DataError, match=words):
        read_imu(tmp_path / "imu.bin")


@pytest.mark.parametrize("within", [False, True])
def test_fixes_of_psins(tmp_path, within):
    savemat(tmp_path / "gps.mat", {"trj": {"gps": FIXES, "ts": 1.0}} if within else {"gps": FIXES})
    found = read_gnss(tmp_path / "gps.mat")
    np.testing.assert_array_equal(found.v_n, FIXES[:, :3])
    np.testing.assert_array_equal(np.column_stack([found.lat, found.lon, found.alt, found.time]), FIXES[:, 3:])


def test_attitude_velocity_and_place_of_psins_are_a_master(tmp_path):
    angles = np.column_stack([0.01 * TIME, -0.02 * TIME, 0.3 * TIME])  # pitch, roll, yaw counterclockwise
    savemat(tmp_path / "avp.mat", {"avp": np.column_stack([angles, FIXES])})
    master = read_master(tmp_path / "avp.mat")
    np.testing.assert_allclose(master.C_nb, dcm_from_euler(-angles[:, 2], angles[:, 0], angles[:, 1]), atol=1e-15)
    np.testing.assert_array_equal(master.v_n, FIXES[:, :3])


def test_structs_of_navego(tmp_path):
    rates, forces = RNG.normal(0.0, 0.01, (300, 3)), RNG.normal([0.0, 0.0, -9.8], 0.01, (300, 3))
    imu = {"t": TIME, "wb": rates, "fb": forces, "arw": np.ones(3), "gb_sta": np.ones(3), "freq": 100.0}
    gnss = {"t": TIME, "lat": FIXES[:, 3], "lon": FIXES[:, 4], "h": FIXES[:, 5], "vel": FIXES[:, :3]}
    gnss |= {"stdm": [1.0, 2.0, 3.0], "stdv": [0.1, 0.2, 0.3], "larm": np.zeros(3), "freq": 5.0}
    savemat(tmp_path / "imu.mat", {"imu1": imu})
    savemat(tmp_path / "gnss.mat", {"gnss": gnss})
    record, found = read_imu(tmp_path / "imu.mat"), read_gnss(tmp_path / "gnss.mat")
    np.testing.assert_array_equal(record.gyro, rates[:, [1, 0, 2]] * [1, 1, -1])
    np.testing.assert_array_equal(record.accel, forces[:, [1, 0, 2]] * [1, 1, -1])
    assert "NaveGo" in record.taken_for[0].value
    np.testing.assert_array_equal(found.v_n, FIXES[:, [1, 0, 2]] * [1, 1, -1])  # north, east, down
    np.testing.assert_array_equal(np.column_stack([found.lat, found.lon, found.alt]), FIXES[:, 3:6])
    np.testing.assert_array_equal(
        found.position_sigma[[0, -1]], [[2.0, 1.0, 3.0]] * 2
    )  # those are of north, east, down
    np.testing.assert_array_equal(found.velocity_sigma[[0, -1]], [[0.2, 0.1, 0.3]] * 2)


def test_a_struct_without_a_specification_is_no_toolboxs(tmp_path):
    """Names that others use too say nothing of axes."""
    rates, forces = RNG.normal(0.0, 0.01, (300, 3)), RNG.normal([0.0, 0.0, 9.8], 0.01, (300, 3))
    savemat(tmp_path / "imu.mat", {"mine": {"t": TIME, "wb": rates, "fb": forces}})
    record = read_imu(tmp_path / "imu.mat", units="rad/s,m/s^2")
    assert not any("NaveGo" in guess.value for guess in record.taken_for)
    np.testing.assert_array_equal(record.accel, forces)
