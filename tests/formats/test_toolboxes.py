"""Arrays and binary rows that MATLAB toolboxes write: PSINS and NaveGo, read without options."""

import struct

import numpy as np
import pytest
from scipy.io import savemat

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import DataError
from truenorth.formats import read_gnss, read_height, read_imu, read_master

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


def records_of(**fields):
    """A struct array with a record in each element, as MATLAB keeps it: ``imu(k).accelX``."""
    array = np.zeros((len(TIME), 1), dtype=[(name, object) for name in fields])
    for name, values in fields.items():
        for k, value in enumerate(values):
            array[k, 0][name] = value
    return array


@pytest.mark.parametrize("vectors", [False, True])
def test_a_struct_array_with_a_record_in_each_element(tmp_path, vectors):
    """It was a file without any column."""
    rates, forces = RNG.normal(0.0, 1.0, (300, 3)), RNG.normal([0.0, 0.0, 9.81], 0.1, (300, 3))
    whole = {"gyro": rates, "acc": forces}
    apart = {f"{name}{axis}": values[:, k] for name, values in whole.items() for k, axis in enumerate("XYZ")}
    array = records_of(Time=TIME, note=["moved"] * 300, **(whole if vectors else apart))
    savemat(tmp_path / "log.mat", {"imu_data": array})
    record = read_imu(tmp_path / "log.mat", units="rad/s,m/s^2")
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_array_equal(record.gyro, rates)
    np.testing.assert_array_equal(record.accel, forces)


def test_struct_arrays_of_devices_and_of_gaps(tmp_path):
    """Arrays in each element are logs of their own; an empty field among numbers is no number."""
    logs = np.zeros(2, dtype=[("t", object), ("gyro", object), ("acc", object)])
    for k in range(2):
        logs[k] = (TIME + k, np.full((300, 3), 0.01 + k), np.tile([0.0, 0.0, 9.81], (300, 1)))
    heights = records_of(
        t=TIME, alt=[np.zeros((0, 0)) if k == 3 else 5.0 for k in range(300)], raw=[np.zeros(k) for k in range(300)]
    )
    cells = np.empty(2, dtype=object)
    cells[:] = [{"a": 1.0}, np.zeros(3)]
    savemat(tmp_path / "log.mat", {"dev": logs, "baro": heights, "odd": cells})
    named = {"time": "dev(2).t", "gyro": "dev(2).gyro", "accel": "dev(2).acc"}
    record = read_imu(tmp_path / "log.mat", columns=named, units="rad/s,m/s^2")
    np.testing.assert_array_equal(record.time, TIME + 1.0)
    np.testing.assert_array_equal(record.gyro, 1.01)
    with pytest.raises(DataError, match=r"log.mat: row 4, column baro.alt: nan"):
        read_height(tmp_path / "log.mat", columns="time=baro.t,alt=baro.alt")


def test_a_file_of_matlab_without_numbers_says_what_it_has(tmp_path):
    savemat(tmp_path / "log.mat", {"notes": "moved", "names": np.array(["a", "b"], dtype=object)})
    with pytest.raises(DataError, match=r"log.mat: no arrays of numbers.*notes \(char\), names \(cell\).*save"):
        read_imu(tmp_path / "log.mat")


def with_an_object(path):
    """Add an object to a MATLAB file, as a port is saved: its shape is not written."""

    def element(kind, data):
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    flags, number = element(6, struct.pack("<II", 17, 0)), element(6, struct.pack("<II", 13, 0))
    names = b"".join(element(1, name) for name in (b"port", b"MCOS", b"serial"))
    inner = number + element(5, struct.pack("<ii", 1, 1)) + element(1, b"") + element(6, struct.pack("<I", 7))
    path.write_bytes(path.read_bytes() + element(14, flags + names + element(14, inner)))


def test_an_object_among_the_arrays_is_left_out(tmp_path):
    """The whole file was said to be damaged, or to hold an object."""
    time = 0.01 * np.arange(300)
    arrays = {"time": time, "gyro": np.full((300, 3), 0.1), "accel": np.tile([0.0, 0.0, 9.8], (300, 1))}
    savemat(tmp_path / "log.mat", arrays)
    with_an_object(tmp_path / "log.mat")
    np.testing.assert_array_equal(read_imu(tmp_path / "log.mat", columns={"gyro": "gyro", "accel": "accel"}).time, time)
    savemat(tmp_path / "none.mat", {"notes": "text"})
    with_an_object(tmp_path / "none.mat")
    with pytest.raises(DataError, match=r"none\.mat: no arrays of numbers.*object"):
        read_imu(tmp_path / "none.mat")
