"""Tables with rows of several sensors below each other, each with the sensor's name in it."""

import re

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.formats import read_gnss, read_imu
from truenorth.formats.magnetometer import read_magnetometer
from truenorth.formats.sensor_kinds import kind_of

G = 9.80665
ROWS = 1000
T = 0.02 * np.arange(ROWS)
LATER = 0.004  # s, of the accelerometers


def rates(t):
    return np.column_stack([0.0 * t, 0.2 * np.cos(0.4 * t), 0.01 + 0.0 * t])


def forces(t):
    roll = 0.5 * np.sin(0.4 * t)
    return G * np.column_stack([-np.sin(roll), 0.0 * t, np.cos(roll)])


def rows_of(*sensors):
    """Rows (time, name, x, y, z) of sensors (name, times, values), in order of time."""
    rows = [(float(t), name, *xyz) for name, times, values in sensors for t, xyz in zip(times, values.tolist())]
    return sorted(rows, key=lambda row: row[0])


GYRO, ACCEL = ("gyroscope", T, rates(T)), ("accelerometer", T + LATER, forces(T + LATER))
FIELD = ("magnetometer", T[::5], np.tile([20.0, 5.0, -40.0], (ROWS // 5, 1)))
FIXES = ("gps", T[::100], np.column_stack([48.0 + 1e-5 * T[::100], 11.0 + 1e-5 * T[::100], 500.0 + T[::100]]))


def write(path, rows, header="epoch_ms,sensor,x,y,z", line="{ms},{name},{x:.9f},{y:.9f},{z:.9f}"):
    text = [line.format(ms=f"{1.7e12 + 1e3 * t:.3f}", s=f"{t:.6f}", ns=round(1e12 + 1e9 * t), name=name, x=x, y=y, z=z)
            for t, name, x, y, z in rows]  # fmt: skip
    path.write_text("\n".join([*([header] if header else []), *text]) + "\n")
    return path


def check(record, gyro=rates, force=forces):
    t = record.time - record.time[0] + T[1]  # the first row of the gyros stands before the first acceleration
    assert len(t) == ROWS - 1
    np.testing.assert_allclose(t, T[1:], atol=1e-5)
    np.testing.assert_allclose(record.gyro, gyro(t), atol=1e-7)
    np.testing.assert_allclose(record.accel, force(t), atol=2e-4)


def said(record):
    return " ".join(map(str, record.taken_for))


def test_names_in_a_column_and_a_clock_of_each_sensor(tmp_path):
    path = write(tmp_path / "log.csv", rows_of(GYRO, ACCEL, FIELD, FIXES))
    record = read_imu(path)
    check(record)
    assert record.time[0] == pytest.approx(1.7e9 + 0.02, abs=1e-3)
    assert "magnetometer (200), gps (10)" in said(record).replace(
        "gps (10), magnetometer (200)", "magnetometer (200), gps (10)"
    )
    gnss = read_gnss(path)
    np.testing.assert_allclose(gnss.time, 1.7e9 + T[::100], atol=1e-3)
    np.testing.assert_allclose(np.degrees(gnss.lat), FIXES[2][:, 0], atol=1e-9)
    np.testing.assert_allclose(np.degrees(gnss.lon), FIXES[2][:, 1], atol=1e-9)
    np.testing.assert_allclose(read_magnetometer(path).field[0], [20e-6, 5e-6, -40e-6])


def test_sensors_below_each_other_in_blocks_and_rows_of_one_time(tmp_path):
    rows = [*rows_of(ACCEL), *rows_of(GYRO)]
    check(read_imu(write(tmp_path / "log.csv", [*rows, rows[-1]])))


def test_numbers_of_android(tmp_path):
    numbers = {"gyroscope": "4", "accelerometer": "1", "magnetometer": "2"}
    rows = [(t, numbers[name], *xyz) for t, name, *xyz in rows_of(GYRO, ACCEL, FIELD)]
    line = "{ns},{name},{x:.9f},{y:.9f},{z:.9f},3"
    path = write(tmp_path / "log.csv", rows, "timestamp_ns,type,x,y,z,accuracy", line)
    check(read_imu(path))
    rows = [(t, name, *((0.0, 0.0, 0.0) if name == "1" else xyz)) for t, name, *xyz in rows]
    with pytest.raises(DataError, match=r"log.csv: .*1 shows 0"):
        read_imu(write(tmp_path / "log.csv", rows, "timestamp_ns,type,x,y,z,accuracy", line))


def test_of_two_clocks_both_readers_take_the_same(tmp_path):
    line = "{ns},{ms},{name},{x:.9f},{y:.9f},{z:.9f}"
    for header in ("timestamp_ns,timestamp_ms,sensor_type,x,y,z", "timestamp,timestamp_ms,sensor_type,x,y,z"):
        path = write(tmp_path / "log.csv", rows_of(GYRO, ACCEL, FIXES), header, line)
        assert read_imu(path).time[0] == pytest.approx(1000.02, abs=1e-6)
        np.testing.assert_allclose(read_gnss(path).time, 1000.0 + T[::100], atol=1e-6)


def test_numbers_of_an_app_of_its_own_are_refused(tmp_path):
    numbers = {"gyroscope": "1", "accelerometer": "0"}
    rows = [(t, numbers[name], *xyz) for t, name, *xyz in rows_of(GYRO, ACCEL)]
    with pytest.raises(DataError, match="column type: rows of sensors 0, 1; expected names"):
        read_imu(write(tmp_path / "log.csv", rows, "timestamp_ns,type,x,y,z", "{ns},{name},{x:.9f},{y:.9f},{z:.9f}"))


def test_lines_of_getsensordata_have_two_clocks(tmp_path):
    clocks, count = "AppTimestamp(s);SensorTimestamp(s)", "Accuracy(integer)"
    head = [
        "% LogFile created by the 'GetSensorData' App",
        f"% Accelerometer data: \t'ACCE;{clocks};Acc_X(m/s^2);Acc_Y(m/s^2);Acc_Z(m/s^2);{count}'",
        f"% Gyroscope data:     \t'GYRO;{clocks};Gyr_X(rad/s);Gyr_Y(rad/s);Gyr_Z(rad/s);{count}'",
        f"% GNSS data: \t'GNSS;{clocks};Lat(deg);Long(deg);Alt(m);Bearing(deg);Acc(m);Speed(m/s);SatInView;SatInUse'",
        "",
    ]
    for remarks in (head, head[:1]):
        lines = list(remarks)
        for k, (t, name, x, y, z) in enumerate(rows_of(GYRO, ACCEL, FIXES)):
            app = t + 0.02 + 0.003 * (k % 3)  # the app gets them late
            if name == "gps":
                lines.append(f"GNSS;{t + 0.02:.3f};{1.7e9 + t:.3f};{x:.7f};{y:.7f};{z:.3f};0;3.2;1.5;12;7")
                lines.append(f"WIFI;{t + 0.03:.3f};{5000 + t:.3f};a net;01:02:03:04:05:06;2412;-60")
            else:
                key = {"gyroscope": "GYRO", "accelerometer": "ACCE"}[name]
                lines.append(f"{key};{app:.3f};{7000.0 + t:.4f};{x:.9f};{y:.9f};{z:.9f};3")
        path = tmp_path / "logfile.txt"
        path.write_text("\n".join(lines) + "\n")
        record = read_imu(path)
        check(record)
        assert record.time[0] == pytest.approx(0.02 + 0.023, abs=2e-3)
    path.write_text("\n".join([*head, *lines[1:]]) + "\n")
    gnss = read_gnss(path)
    np.testing.assert_allclose(gnss.time, T[::100] + 0.02, atol=2e-3)
    np.testing.assert_allclose(np.degrees(gnss.lat), FIXES[2][:, 0], atol=1e-6)


@pytest.mark.parametrize(
    "line",
    [
        "{name},{ms},{x:.9f},{y:.9f},{z:.9f}",
        "{ms}\t{name}\t{x:.9f}\t{y:.9f}\t{z:.9f}",
        "{name},{ms},{ns},{x:.9f},{y:.9f},{z:.9f}",
        "{name} {x:.9f} {y:.9f} {z:.9f} {ms}",
    ],
)
def test_a_prefix_without_a_header(tmp_path, line):
    names = {"gyroscope": "Gyro", "accelerometer": "Acc"}
    rows = [(t, names[name], *xyz) for t, name, *xyz in rows_of(GYRO, ACCEL)]
    check(read_imu(write(tmp_path / "log.txt", rows, "", line)))


def test_units_behind_the_names(tmp_path):
    names = {"gyroscope": "Gyroscope (deg/s)", "accelerometer": "Accelerometer (m/s^2)"}
    record = read_imu(write(tmp_path / "log.csv", [(t, names[name], *xyz) for t, name, *xyz in rows_of(GYRO, ACCEL)]))
    check(record, lambda t: np.radians(rates(t)))


def test_columns_of_each_sensor_next_to_each_other(tmp_path):
    path = tmp_path / "log.csv"
    cells = {"accelerometer": "{},{},{},,,", "gyroscope": ",,,{},{},{}"}
    rows = [f"{name},{t:.6f}," + cells[name].format(*xyz) for t, name, *xyz in rows_of(GYRO, ACCEL)]
    path.write_text("\n".join(["sensor,time,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z", *rows]) + "\n")
    check(read_imu(path))


def test_gravity_and_linear_acceleration_are_no_accelerometers(tmp_path):
    shaken = np.column_stack([0.3 * np.sin(5.0 * T), 0.0 * T, 0.0 * T])
    linear, gravity = ("linear_acceleration", T, shaken), ("gravity", T, forces(T))
    record = read_imu(write(tmp_path / "log.csv", rows_of(GYRO, linear, gravity)))
    np.testing.assert_allclose(record.accel, forces(T) + shaken, atol=1e-6)
    assert "linear_acceleration + gravity" in said(record)
    with pytest.raises(DataError, match="took gravity out"):
        read_imu(write(tmp_path / "log.csv", rows_of(GYRO, linear)))
    with pytest.raises(DataError, match="expected those of an accelerometer"):
        read_imu(write(tmp_path / "log.csv", rows_of(GYRO, gravity)))
    record = read_imu(write(tmp_path / "log.csv", rows_of(GYRO, ACCEL, linear, gravity)))
    check(record)
    assert {"linear_acceleration (1000)", "gravity (1000)"} <= set(re.findall(r"\w+ \(\d+\)", said(record)))


def test_core_motion_points_down_at_rest(tmp_path):
    sensors = ("rotationRate", T, rates(T)), ("userAcceleration", T, 0.0 * rates(T)), ("gravity", T, -forces(T) / G)
    record = read_imu(write(tmp_path / "log.csv", rows_of(*sensors)))
    np.testing.assert_allclose(record.accel, forces(T), atol=1e-6)
    assert "Core Motion" in said(record)


def test_damaged_rows_are_named(tmp_path):
    path = write(tmp_path / "log.csv", rows_of(GYRO, ACCEL))
    whole = path.read_text().splitlines()
    for bad, message in (
        ("1700000000900.0,gyroscope,0.1,0.2x,0.3", r"log.csv: line 52, column y: '0.2x'; expected a number"),
        ("1700000000900.0,gyroscope,0.1", r"log.csv: line 52: 3 columns; expected 5"),
        (
            "1700000000900.0,gyrosc,0.1,0.2,0.3",
            r"log.csv: line 52, column sensor: 'gyrosc'; expected the name of a sensor",
        ),
        ("1700000000900.0", r"log.csv: line 52, column sensor: ''; expected the name of a sensor"),
    ):
        path.write_text("\n".join([*whole[:51], bad, *whole[51:]]) + "\n")
        with pytest.raises(DataError, match=message):
            read_imu(path)
    path.write_text("\n".join([*whole, whole[0], "17000000"]))  # a header again, and a last line that is cut
    check(read_imu(path))


def test_two_sensors_of_a_kind_are_refused(tmp_path):
    rows = rows_of(GYRO, ACCEL, ("gyroscope_2", T, rates(T)))
    with pytest.raises(DataError, match="several sensors of one kind: gyroscope"):
        read_imu(write(tmp_path / "log.csv", rows))
    rows = rows_of(GYRO, ACCEL, ("gyroscope_uncalibrated", T, 2.0 * rates(T)))
    check(read_imu(write(tmp_path / "log.csv", rows)))


def test_a_clock_that_was_set_back_is_refused(tmp_path):
    rows = rows_of(GYRO, ACCEL)
    with pytest.raises(DataError, match="goes back"):
        read_imu(write(tmp_path / "log.csv", [*((t + 60.0, *rest) for t, *rest in rows), *rows]))


def test_names_of_sensors():
    for kind, names in {
        "gyro": "GYRO gyr Gyroscope TYPE_GYROSCOPE android.sensor.gyroscope UncalGyro BMI160_Gyroscope rotationRate",
        "accel": "ACCE acc Accelerometer TYPE_ACCELEROMETER TotalAcceleration LSM6DSO_Accelerometer",
        "linear": "LinearAcceleration userAcceleration TYPE_LINEAR_ACCELERATION LACC",
        "gravity": "gravity GRAV",
        "mag": "MAGN MagneticField mag TYPE_MAGNETIC_FIELD",
        "gnss": "gps GNSS location",
        "other": "WIFI BLE4 AHRS PRES rotation_vector gameRotationVector step_counter",
    }.items():
        assert [kind_of(name) for name in names.split()] == [kind] * len(names.split())
    assert [kind_of(name) for name in ("", "1", "x", "vehicle", "rate", "IMU")] == [None] * 6
