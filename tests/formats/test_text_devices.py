"""Logs of Android's GnssLogger, of VectorNav's ASCII messages and of KITTI, written from a known truth and read back."""

from functools import reduce
from operator import xor

import numpy as np
import pytest

from tests.formats.test_devices import ALT, FRD, LAT, LON, SWAY, TIME, assert_is_sway
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_gnss, read_imu, read_master
from truenorth.formats.guesses import UnsureError
from truenorth.formats.magnetometer import read_magnetometer

BOOT, UTC = 5321.25, 1.7e9  # s of the phone's clock and of UTC at the truth's zero
SHIFT = 0.0023  # s, of the accelerometers' rows against the gyros'
HEADER = """# \n# Header Description:\n# \n# Version: v3.0.6.4 Platform: 13 Manufacturer: X Model: Y
# UncalAccel,utcTimeMillis,elapsedRealtimeNanos,UncalAccelXMps2,UncalAccelYMps2,UncalAccelZMps2,BiasXMps2,BiasYMps2,BiasZMps2
# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,UnixTimeMillis,{more}
"""
MORE = "SpeedAccuracyMps,BearingAccuracyDegrees,elapsedRealtimeNanos,VerticalAccuracyMeters,MockLocation"


def phone_row(kind, t, values, elapsed=True):
    stamp = f"{(BOOT + t) * 1e9:.0f}" if elapsed else ""
    return ",".join([kind, f"{(UTC + t) * 1e3:.0f}", stamp, *(f"{v:.9g}" for v in values), "0.5", "0.5", "0.5"])


def phone_log(elapsed=True, fixes_elapsed=True):
    """Batches of rows as Android hands them over: accelerometers before gyros, some twice."""
    lines = [HEADER.format(more=MORE).rstrip("\n")]
    forces = np.column_stack([np.interp(TIME - SHIFT, TIME, a) for a in SWAY.accel.T])
    for first in range(0, len(TIME), 50):
        part = range(first, min(first + 50, len(TIME)))
        lines += [phone_row("UncalAccel", TIME[k] - SHIFT, forces[k], elapsed) for k in part]
        lines += [phone_row("UncalGyro", TIME[k], SWAY.gyro[k], elapsed) for k in (*part, part[0])]
        lines += [phone_row("Gyro", TIME[part[0]], [1.0, 2.0, 3.0], elapsed), f"Raw,{first},1,2,3"]
        lines += [phone_row("UncalMag", TIME[part[0]], 4.0 * SWAY.accel[part[0]] + 0.5, elapsed)]  # hard iron, and said
        own = f"{(BOOT + first / 100) * 1e9:.0f}" if fixes_elapsed else ""
        utc = f"{(UTC + first / 100) * 1e3:.0f}"
        lines += [f"Fix,GPS,{LAT},{LON},{ALT},2.0,3.03,90.0,{utc},0.5,5,{own},4.5,0"]
        lines += [f"Fix,NLP,{LAT + 1},{LON},,,400,,{utc},,,{own},,0"]
    return "\n".join(lines) + "\nUncalGyro,17"


@pytest.mark.parametrize("name", ["gnss_log.txt", "phone.csv"])
def test_a_phone(tmp_path, name):
    path = tmp_path / name
    path.write_text(phone_log())
    record = read_imu(path)
    assert len(record) == len(TIME) - 1  # the last gyro is later than the last accelerometer
    np.testing.assert_allclose(record.time - BOOT, TIME[:-1], atol=1e-6)
    np.testing.assert_allclose(record.gyro, SWAY.gyro[:-1], atol=1e-8)
    forces = np.column_stack([np.interp(TIME - SHIFT, TIME, a) for a in SWAY.accel.T])
    expected = np.column_stack([np.interp(TIME, TIME - SHIFT, a) for a in forces.T])
    np.testing.assert_allclose(record.accel, expected[:-1], atol=1e-6)
    assert any("interpolated" in guess.why + guess.value for guess in record.taken_for)
    fixes = read_gnss(path)
    np.testing.assert_allclose(fixes.time - BOOT, np.arange(0, len(TIME), 50) / 100, atol=1e-6)
    np.testing.assert_allclose(np.degrees(fixes.lat), LAT, atol=1e-9)
    np.testing.assert_allclose(fixes.v_n[:, 0], 2.0)
    np.testing.assert_allclose(fixes.position_sigma[0], [2.0, 2.0, 4.5], rtol=1e-2)
    field = read_magnetometer(path)
    np.testing.assert_allclose(field.field, SWAY.accel[::50] * 4e-6, rtol=1e-7)


