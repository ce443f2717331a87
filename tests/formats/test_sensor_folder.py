"""Folders with one file for each sensor, as phones and simulators write them; columns of phones that hold no gravity."""

import numpy as np
import pytest

from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu

G = 9.80665
ROWS = 3000
TIME = 1.7e9 + 0.01 * np.arange(ROWS)


def tilted(time):
    """Rates and specific forces of a phone that rolls and pitches slowly, in closed form."""
    s = time - TIME[0]
    roll, rate = 0.5 * np.sin(0.4 * s), 0.2 * np.cos(0.4 * s)  # about y, forward
    gyro = np.column_stack([np.zeros_like(s), rate, np.zeros_like(s)])
    accel = G * np.column_stack([-np.sin(roll), np.zeros_like(s), np.cos(roll)])
    return gyro, accel


def write(path, header, *columns):
    path.parent.mkdir(exist_ok=True)
    rows = [
        ",".join(f"{value:.9f}" if isinstance(value, float) else str(value) for value in row) for row in zip(*columns)
    ]
    path.write_text("\n".join([header, *rows]) + "\n")


def phone(path, time, xyz):
    """As Sensor Logger writes: nanoseconds since 1970, and z before y before x."""
    stamps = np.round(time * 1e9).astype(np.int64).tolist()
    write(path, "time,seconds_elapsed,z,y,x", stamps, (time - TIME[0]).tolist(), *xyz[:, ::-1].T.tolist())


def test_of_a_simulator_its_clock_is_a_third_file(tmp_path):
    gyro, accel = tilted(TIME)
    write(tmp_path / "time.csv", "time (sec)", (TIME - TIME[0]).tolist())
    write(tmp_path / "gyro-0.csv", "gyro_x (deg/s),gyro_y (deg/s),gyro_z (deg/s)", *np.degrees(gyro).T.tolist())
    write(tmp_path / "accel-0.csv", "accel_x (m/s^2),accel_y (m/s^2),accel_z (m/s^2)", *accel.T.tolist())
    write(
        tmp_path / "ref_pos.csv", "ref_pos_lat (deg),ref_pos_lon (deg),ref_pos_alt (m)", *np.zeros((3, ROWS)).tolist()
    )
    record = read_imu(tmp_path)
    np.testing.assert_allclose(record.time, TIME - TIME[0], atol=1e-6)
    np.testing.assert_allclose(record.gyro, gyro, atol=1e-9)
    np.testing.assert_allclose(record.accel, accel, atol=1e-8)


def test_whole_seconds_with_milliseconds_next_to_them(tmp_path):
    """The stamps repeat within each second; the other clock, since the start, increases in each row."""
    gyro, accel = tilted(TIME)
    second = [f"2019-06-12 22:{22 + k // 6000}:{k // 100 % 60:02d}" for k in range(ROWS)]
    milliseconds = list(range(0, 10 * ROWS, 10))
    for name, values in (("Gyroscope", gyro), ("Accelerometer", accel)):
        write(tmp_path / f"{name}.csv", "Timestamp,Milliseconds,X,Y,Z", second, milliseconds, *values.T.tolist())
    record = read_imu(tmp_path, units="rad/s,m/s^2")
    np.testing.assert_allclose(record.time, TIME - TIME[0], atol=1e-6)
    np.testing.assert_allclose(record.gyro, gyro, atol=1e-8)


def test_of_a_phone_gravity_is_added_where_it_was_taken_out(tmp_path):
    (gyro, _), later = tilted(TIME), TIME + 0.004
    _, accel = tilted(later)
    gravity = accel * 1.0
    shaken = accel + np.column_stack([0.3 * np.sin(5.0 * (later - TIME[0]))] + [np.zeros(ROWS)] * 2)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / "Accelerometer.csv", later, shaken - gravity)
    phone(tmp_path / "Gravity.csv", later, gravity)
    record = read_imu(tmp_path)
    _, wanted = tilted(record.time)
    wanted[:, 0] += 0.3 * np.sin(5.0 * (record.time - TIME[0]))
    assert record.time[0] == pytest.approx(TIME[1], abs=1e-6)  # the first gyro row stands before the first acceleration
    np.testing.assert_allclose(record.gyro, tilted(record.time)[0], atol=1e-6)
    np.testing.assert_allclose(record.accel, wanted, atol=2e-4)  # of linear interpolation: (h^2/8) 25 x .3


