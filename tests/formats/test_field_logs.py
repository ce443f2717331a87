"""Logs as devices and data sets of the field write them: each is read right, or asked about, and none is read as another thing.

The layouts are those of the makers; the numbers are simulated.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.formats.corpus.truth import DEG, truth
from truenorth.core.errors import DataError
from truenorth.formats import UnsureError, read_imu

G = 9.80665
MOVED = truth("swaying", "tactical", 100.0, 40.0)


def rows(*parts, form="%.9g", sep=","):
    """Lines of numbers: each part an array of a column or of several, or a list of text."""
    columns = [
        column for part in parts for column in (list(np.atleast_2d(part.T)) if isinstance(part, np.ndarray) else [part])
    ]
    return "\n".join(sep.join(c if isinstance(c, str) else form % c for c in row) for row in zip(*columns)) + "\n"


def is_read(path, moved=MOVED, rel=2e-3, **options):
    """Whether the log is read as the truth; the record."""
    record = read_imu(path, **options)
    np.testing.assert_allclose(np.diff(record.time), np.diff(moved.time), rtol=1e-3, atol=1e-6)
    for have, want in ((record.gyro, moved.gyro), (record.accel, moved.accel)):
        np.testing.assert_allclose(have, want, atol=rel * np.abs(want).max())
    return record


def attitude(moved=MOVED):
    """Something that looks like roll, pitch and yaw, deg, and its quaternion."""
    angles = np.stack([6 * np.sin(moved.time / 1.5), 4 * np.sin(moved.time), 70 + 3 * np.sin(moved.time / 3)], axis=1)
    half = angles * DEG / 2
    parts = np.stack([np.cos(half).prod(axis=1), np.sin(half[:, 0]), np.sin(half[:, 1]), np.sin(half[:, 2])], axis=1)
    return angles, parts / np.linalg.norm(parts, axis=1)[:, None]


# ------------------------------------------------------------------------------------ what is no gyro, what is no force


@pytest.mark.parametrize(
    "names",
    ["roll,pitch,yaw", "mx,my,mz", "angle_x [deg],angle_y [deg],angle_z [deg]", "px,py,pz", "vel_n,vel_e,vel_d"],
)
def test_three_columns_with_names_of_other_things_are_no_gyros(tmp_path, names):
    path = tmp_path / "log.csv"
    path.write_text(f"time,ax,ay,az,{names}\n" + rows(MOVED.time, MOVED.accel, attitude()[0]))
    if names == "px,py,pz":
        with pytest.raises(UnsureError):
            read_imu(path)
        return
    with pytest.raises(DataError, match=r"ax ay az show gravity, and no other three may be gyros.*name the columns"):
        read_imu(path)


def test_attitude_and_field_next_to_an_imu_of_other_names(tmp_path):
    """As a logger of WitMotion's sensors has it; ``deg_per_s`` is a unit."""
    path, (angles, _) = tmp_path / "log.csv", attitude()
    names = [
        f"{of.format(axis)}" for of in ("Accel{}_g", "Gyro{}_deg_per_s", "Angle{}_deg", "Mag{}_uT") for axis in "XYZ"
    ]
    field = np.full_like(angles, 21.0)
    path.write_text(
        ",".join(["Time", *names]) + "\n" + rows(MOVED.time, MOVED.accel / G, MOVED.gyro / DEG, angles, field)
    )
    is_read(path)


def test_a_quaternion_is_neither(tmp_path):
    """Time, four parts of a quaternion, rates, forces, without a header: three parts of it look like gravity in g."""
    path = tmp_path / "log.txt"
    quaternion = attitude()[1]
    path.write_text(rows(MOVED.time, quaternion, MOVED.gyro, MOVED.accel, sep=" "))
    is_read(path)
    path.write_text(rows(MOVED.time, np.full((len(MOVED.time), 3), 4.6), quaternion, sep=" "))
    with pytest.raises(DataError, match="no columns of an IMU"):
        read_imu(path)


