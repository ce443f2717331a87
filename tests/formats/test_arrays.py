"""Variables of .npz and .mat: parts of arrays, counts with a scale, sampling interval; the real recordings as they are."""

import numpy as np
import pytest
from scipy.io import savemat

from tests import recordings
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu

TIME = np.arange(1, 8) / 100
SENSORS = np.arange(42.0).reshape(7, 6) / 3


@pytest.fixture(params=["npz", "mat"])
def save(request, tmp_path):
    def write(**variables):
        path = tmp_path / f"log.{request.param}"
        if request.param == "npz":
            np.savez(path, **variables)
        else:
            savemat(path, variables)
        return path

    return write


def assert_is(record, kind="rates"):
    assert record.kind == kind
    np.testing.assert_allclose(record.time, TIME, rtol=1e-15)
    np.testing.assert_array_equal(np.hstack([record.gyro, record.accel]), SENSORS)


@pytest.mark.slow
def test_one_variable_for_each_sensor(save):
    assert_is(read_imu(save(time=TIME, gyro=SENSORS[:, :3], accel=SENSORS[:, 3:])))
    assert_is(read_imu(save(time=TIME, dtheta=SENSORS[:, :3], dvel=SENSORS[:, 3:])), "increments")
    assert_is(read_imu(save(time=TIME, gyro=SENSORS[:, :3], accel=SENSORS[:, 3:]), kind="increments"), "increments")


def test_arrays_that_lie_on_their_side(save):
    assert_is(read_imu(save(time=TIME[None], gyro=SENSORS[:, :3].T, accel=SENSORS[:, 3:].T)))


@pytest.mark.slow
def test_one_variable_for_each_column(save):
    names = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    columns = dict(zip(names, SENSORS.T))
    assert_is(read_imu(save(time=TIME, **columns)))
    assert_is(read_imu(save(**columns), rate=100.0))
    assert_is(read_imu(save(ts=0.01, **columns), columns={"interval": "ts"}))


@pytest.mark.slow
def test_parts_of_one_array(save):
    path = save(mimu=np.column_stack([SENSORS, TIME]))
    columns = {"dtheta": "mimu[0:3]", "dvel": "mimu[3:6]", "time": "mimu[6]"}
    assert_is(read_imu(path, columns=columns), "increments")
    turned = read_imu(path, columns=columns | {"dvel_y": "-mimu[4]"})
    np.testing.assert_array_equal(turned.accel, SENSORS[:, 3:] * [1, -1, 1])


@pytest.mark.slow
def test_counts_with_a_scale_and_an_interval(save):
    counts = np.arange(42).reshape(7, 6)
    path = save(counts=counts.astype(np.int16), scale=np.full(6, 1 / 3), ts=10.0)
    columns = {"gyro": "counts[0:3]", "accel": "counts[3:6]", "scale": "scale", "interval": "ts"}
    record = read_imu(path, columns=columns, units={"time": "ms"})
    np.testing.assert_allclose(record.time, TIME, rtol=1e-14)
    np.testing.assert_allclose(np.hstack([record.gyro, record.accel]), SENSORS, rtol=1e-15)
    uneven = save(counts=counts, scale=np.array([1.0, 2, 3, 4, 5, 6]))
    swapped = {"gyro": "counts[3:6]", "accel": "counts[0:3]", "scale": "scale"}
    record = read_imu(uneven, columns=swapped, rate=100)
    np.testing.assert_array_equal(record.gyro, counts[:, 3:] * [4, 5, 6])
    np.testing.assert_array_equal(record.accel, counts[:, :3] * [1, 2, 3])


def test_a_matlab_struct_and_the_array_of_psins(tmp_path, program):
    path = tmp_path / "log.mat"
    imu = np.column_stack([SENSORS, TIME])
    savemat(path, {"imu": imu, "ts": 0.01})
    assert_is(read_imu(path), "increments")
    savemat(path, {"trj": {"imu": imu, "ts": 0.01}})
    columns = {"dtheta": "trj.imu[0:3]", "dvel": "trj.imu[3:6]", "interval": "trj.ts"}
    assert_is(read_imu(path, columns=columns), "increments")