def test_fixes_in_utc_alone_come_to_the_phone_s_clock(tmp_path):
    path = tmp_path / "gnss_log.txt"
    path.write_text(phone_log(fixes_elapsed=False))
    np.testing.assert_allclose(read_gnss(path).time - BOOT, np.arange(0, len(TIME), 50) / 100, atol=1e-3)


def test_a_phone_without_its_own_clock_has_utc(tmp_path):
    path = tmp_path / "gnss_log.txt"
    path.write_text(phone_log(elapsed=False, fixes_elapsed=False))
    assert abs(read_imu(path).time[0] - UTC - TIME[0]) < 2e-3
    assert abs(read_gnss(path).time[0] - UTC) < 2e-3


@pytest.mark.parametrize("first", ["UncalAccel", "# Uncal", "# Fix", "Fix,GPS"])
def test_rows_of_a_phone_without_the_remarks_above_them(tmp_path, first):
    """As they are after a search for the rows that somebody wants, which is how such logs are handed on."""
    lines = phone_log().splitlines(keepends=True)
    kept = [line for line in lines if line.startswith(("Uncal", "Fix,GPS", "# Uncal", "# Fix"))]
    start = next(k for k, line in enumerate(kept) if line.startswith(first))
    path = tmp_path / "rows.txt"
    path.write_text("".join([kept[start], *kept[2:start], *kept[start + 1 :]]))
    assert len(read_imu(path)) == len(TIME) - 1
    np.testing.assert_allclose(np.degrees(read_gnss(path).lat), LAT, atol=1e-9)


def test_fixes_of_an_old_phone_have_other_names(tmp_path):
    head = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n"
    rows = [f"Fix,gps,{LAT},{LON},{ALT},2.0,3.03,{(UTC + k) * 1e3:.0f}\n" for k in range(20)]
    imu = [line for line in phone_log().splitlines(keepends=True) if line.startswith("Uncal")]
    path = tmp_path / "pseudoranges_log.txt"
    path.write_text(head + "".join(imu[:-1] + rows))
    fixes = read_gnss(path)
    np.testing.assert_allclose(fixes.time - BOOT, np.arange(20.0), atol=1e-3)
    np.testing.assert_allclose(np.degrees(fixes.lat), LAT, atol=1e-9)
    np.testing.assert_allclose(fixes.position_sigma[:, :2], 2.0, rtol=1e-2)


def test_the_long_table_of_a_phone(tmp_path):
    path = tmp_path / "device_imu.csv"
    head = "MessageType,utcTimeMillis,elapsedRealtimeNanos,MeasurementX,MeasurementY,MeasurementZ,BiasX,BiasY,BiasZ"
    rows = [phone_row("UncalAccel", t, f) for t, f in zip(TIME, SWAY.accel)]
    rows += [phone_row("UncalGyro", t, w) for t, w in zip(TIME, SWAY.gyro)]
    path.write_text("\n".join([head, *rows]) + "\n")
    assert_is_sway(read_imu(path), 1e-8, 1e-7, BOOT)


def test_a_phone_s_line_that_is_no_number_is_named(tmp_path):
    path = tmp_path / "gnss_log.txt"
    whole = phone_log().removesuffix("UncalGyro,17")
    path.write_text(f"{whole}UncalGyro,1700000000000,1,x,0,0,0,0,0\n")
    with pytest.raises(DataError, match=rf"line {whole.count(chr(10)) + 1}: UncalGyro, field 4: 'x'"):
        read_imu(path)


def vn(body):
    return f"${body}*{reduce(xor, body.encode()):02X}\r\n"


def numbers(*values):
    return ",".join(f"{v:+.9f}" for v in values)


@pytest.mark.parametrize("kind", ["VNIMU", "VNMAR", "VNYMR", "VNQMR"])
def test_messages_of_a_vectornav(tmp_path, kind):
    before = {"VNYMR": "+010.0,-001.0,+002.0,", "VNQMR": "+0.1,+0.2,+0.3,+0.9,"}.get(kind, "")
    after = ",+20.7,+084.322" if kind == "VNIMU" else ""
    gyro, accel = FRD(SWAY.gyro), FRD(SWAY.accel)
    lines = [vn("VNRRG,01,VN-200")] + [
        vn(f"{kind},{before}{numbers(0.1, 0.2, -0.4)},{numbers(*f)},{numbers(*w)}{after}") for w, f in zip(gyro, accel)
    ]
    path = tmp_path / "vn.txt"
    path.write_text("".join(lines) + "$VNIMU,+0")
    record = read_imu(path, rate=100.0)
    assert_is_sway(record, 1e-8, 1e-8, record.time[0] - TIME[0])
    with pytest.raises(UsageError, match="give the rate"):
        read_imu(path)