def test_of_two_files_the_one_with_gravity_is_taken(tmp_path):
    gyro, accel = tilted(TIME)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / "GyroscopeUncalibrated.csv", TIME, gyro + 0.01)
    phone(tmp_path / "Accelerometer.csv", TIME, 0.01 * accel)
    phone(tmp_path / "TotalAcceleration.csv", TIME, accel)
    record = read_imu(tmp_path)
    np.testing.assert_allclose(record.accel, accel, atol=1e-5)
    np.testing.assert_allclose(record.gyro, gyro, atol=1e-6)


def test_a_phone_that_took_gravity_out_is_refused_with_the_remedy(tmp_path):
    gyro, accel = tilted(TIME)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / "Accelerometer.csv", TIME, 0.01 * accel)
    with pytest.raises(DataError, match=r"Accelerometer.csv shows 0.0981 .*gravity in a file of its own"):
        read_imu(tmp_path)


@pytest.mark.parametrize(
    ("name", "time", "message"),
    [("Accelerometer.csv", TIME + 1e3, "no time in common"), ("other.csv", TIME, "a folder; expected")],
)
def test_files_that_make_no_log(tmp_path, name, time, message):
    gyro, accel = tilted(TIME)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / name, time, accel)
    with pytest.raises((DataError, UsageError), match=message):
        read_imu(tmp_path)


def test_one_file_of_such_a_folder_names_the_folder(tmp_path):
    gyro, accel = tilted(TIME)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / "Accelerometer.csv", TIME, accel)
    with pytest.raises(DataError, match=r"gyros are in Gyroscope.csv .* read their folder"):
        read_imu(tmp_path / "Gyroscope.csv")


def android(path, names, *blocks):
    stamps = np.round(TIME * 1e3).astype(np.int64)[::20].tolist()
    header = ",".join(["timestamp", *(f"{name}.{axis}" for name in names for axis in "xyz")])
    write(path, header, stamps, *(column for block in blocks for column in block[::20].T.tolist()))


def test_sensors_that_are_named_with_their_chip(tmp_path):
    gyro, accel = tilted(TIME)
    names = (
        "accelerometer_lsm6ds3_c",
        "gyroscope_lsm6ds3_c",
        "gravity",
        "linear_Acceleration",
        "uncalibrated_Gyroscope",
    )
    android(tmp_path / "a.csv", names, accel, gyro, accel, 0.2 * accel, gyro + 0.01)
    record = read_imu(tmp_path / "a.csv", units={"gyro": "rad/s"})
    np.testing.assert_allclose(record.accel, accel[::20], atol=1e-6)
    np.testing.assert_allclose(record.gyro, gyro[::20], atol=1e-6)


def test_an_acceleration_without_gravity_is_no_increment(tmp_path):
    """.18 g at 5 Hz is gravity by the row, within a tenth: the name says that a row is no increment."""
    gyro, accel = tilted(TIME)
    android(tmp_path / "a.csv", ("linear_Acceleration", "gyroscope"), 0.18 * accel, gyro)
    with pytest.raises(DataError, match="gravity in no usual unit"):
        read_imu(tmp_path / "a.csv", units={"gyro": "rad/s"})
    android(tmp_path / "b.csv", ("acc", "gyroscope"), 0.2 * accel, 0.2 * gyro)  # a name that tells nothing: increments
    assert read_imu(tmp_path / "b.csv", units={"gyro": "rad"}).kind == "increments"


@pytest.mark.parametrize(
    ("platform", "standardised", "sign"),
    [("ios", "false", -1.0), ("ios", "", -1.0), ("ios", "true", 1.0), ("android", "false", 1.0)],
)
def test_an_iphone_has_the_other_signs_where_its_app_says_so(platform, standardised, sign, tmp_path):
    gyro, accel = tilted(TIME)
    phone(tmp_path / "Gyroscope.csv", TIME, gyro)
    phone(tmp_path / "TotalAcceleration.csv", TIME, sign * accel)
    (tmp_path / "Metadata.csv").write_text(
        f"version,device name,platform,standardisation\n3,mine,{platform},{standardised}\n"
    )
    record = read_imu(tmp_path)
    np.testing.assert_allclose(record.accel, accel, atol=1e-8)
    assert ("signs of TotalAcceleration.csv turned" in str(record.taken_for)) == (sign < 0.0)