@pytest.mark.parametrize(
    ("variables", "columns", "error", "words"),
    [
        ({"a": TIME}, {}, DataError, ["no columns of an IMU among a"]),
        ({"gyro": SENSORS[:, :3]}, {"time": "t"}, DataError, ["'accel_x' is missing", "found gyro"]),
        ({"gyro": SENSORS[:, :3], "forces": SENSORS[:, :3], "time": TIME}, {}, DataError, ["'accel_x' is missing", "forces[0]"]),
        ({"gyro": SENSORS[:, :3], "accel": SENSORS[:, :3]}, {}, UsageError, ["no time", "rate"]),
        ({"gyro": SENSORS[:, :3], "accel": SENSORS[:5, :3], "time": TIME}, {}, DataError, ["different length", "accel_x 5"]),
        ({"gyro": SENSORS[:, :3], "accel": SENSORS[:, :3], "time": TIME[:5]}, {}, DataError, ["time 5"]),
        ({"gyro": SENSORS, "accel": SENSORS[:, :3], "time": TIME}, {"gyro": "gyro"}, DataError, ["6 columns", "gyro[0:3]"]),
        ({"gyro": np.full((7, 3), "a"), "accel": SENSORS[:, :3], "time": TIME}, {}, DataError, ["'gyro_x' is missing"]),
        ({"c": SENSORS, "time": TIME}, {"gyro": "c[0:3]", "accel": "c[4:7]"}, DataError, ["'c[4:7]'", "no such three"]),
        ({"c": SENSORS, "time": TIME}, {"gyro": "c[:3]", "accel": "c[3:6]"}, UsageError, ["'c[:3]'", "counts[0:3]"]),
        ({"c": SENSORS, "s": TIME, "time": TIME}, {"gyro": "c[0:3]", "accel": "c[3:6]", "scale": "s"}, DataError,
         ["scale 's'", "(7,)"]),
        ({"gyro": np.where(np.arange(21) == 10, np.nan, 0.0).reshape(7, 3), "accel": SENSORS[:, :3], "time": TIME}, {},
         DataError, ["row 4, column gyro_y", "nan"]),
        ({"gyro": SENSORS[:, :3], "accel": SENSORS[:, :3], "time": TIME[::-1].copy()}, {}, DataError,
         ["row 2, column time", "goes back"]),
    ],
)  # fmt: skip
def test_mistakes(save, variables, columns, error, words):
    path = save(**variables)
    with pytest.raises(error) as caught:
        read_imu(path, columns=columns)
    for word in (path.name, *words):
        assert word in str(caught.value)