def test_a_damaged_message_would_shift_time_and_is_named(tmp_path):
    lines = [vn(f"VNMAR,{numbers(*range(9))}") for _ in range(20)]
    lines[7] = lines[7].replace("+3.", "+8.")
    path = tmp_path / "vn.log"
    path.write_text("".join(lines))
    with pytest.raises(DataError, match="line 8: VNMAR with checksum"):
        read_imu(path, rate=100.0)
    lines[7] = vn("VNMAR,+1,+2")
    path.write_text("".join(lines))
    with pytest.raises(DataError, match="line 8: VNMAR with 2 fields; expected 9"):
        read_imu(path, rate=100.0)


def test_increments_of_a_vectornav_tell_time(tmp_path):
    turn, dv = np.degrees(FRD(SWAY.gyro)) * 0.01, FRD(SWAY.accel) * 0.01
    path = tmp_path / "vn.txt"
    path.write_text("".join(vn(f"VNDTV,+0.010000,{numbers(*a)},{numbers(*v)}") for a, v in zip(turn, dv)))
    record = read_imu(path)
    np.testing.assert_allclose(np.diff(record.time), 0.01, rtol=1e-9)
    assert record.kind == "increments"
    np.testing.assert_allclose(record.gyro, SWAY.gyro * 0.01, atol=1e-9)
    np.testing.assert_allclose(record.accel, SWAY.accel * 0.01, atol=1e-9)


def test_receiver_and_solution_of_a_vectornav(tmp_path):
    fix = f"{LAT},{LON},{ALT},+1.0,+2.0,+0.5,1.5,1.6,3.0,0.1,6E-09"
    whole = "".join(
        vn(f"VNGPS,{100 + k}.5,2046,{3 if k else 0},07,{fix}")
        + vn(f"VNINS,{100 + k}.5,2046,000A,+090.0,+001.0,-002.0,{LAT},{LON},{ALT},+1.0,+2.0,+0.5,0.5,1.5,0.05")
        for k in range(10)
    )
    path = tmp_path / "vn.txt"
    path.write_text(whole)
    fixes, solution = read_gnss(path), read_master(path)
    np.testing.assert_allclose(fixes.time, 101.5 + np.arange(9))
    np.testing.assert_allclose(fixes.v_n[0], [2.0, 1.0, -0.5])
    np.testing.assert_allclose(fixes.position_sigma[0], [1.6, 1.5, 3.0])
    np.testing.assert_allclose(solution.v_n[0], [2.0, 1.0, -0.5])
    np.testing.assert_allclose(solution.C_nb[0, :2, 1], [1.0, 0.0], atol=0.02)  # forward is east