def test_places_are_no_forces_in_a_rare_unit(tmp_path):
    """4.9 m from the origin are gravity's increments at 200 Hz in cm/s."""
    path, angles = tmp_path / "log.txt", attitude()[0]
    time = np.arange(len(angles)) / 200.0
    place = np.array([4.46, -1.68, 1.06]) + 0.01 * np.sin(time / 3)[:, None]
    path.write_text(rows(time + 1403638519.0, angles * DEG * 1e-2, place, sep="\t", form="%.12g"))
    with pytest.raises(DataError, match="no columns of an IMU"):
        read_imu(path)


def test_axes_of_columns_without_known_names_are_in_their_names(tmp_path):
    """As the racing loggers write: yaw rate first."""
    path = tmp_path / "log.csv"
    names = "t,X_Bfs,Y_Bfs,Z_Bfs,YawRate,PitchRate,RollRate"
    path.write_text(f"{names}\n" + rows(MOVED.time, MOVED.accel, MOVED.gyro[:, ::-1]))
    is_read(path)


# ------------------------------------------------------------------------------------------------------- rare units


def test_counts_that_are_nearly_mrad_s_are_asked_about(tmp_path):
    """16.4 counts for one deg/s, next to accelerometers in g."""
    path = tmp_path / "log.csv"
    counts = np.round(MOVED.gyro / DEG * 16.4)
    path.write_text(
        "time_ms,acc_x,acc_y,acc_z,gyro_x,gyro_y,gyro_z\n" + rows(1e3 * MOVED.time, MOVED.accel / G, counts)
    )
    with pytest.raises(UnsureError, match="mrad/s, which few logs are in, and counts may by chance") as said:
        read_imu(path)
    assert {"units": {"gyro": "deg/s"}} in said.value.options
    is_read(path, rel=2e-2, units={"gyro": "0.0609756 deg/s"})


# ------------------------------------------------------------------------------------------------------------ clocks


def test_a_clock_of_hours_minutes_and_seconds(tmp_path):
    """As VBOX and NMEA write the time: 101200.00 comes 10 ms after 101159.99."""
    path = tmp_path / "log.csv"
    seconds = 36719.5 + MOVED.time
    face = [f"{int(s // 3600):02d}{int(s % 3600 // 60):02d}{s % 60:05.2f}" for s in seconds]
    assert "101159.99" in face and "101200.00" in face
    path.write_text("time,wx,wy,wz,ax,ay,az\n" + rows(face, MOVED.gyro, MOVED.accel))
    record = is_read(path)
    assert abs(record.time[0] - seconds[0]) < 1e-6
    is_read(path, rate=100.0)


def test_seconds_past_sixty_are_seconds(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,wx,wy,wz,ax,ay,az\n" + rows(101112.0 + MOVED.time, MOVED.gyro, MOVED.accel, form="%.12g"))
    assert is_read(path).time[-1] == pytest.approx(101152.0)


@pytest.mark.parametrize(("count", "rate"), [(1e-6, 60.0), (1e-4, 100.0)], ids=["DOT", "MTi"])
def test_the_fine_time_of_an_xsens(tmp_path, count, rate):
    """``SampleTimeFine`` counts 0.1 ms in an MTi and 1 us in a DOT."""
    moved, path = truth("swaying", "tactical", rate, 40.0), tmp_path / "log.csv"
    above = "sep=,\nDeviceTag:,DOT1\nOutputRate:,60Hz\nSelective Data Recording\n\n"
    names = ["PacketCounter", "SampleTimeFine", *(f"Acc_{x}" for x in "XYZ"), *(f"Gyr_{x}" for x in "XYZ")]
    stamps = [f"{3412345678 + round(t / count)}" for t in moved.time]
    path.write_text(
        above + ",".join(names) + "\n" + rows(np.arange(len(stamps)), stamps, moved.accel, moved.gyro / DEG)
    )
    is_read(path, moved)