def test_matlab_of_version_4(tmp_path):
    path = tmp_path / "log.mat"
    time = np.arange(50) * 0.01
    gyro, accel = np.full((50, 3), 1e-4), np.full((50, 3), (0.0, 0.0, 9.8))
    savemat(path, {"time": time, "gyro": gyro, "accel": accel}, format="4")
    record = read_imu(path, units={"gyro": "rad/s"})
    np.testing.assert_array_equal(record.time, time)
    np.testing.assert_array_equal(record.accel, accel)
    whole = path.read_bytes()
    hostile = {"rows": whole[:4] + b"\xff\xff\xff\x7f" + whole[8:], "cut": whole[: len(whole) // 2], "ends": whole[:21]}
    for name, content in hostile.items():
        damaged = tmp_path / f"{name}.mat"
        damaged.write_bytes(content)
        with pytest.raises(DataError, match=rf"{name}\.mat: the MATLAB file is damaged"):
            read_imu(damaged)


def test_pickled_objects_are_never_loaded(tmp_path):
    np.savez(tmp_path / "log.npz", gyro=np.array([{}], dtype=object))
    with pytest.raises(DataError, match="cannot be loaded"):
        read_imu(tmp_path / "log.npz")


COUNTS = {"scale": "scale", "interval": "ts"}
RECORDINGS = [
    ("rlg_vehicle_xian/rlg_0_900s.npz", "rlg_vehicle_xian",
     {"columns": {"dtheta": "counts[0:3]", "dvel": "counts[3:6]", **COUNTS}}),
    ("fog_gps_xian/static_engine_0_68s.npz", "fog_gps_xian", {"columns": {"interval": "ts"}}),
    ("static_adis16405/adis16405_unit1_10000s.npz", "static_adis16405",
     {"columns": {"gyro": "counts[0:3]", "accel": "counts[3:6]", **COUNTS}, "units": "deg/s,g", "axes": "FRD"}),
    ("stim300_cart_chicago/smooth_turn.npz", "stim300_cart_chicago",
     {"columns": {"time": "imu_t", "gyro": "gyro_dps", "accel": "acc_g"}, "units": "deg/s,g"}),
    ("mems_rotation_table/static_and_rotation_0_162s.npz", "mems_rotation_table",
     {"columns": {"gyro": "counts[3:6]", "accel": "counts[0:3]", **COUNTS}, "units": "deg/s,g"}),
]  # fmt: skip
LONG = ("static_adis16405",)  # 10,000 s; its axes are those of logs of the corpus, its counts those of the others


@pytest.mark.parametrize(
    ("file", "name", "options"),
    [pytest.param(*log, marks=[pytest.mark.slow] * (log[1] in LONG), id=log[1]) for log in RECORDINGS],
)
def test_real_recordings_by_options_alone(file, name, options):
    expected = getattr(recordings, name)()[0]
    record = read_imu(recordings.DATA / file, **options)
    assert record.kind == expected.kind
    np.testing.assert_allclose(record.time, expected.time, rtol=1e-13)
    np.testing.assert_allclose(record.gyro, expected.gyro, rtol=1e-13)
    np.testing.assert_allclose(record.accel, expected.accel, rtol=1e-13)


def test_one_array_of_six_columns_is_the_imu_whatever_lies_next_to_it(save):
    """Matrices and quaternions of attitude have rows of constant norm, too, but no six columns of which three show gravity."""
    rng = np.random.default_rng(7)
    half = 0.5 * np.linspace(0.0, 0.3, 500)
    quaternion = np.column_stack([np.cos(half), np.sin(half), 0 * half, 0 * half])
    matrix = np.tile(np.eye(3).ravel(), (500, 1))
    imu = np.hstack([[0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((500, 3)), 0.3 * rng.standard_normal((500, 3))])
    record = read_imu(save(dcm=matrix.T, quat=quaternion.T, u=imu.T), rate=100.0, units={"gyro": "rad/s"})
    np.testing.assert_allclose(record.accel, imu[:, :3], rtol=1e-12)
    np.testing.assert_allclose(record.gyro, imu[:, 3:], rtol=1e-12)


def test_units_behind_names_that_say_nothing_part_no_columns(tmp_path):
    rng = np.random.default_rng(8)
    imu = np.hstack([1e-3 * rng.standard_normal((200, 3)), [0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((200, 3))])
    head = "c1[rad/s],c2[rad/s],c3[rad/s],c4[m/s2],c5[m/s2],c6[m/s2]"
    np.savetxt(tmp_path / "log.csv", imu, delimiter=",", header=head, comments="", fmt="%.9f")
    record = read_imu(tmp_path / "log.csv", rate=100.0, units={"gyro": "rad/s"})
    np.testing.assert_allclose(record.accel, imu[:, 3:], atol=1e-9)


@pytest.mark.parametrize("name", ["fs", "Fs", "sampling_rate"])
def test_a_rate_of_one_value_with_the_arrays(save, name):
    """As BROAD keeps it; a rate that the caller gives goes first."""
    arrays = {"imu_gyr": SENSORS[:, :3], "imu_acc": SENSORS[:, 3:]}
    record = read_imu(save(**arrays, **{name: 50.0}))
    assert record.interval == pytest.approx(0.02)
    assert record.time[0] == pytest.approx(0.02)
    assert read_imu(save(**arrays, **{name: 50.0}), rate=100.0).interval == pytest.approx(0.01)


@pytest.mark.parametrize("names", ["gx gy gz ax ay az", "a b c d e f"], ids=["known", "unknown"])
def test_a_clock_of_another_device_has_other_rows(save, names):
    """The log of an aircraft keeps that of its motor next to its own, with a clock of half a second."""
    time = np.arange(1, 801) / 50
    rng = np.random.default_rng(5)
    rates = 1e-3 * rng.normal(size=(800, 3)) + 0.3 * np.sin(time)[:, None]
    forces = np.array([0.1, 0.2, 9.8]) + 1e-2 * rng.normal(size=(800, 3))
    columns = dict(zip(names.split(), np.hstack([rates, forces]).T))
    path = save(flight_t=time, motor_t=np.arange(20) / 2, rpm=np.arange(20) % 3, **columns)
    record = read_imu(path, axes="RFU", units="rad/s,m/s^2")
    np.testing.assert_allclose(record.time, time, rtol=1e-12)
    np.testing.assert_array_equal(record.accel, forces)