def kitti(folder, rows):
    (folder / "data").mkdir(parents=True)
    stamps = [f"2011-09-26 13:02:{25 + t:012.9f}" for t in TIME[: len(rows)]]
    (folder / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    for k, row in enumerate(rows):
        (folder / "data" / f"{k:010d}.txt").write_text(" ".join(f"{x:.12g}" for x in row))
    return folder


def oxts_rows():
    """Thirty numbers each: front, left, up; yaw from east to north, pitch of a nose that points down."""
    rows = np.zeros((len(TIME), 30))
    rows[:, :3] = LAT, LON, ALT
    rows[:, 3:6] = np.radians([2.0, -1.0, 30.0])
    rows[:, 6:11] = 1.0, 2.0, 0.0, 0.0, -0.5
    rows[:, 11:14] = SWAY.accel[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
    rows[:, 17:20] = SWAY.gyro[:, [1, 0, 2]] * [1.0, -1.0, 1.0]
    rows[:, 23:25] = 0.5, 0.05
    return rows


def test_kitti(tmp_path):
    folder = kitti(tmp_path / "oxts", oxts_rows())
    record, fixes, solution = read_imu(folder), read_gnss(folder), read_master(folder)
    assert_is_sway(record, 1e-9, 1e-9, record.time[0] - TIME[0])
    np.testing.assert_allclose(record.time[0], 1317042145.01, atol=1e-6)
    np.testing.assert_allclose(fixes.v_n[0], [2.0, 1.0, -0.5])
    np.testing.assert_allclose(fixes.position_sigma[0], 0.5)
    forward, right = solution.C_nb[0, :, 1], solution.C_nb[0, :, 0]
    np.testing.assert_allclose(np.degrees(np.arctan2(forward[0], forward[1])), 60.0, atol=1e-9)
    np.testing.assert_allclose(np.degrees(np.arcsin(forward[2])), 1.0, atol=1e-9)  # the nose points up
    assert right[2] < 0.0  # its left side is up


def test_what_is_wrong_in_kitti_is_named(tmp_path):
    folder = kitti(tmp_path / "oxts", oxts_rows()[:20])
    (folder / "data" / "0000000007.txt").write_text("1 2 x")
    with pytest.raises(DataError, match=r"0000000007.txt: 3 cells"):
        read_imu(folder)
    (folder / "data" / "0000000007.txt").unlink()
    with pytest.raises(DataError, match="19 files in data and 20 stamps"):
        read_imu(folder)
    (folder / "timestamps.txt").write_text("yesterday\n")
    with pytest.raises(DataError, match="line 1: 'yesterday'"):
        read_imu(folder)
    with pytest.raises(UsageError, match="a folder; expected"):
        read_imu(tmp_path)


def test_a_line_as_a_phone_wrote_it(tmp_path):
    """From GnssLogger's own description of its log: hard iron of five times the earth's field, which the phone knows."""
    path = tmp_path / "gnss_log.txt"
    path.write_text(
        "# \n# Header Description:\n"
        "UncalMag,1663164669191,65972055195160,221.51251,89.793755,-21.16875,213.84875,180.1958,5.4516187\n"
        "UncalGyro,1663164669189,65972053803181,0.0006108648,-0.020769402,0.023518294,-0.009432952,0.000007726701,-0.008078051\n"
        "UncalAccel,1663164669190,65972054923181,0.4642076,7.7742805,5.8707905,0.0,0.0,0.0\n"
        "UncalMag,1663164669201,65972065195160,221.51251,89.793755,-21.16875,213.84875,180.1958,5.4516187\n"
        "Fix,GPS,28.1435263000,-82.2971356000,-14.2,0.09635656,5.857,108.336426,1663712656000,,,445420306913617,11.185,0\n"
        "Fix,GPS,28.1435263000,-82.2971356000,-14.2,0.09635656,5.857,,1663712657000,,,445421306913617,11.185,0\n"
    )
    field = read_magnetometer(path).field[0]
    np.testing.assert_allclose(field, [7.66376e-6, -90.402045e-6, -26.6203687e-6], rtol=1e-6)
    fix = read_gnss(path)
    np.testing.assert_allclose(np.degrees(fix.lat), 28.1435263)
    np.testing.assert_allclose(np.diff(fix.time), 1.0)
    np.testing.assert_allclose(fix.v_n[0, :2], 0.09635656 * np.array([0.9492, -0.3146]), rtol=1e-3)


def test_a_header_of_two_lines_whose_cells_span_columns(tmp_path):
    """As spreadsheets write it, with one separator more than the rows have; without groups the names stay as they are."""
    path = tmp_path / "log.csv"
    rng = np.random.default_rng(1)
    rows = [
        f"{0.01 * k:.2f};1;0;0;0;{0.1 + 0.01 * rng.standard_normal():.5f};0.2;9.8;{0.01 * rng.standard_normal():.6f};0.003;0.005"
        for k in range(1, 400)
    ]
    head = "Time (s);Optic Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;\n;W;X;Y;Z;X;Y;Z;X;Y;Z;\n"
    path.write_text(head + "\n".join(rows) + "\n")
    record = read_imu(path, units={"gyro": "rad/s"})
    np.testing.assert_allclose(record.accel[:, 1:], [[0.2, 9.8]] * 399)
    np.testing.assert_allclose(record.gyro[:, 1:], [[0.003, 0.005]] * 399)
    path.write_text("a;b\n" + head.replace("X", "x") + "\n".join(rows) + "\n")
    assert len(read_imu(path, units={"gyro": "rad/s"})) == 399


def test_stamps_of_few_digits_ask_for_the_rate(tmp_path):
    """Five digits, as RepoIMU has them: from 100 s on .01 s, and some repeat. A row that is written twice is another matter."""
    path = tmp_path / "log.csv"
    noise = 1e-3 * np.random.default_rng(1).standard_normal((3000, 6)) + np.array([0, 0, 0, 0, 0, 9.8])
    time = 95.0 + np.arange(3000) / 120.0

    def write(stamps, rows):
        values = [f"{t},{','.join(f'{x:.6f}' for x in row)}" for t, row in zip(stamps, rows, strict=True)]
        path.write_text("time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n" + "\n".join(values) + "\n")

    write([f"{t:.5g}" for t in time], noise)
    with pytest.raises(UnsureError, match="few digits, so that some repeat; 120 rows a second"):
        read_imu(path, units={"gyro": "rad/s"})
    assert read_imu(path, units={"gyro": "rad/s"}, rate=120.0).interval == pytest.approx(1 / 120.0)
    write(
        [f"{t:.3f}" for t in np.insert(time, 500, time[500])],
        np.insert(noise, 500, 2.0 * noise[500], axis=0),
    )
    with pytest.raises(DataError, match="drop the repeated rows"):
        read_imu(path, units={"gyro": "rad/s"})
