"""Logs as devices and data sets of the field write them: each is read right, or asked about, and none is read as another thing.

The layouts are those of the makers; the numbers are simulated.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.formats.corpus.truth import DEG, truth
from truenorth.core.errors import DataError
from truenorth.formats import UnsureError, read_imu, write_layout

G = 9.80665
MOVED = truth("swaying", "tactical")


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
    assert {"101159.99", "101200.00"} <= set(face)
    path.write_text("time,wx,wy,wz,ax,ay,az\n" + rows(face, MOVED.gyro, MOVED.accel))
    record = is_read(path)
    assert abs(record.time[0] - seconds[0]) < 1e-6
    is_read(path, rate=100.0)


def test_the_time_since_startup_where_a_receiver_had_no_time_yet(tmp_path):
    """A VectorNav's own export: GPS time is empty until there are satellites, and the device counts from its start."""
    path = tmp_path / "log.csv"
    gps = ["" if k < len(MOVED.time) // 3 else f"{403575.0 + t:.6f}" for k, t in enumerate(MOVED.time)]
    lines = rows(MOVED.time, MOVED.gyro, MOVED.accel).strip().splitlines()
    header = (
        "TimeStartup [ns],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s],accel_x [m/s^2],accel_y [m/s^2],accel_z [m/s^2]"
    )
    count = [f"{1e9 * t:.0f}," + line.split(",", 1)[1] for t, line in zip(MOVED.time, lines, strict=True)]
    path.write_text(
        "\n".join([f"Time [s],{header}", *(",".join(pair) for pair in zip(gps, count, strict=True))]) + "\n"
    )
    record = is_read(path)
    assert next(guess.value for guess in record.taken_for if guess.what == "time") == "TimeStartup [ns]"


def test_seconds_past_sixty_are_seconds(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,wx,wy,wz,ax,ay,az\n" + rows(101112.0 + MOVED.time, MOVED.gyro, MOVED.accel, form="%.12g"))
    assert is_read(path).time[-1] == pytest.approx(101132.0)


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


# ----------------------------------------------------------------------------------------------- headings and headers


def xyz(pattern, axes="xyz"):
    return [pattern.format(axis) for axis in axes]


def names(time, gyro, accel, sep=","):
    return sep.join([time, *xyz(gyro), *xyz(accel)]) + "\n"


@pytest.mark.parametrize(
    ("time", "gyro", "accel", "sizes"),
    [
        ("time", "gyro_{}", "acce_{}", (1, 1)),  # RIDI, RoNIN
        ("timestamp_seconds", "raw_angular_rate_{}_deg_per_s", "raw_acceleration_{}_gs", (DEG, G)),
        ("GPS TOW", "{} Gyro [x8005]", "{} Accel [x8004]", (1, G)),  # MicroStrain
        ("Time", "6251.133827:scaledGyro{}", "6251.133827:scaledAccel{}", (1, G)),
        ("Timestamp", "{}GYRO_OUT", "{}ACCL_OUT", (DEG, G)),  # Analog Devices
        ("Shimmer_67AF_Timestamp_Unix_CAL", "Shimmer_67AF_Gyro_{}_CAL", "Shimmer_67AF_Accel_LN_{}_CAL", (DEG, 1)),
        ("time", "/imu/data/angular_velocity/{}", "/imu/data/linear_acceleration/{}", (1, 1)),  # PlotJuggler
        ("GPSTime", "angvel_{}", "accel{}", (1, 1)),  # Boreas
    ],
    ids=["RIDI", "per", "MicroStrain", "SensorConnect", "ADIS", "Shimmer", "PlotJuggler", "Boreas"],
)
def test_headings(tmp_path, time, gyro, accel, sizes):
    path = tmp_path / "log.csv"
    header = ",".join([time, *xyz(gyro, "XYZ"), *xyz(accel, "XYZ")])
    path.write_text(header + "\n" + rows(MOVED.time, MOVED.gyro / sizes[0], MOVED.accel / sizes[1]))
    record = is_read(path)
    assert next(guess.why for guess in record.taken_for if guess.what == "columns") == "their names"


def test_units_with_brackets_inside_below_the_header(tmp_path):
    """As Shimmer writes: tabs, the separator on a line of its own, a tab at the end of each row."""
    path = tmp_path / "log.csv"
    body = rows(1e3 * MOVED.time, MOVED.accel, MOVED.gyro / DEG, form="%.9g", sep="\t").replace("\n", "\t\n")
    header = "\t".join(["S_67AF_Timestamp_Unix_CAL", *xyz("S_67AF_Accel_WR_{}_CAL"), *xyz("S_67AF_Gyro_{}_CAL")])
    header = header.replace("S_", "Shimmer_")
    path.write_text(f"sep=\t\n{header}\t\nms" + "\tm/(s^2)" * 3 + "\tdeg/s" * 3 + "\t\n" + body)
    record = is_read(path)
    assert [guess.why for guess in record.taken_for if guess.what.startswith("unit")] == ["the heading"] * 3


def test_a_header_that_is_shorter_than_its_rows(tmp_path):
    """As WitMotion's program writes: tabs, decimal commas, empty cells at the end of the rows alone."""
    path = tmp_path / "log.txt"
    header = [
        "Time",
        "Device name",
        "Chip Time()",
        *xyz("Acceleration {}(g)", "XYZ"),
        *xyz("Angular velocity {}(°/s)", "XYZ"),
    ]
    header += xyz("Angle {}(°)", "XYZ")
    stamps = [f" 05:11:{s:06.3f}" for s in MOVED.time]
    table = rows(MOVED.accel / G, MOVED.gyro / DEG, attitude()[0], form="%.6f", sep="\t").replace(".", ",").splitlines()
    lines = [f"{stamp}\tCOM12\t\t{row}" + "\t" * 6 for stamp, row in zip(stamps, table)]
    path.write_text("\t".join(header) + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    is_read(path)


def test_a_line_of_separators_below_the_header(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(names("time", "w{}", "a{}") + ",,,,,,\n" + rows(MOVED.time, MOVED.gyro, MOVED.accel))
    is_read(path)


def test_the_size_of_a_count_above_the_table(tmp_path):
    """Gyroflow's log, and the explorer of flight logs; without that line the counts are asked about."""
    path, size = tmp_path / "log.gcsv", (0.00122173047, 0.00048828125)
    counts = np.round(MOVED.gyro / size[0] * 16) / 16, np.round(MOVED.accel / G / size[1])
    above = f"GYROFLOW IMU LOG\nversion,1.1\norientation,YxZ\ntscale,0.001\ngscale,{size[0]}\nascale,{size[1]}\n"
    table = names("t", "g{}", "a{}") + rows(np.round(1e3 * MOVED.time), *counts)
    path.write_text(above + table)
    is_read(path)
    path.write_text(table)
    with pytest.raises(DataError, match="if they are counts, say how large one is"):
        read_imu(path)
    path = tmp_path / "flight.csv"
    header = [
        "loopIteration",
        "time (us)",
        *(f"gyroADC[{k}]" for k in range(3)),
        *(f"accSmooth[{k}]" for k in range(3)),
    ]
    counted = np.arange(len(MOVED.time)), np.round(1e6 * MOVED.time), MOVED.gyro / DEG, np.round(MOVED.accel / G * 2048)
    path.write_text('"firmwareType","Cleanflight"\n"acc_1G","2048"\n' + ",".join(header) + "\n" + rows(*counted))
    is_read(path)


def test_the_text_of_an_ardupilot_log(tmp_path):
    pytest.importorskip("pymavlink")
    path = tmp_path / "flight.log"
    head = (
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n"
        "FMT, 130, 45, IMU, Qffffff, TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\nPARM, 100000, SYSID_THISMAV, 1\n"
    )
    body = rows(["IMU"] * len(MOVED.time), np.round(1e6 * MOVED.time), MOVED.gyro, MOVED.accel, sep=", ")
    path.write_text(head + body)
    record = read_imu(path)
    assert record.kind == "rates"
    np.testing.assert_allclose(record.gyro, MOVED.gyro[:, [1, 0, 2]] * [1, 1, -1], atol=1e-6)
    np.testing.assert_allclose(record.time, MOVED.time, atol=1e-6)


def test_large_forces_are_not_gravity_in_feet(tmp_path):
    """A rocket that spins: its median force is 3.4 g, gravity in ft/s^2."""
    path = tmp_path / "log.csv"
    forces = MOVED.accel * (33.6 / 9.8)
    path.write_text(names("t", "w{}", "a{}") + rows(MOVED.time, MOVED.gyro, forces))
    with pytest.raises(UnsureError, match=r"look like ft/s\^2, which few logs are in") as said:
        read_imu(path)
    assert {"units": {"accel": "m/s^2"}} in said.value.options


# ---------------------------------------------------------------------------------------------------------- repeats


def test_rows_written_twice_are_left_out(tmp_path):
    path = tmp_path / "log.csv"
    lines = rows(MOVED.time, MOVED.gyro, MOVED.accel).splitlines()
    twice = [line for k, line in enumerate(lines) for _ in range(2 if k in (0, 700, 1500) else 1)]
    path.write_text(names("time", "gyro_{}", "accel_{}") + "\n".join(twice) + "\n")
    record = is_read(path)
    assert any("left out: 3, the first is line 3" in guess.value for guess in record.taken_for)
    other = lines[700].rpartition(",")[0] + ",9.5"
    path.write_text(names("time", "gyro_{}", "accel_{}") + "\n".join([*lines[:701], other, *lines[701:]]) + "\n")
    with pytest.raises(DataError, match=r"line 703, column time: time repeats|so that some repeat"):
        read_imu(path)


# --------------------------------------------------------------------------------------------------------- programs


def test_the_signs_of_an_iphone(tmp_path):
    """Apple's accelerations point down at rest: SensorLog writes them under the names of the framework."""
    path = tmp_path / "log.csv"
    header = ["motionTimestamp_sinceReboot(s)", *xyz("accelerometerAcceleration{}(G)", "XYZ")]
    header += [*xyz("motionRotationRate{}(rad/s)", "XYZ"), *xyz("motionUserAcceleration{}(G)", "XYZ")]
    path.write_text(",".join(header) + "\n" + rows(MOVED.time, -MOVED.accel / G, MOVED.gyro, 1e-3 * MOVED.accel))
    record = is_read(path)
    assert any("iPhone" in guess.why for guess in record.taken_for)
    write_layout(record, path)
    is_read(path)


def test_decimal_commas_in_quotes(tmp_path):
    path = tmp_path / "log.csv"
    lines = rows(MOVED.time, MOVED.gyro, MOVED.accel, form="%.6f", sep=";").splitlines()
    quoted = [",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(";")) for line in lines]
    path.write_text(names("time", "w{}", "a{}") + "\n".join(quoted) + "\n")
    is_read(path)
    thousands = [",".join(f'"{10 * k:,}"' for k in range(200, 207)) for _ in range(100)]
    path.write_text(names("time", "w{}", "a{}") + "\n".join(thousands) + "\n")
    with pytest.raises(DataError):
        read_imu(path)


def test_the_durations_of_a_timetable(tmp_path):
    """MATLAB writes ``0.01 sec``, and the columns of a variable with numbers."""
    path = tmp_path / "log.csv"
    header = ["Time", *(f"AngularVelocity_{k}" for k in (1, 2, 3)), *(f"Acceleration_{k}" for k in (1, 2, 3))]
    stamps = [f"{t:.2f} sec" for t in MOVED.time]
    path.write_text(",".join(header) + "\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    is_read(path)


def test_the_stamps_of_a_serial_monitor(tmp_path):
    """``10:11:12.345 -> `` stands before each line: the first number is not lost with it."""
    path = tmp_path / "log.txt"
    lines = rows(MOVED.accel, MOVED.gyro, np.full(len(MOVED.time), 25.0)).splitlines()
    stamps = [f"10:11:{s:06.3f} -> " for s in 10.0 + MOVED.time]
    path.write_text("\n".join(stamp + line for stamp, line in zip(stamps, lines)) + "\n")
    is_read(path)


def test_sentences_of_a_receiver_are_no_log_of_an_imu(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("$GPGGA,101112.00,4705.0,N,00805.0,E,4,12,0.8,400,M,47,M,,*5B\r\n" * 60)
    with pytest.raises(DataError, match=r"sentences of a receiver.*give this one as the receiver's"):
        read_imu(path)


@pytest.mark.parametrize(
    ("parts", "velocity"), [("OriInc_q{}", "VelInc_{}"), ("dq_{}", "dv[{}]")], ids=["MT Manager", "DOT"]
)
def test_increments_of_attitude_as_quaternions(tmp_path, parts, velocity):
    """The vector part is half the angle."""
    path, dot = tmp_path / "log.txt", parts == "dq_{}"
    moved = truth("swaying", "tactical", 60.0, 40.0) if dot else MOVED
    angle = moved.increments.gyro
    size = np.linalg.norm(angle, axis=1)[:, None]
    quaternion = np.hstack([np.cos(size / 2), angle / size * np.sin(size / 2)])
    stamps = np.round(moved.time * (1e6 if dot else 1e4))
    header = ["PacketCounter", "SampleTimeFine", *(parts.format(k) for k in ("WXYZ" if dot else "0123"))]
    header += [velocity.format(k) for k in ("123" if dot else "XYZ")]
    table = [np.arange(len(stamps)), stamps, quaternion, moved.increments.accel]
    path.write_text("\t".join(header) + "\n" + rows(*table, sep="\t", form="%.12g"))
    record = is_read(path, moved.increments)
    assert record.kind == "increments"
    write_layout(record, path)
    is_read(path, moved.increments)
    table[2] = quaternion * [1.1, 1, 1, 1]
    path.write_text("\t".join(header) + "\n" + rows(*table, sep="\t", form="%.12g"))
    with pytest.raises(DataError, match="expected a quaternion, of norm 1"):
        read_imu(path)


@pytest.mark.parametrize("names_", ["rotX,rotY,rotZ", "rotX (deg),rotY (deg),rotZ (deg)", "theta_x,theta_y,theta_z"])
def test_angles_are_no_rates(tmp_path, names_):
    """What they change by turns gravity."""
    path, angles = tmp_path / "log.csv", np.cumsum(MOVED.gyro, axis=0) * 0.01 / DEG
    path.write_text(f"time,{names_},accX,accY,accZ\n" + rows(MOVED.time, angles, MOVED.accel))
    words = "no other three may be gyros" if "deg" in names_ else "turn gravity by what they change by, as angles do"
    with pytest.raises(DataError, match=words):
        read_imu(path)


def test_dates_with_points_have_the_day_first(tmp_path):
    path = tmp_path / "log.csv"
    stamps = [f"02.03.2024 10:11:{t:06.3f}" for t in MOVED.time]
    path.write_text(names("Time", "w{}", "a{}") + rows(stamps, MOVED.gyro, MOVED.accel))
    assert is_read(path).time[0] == pytest.approx(1709374260.0 + MOVED.time[0])


def test_accelerations_without_gravity_are_no_rates(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,acc_x,acc_y,acc_z,lacc_x,lacc_y,lacc_z\n" + rows(MOVED.time, MOVED.accel, MOVED.gyro))
    with pytest.raises(DataError, match="no other three may be gyros"):
        read_imu(path)


def test_counts_of_gyros_next_to_forces_in_si(tmp_path):
    """131 counts for one deg/s are in no unit near."""
    path = tmp_path / "log.csv"
    path.write_text(names("t", "w{}", "a{}") + rows(MOVED.time, np.round(MOVED.gyro / DEG * 131), MOVED.accel))
    with pytest.raises(DataError, match="a gyro in no usual unit"):
        read_imu(path)


def test_the_message_of_ros_2_as_a_line(tmp_path):
    """Seconds, nanoseconds, frame, quaternion, rates and forces, each followed by a covariance of zeros; no header."""
    path, zeros = tmp_path / "log.csv", np.zeros((len(MOVED.time), 9))
    stamps = [1.7e9 + np.floor(MOVED.time), np.round(MOVED.time % 1 * 1e9)]
    parts = [*stamps, ["imu_link"] * len(zeros), attitude()[1], zeros, MOVED.gyro, zeros, MOVED.accel, zeros]
    path.write_text(rows(*parts, form="%.10g"))
    is_read(path, rate=100.0)


@pytest.mark.parametrize(
    ("header", "size"), [("Unix Time,Microseconds", 1e-6), ("tv_sec,tv_usec", 1e-6), ("seconds,milliseconds", 1e-3)]
)
def test_seconds_and_their_parts_in_two_columns(tmp_path, header, size):
    path = tmp_path / "log.csv"
    stamps = [1.7e9 + np.floor(MOVED.time + 1e-9), np.round((MOVED.time + 1e-9) % 1 / size)]
    path.write_text(names(header, "w{}", "a{}") + rows(*stamps, MOVED.gyro, MOVED.accel, form="%.10g"))
    assert is_read(path).time[0] == pytest.approx(1.7e9 + MOVED.time[0], abs=1e-5)
