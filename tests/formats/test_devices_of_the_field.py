"""Logs of single devices of the field: Racelogic's VBOX, an Xsens DOT, Gyroflow; files of MATLAB with clocks of several devices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import savemat

from tests.formats.corpus.truth import DEG, truth
from tests.formats.test_field_logs import MOVED, G, is_read, rows
from tests.formats.test_second_reading import notes
from truenorth.aiding.sensors import from_gnss
from truenorth.core.errors import DataError
from truenorth.formats import UnsureError, read_gnss, read_height, read_imu
from truenorth.state.mounting import Mounting

N = len(MOVED.time)

# ------------------------------------------------------------------------------------------------------ Racelogic's VBOX

VBO = """File created on 31/07/2006 at 23:59:58

[header]
satellites
time
latitude
longitude
velocity {speed}
heading
height
{up}
trigger event time in clock counts

[channel units]

[comments]
(c) 2001 2003 Racelogic
VBox II Version 4.5a
Log Rate (Hz) : 02.00
Security Code : %//+$%00"0/0+

[column names]
sats time lat long velocity heading height {name} event1

[data]
"""
STAMPS = ["235958.50", "235959.00", "235959.50", "000000.00", "000000.50"]


def vbo(path, speed="kmh", sats=9, comment=""):
    """A file of ten rows northwards with so many satellites."""
    head = VBO.format(speed=speed, up="vertical velocity kmh", name="vertvel").replace("VBox II", comment + "VBox II")
    fixes = [
        f"{sats:03d} 1000{k:02d}.00 +03119.09973 +00058.49277 036.000 000.00 +00152.58 +000.360 00000"
        for k in range(10)
    ]
    path.write_bytes((head + "\n".join(fixes) + "\n").encode("latin-1"))
    return path


@pytest.mark.parametrize("sats", [4, 6, 70, 134])
def test_how_many_satellites_is_not_how_good_a_fix_is(tmp_path, sats):
    """Six of them were taken for dead reckoning and left out, four for a fixed phase."""
    record = read_gnss(vbo(tmp_path / "drive.vbo", sats=sats))
    assert list(record.quality) == [1] * 10
    assert [len(source.time) for source in from_gnss(record, Mounting())] == [10, 10]


def test_a_sign_of_another_code_page_ends_no_line(tmp_path):
    """Two dots of Windows: a row was lost for each."""
    assert len(read_gnss(vbo(tmp_path / "drive.vbo", comment="wet\x85 \x0b"))) == 10


@pytest.mark.parametrize(("speed", "factor"), [("mph", 0.44704), ("kts", 1852 / 3600), ("m/s", 1.0), ("kmh", 1 / 3.6)])
def test_speed_in_the_unit_that_the_header_names(tmp_path, speed, factor):
    record = read_gnss(vbo(tmp_path / "drive.vbo", speed=speed))
    np.testing.assert_allclose(record.v_n[:, 1], 36.0 * factor)


def test_a_speed_in_a_unit_that_nobody_knows(tmp_path):
    with pytest.raises(DataError, match=r"drive.vbo: \[header\]: velocity in furlongs; expected a unit of speed"):
        read_gnss(vbo(tmp_path / "drive.vbo", speed="furlongs"))


@pytest.mark.parametrize(
    ("speed", "up", "name", "want"),
    [
        ("kmh", "vertical velocity kmh", "vertvel", (10.0, 0.1)),
        ("knots", "Vertical velocity m/s", "vert-vel", (18.52, 0.36)),
    ],
)
def test_a_vbox(tmp_path, speed, up, name, want):
    """Minutes of arc, west positive, UTC over midnight, the units that the header names; no satellites, no fix."""
    fixes = [
        f"{137 if k else 128} {s} +03119.09973 +00058.49277 036.000 090.00 +00152.58 +000.360 00000"
        for k, s in enumerate(STAMPS)
    ]
    path = tmp_path / "drive.vbo"
    path.write_text(VBO.format(speed=speed, up=up, name=name) + "\n".join(fixes) + "\n", newline="\r\n")
    record = read_gnss(path)
    np.testing.assert_allclose(record.time, 86398.5 + 0.5 * np.arange(5))
    np.testing.assert_allclose(np.degrees(record.lat[1:]), 3119.09973 / 60.0)
    np.testing.assert_allclose(np.degrees(record.lon[1:]), -58.49277 / 60.0)
    np.testing.assert_allclose(record.v_n[1:], np.tile([want[0], 0.0, want[1]], (4, 1)), atol=1e-9)
    assert np.isnan(record.lat[0])
    assert list(record.quality) == [0, 1, 1, 1, 1]  # no satellites, no fix; of the others it does not say how good
    fixes[2] = fixes[2].replace("+03119.09973", "+O3119.09973")
    path.write_text(VBO.format(speed=speed, up=up, name=name) + "\n".join(fixes) + "\n")
    number = path.read_text().splitlines().index(fixes[2]) + 1
    with pytest.raises(DataError, match=rf"drive.vbo: line {number}, column lat: '\+O3119.09973'; expected a number"):
        read_gnss(path)
    path.write_text(
        VBO.format(speed=speed, up=up, name=name).replace("lat long", "latitude long") + "\n".join(fixes) + "\n"
    )
    with pytest.raises(DataError, match=r"drive.vbo: column 'lat' is missing under \[column names\]"):
        read_gnss(path)


# --------------------------------------------------------------------------------------------------------- an Xsens DOT

NAMES = [f"{of}_{axis}" for of in ("Euler", "Acc", "Gyr") for axis in "XYZ"]
DOT = "DeviceTag:,Xsens DOT 1\nOutputRate:,60Hz\n\n" + ",".join(["PacketCounter", "SampleTimeFine", *NAMES]) + "\n"


def dot(moved, gyro, ticks=1e6):
    counts = [f"{count:.0f}" for count in np.round(ticks * moved.time)]
    return DOT + rows([str(k) for k in range(len(counts))], counts, np.zeros_like(gyro), moved.accel, gyro)


@pytest.mark.parametrize("base", ["still", "swaying", "driven"])
@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_a_dot_is_in_degrees_a_second(tmp_path, base, rate):
    """Its clock counts microseconds, which no other Xsens's does; that of a base that does not turn gravity shows no unit."""
    moved = truth(base, "tactical", rate, 40.0)
    (tmp_path / "log.csv").write_text(dot(moved, moved.gyro / DEG))
    record = is_read(tmp_path / "log.csv", moved)
    assert "unit of the gyros: deg/s" in notes(record)


def test_a_dot_whose_gyros_turn_gravity_as_rad_s_is_read_so(tmp_path):
    """Somebody has changed the unit: physics contradicts the maker."""
    (tmp_path / "log.csv").write_text(dot(MOVED, MOVED.gyro))
    assert "unit of the gyros: rad/s" in notes(is_read(tmp_path / "log.csv"))


def test_dates_under_the_heading_of_a_fine_time(tmp_path):
    """As a converter writes them, in ms since 1970; 0.1 ms would be a log of ten times the length."""
    lines = dot(MOVED, MOVED.gyro / DEG, 1e3).splitlines()
    head, table = lines[:4], [line.split(",") for line in lines[4:]]
    table = [",".join([cells[0], str(1700000000000 + int(cells[1])), *cells[2:]]) for cells in table]
    (tmp_path / "log.csv").write_text("\n".join([*head, *table]) + "\n")
    assert "unit of time: ms" in notes(is_read(tmp_path / "log.csv"))


# -------------------------------------------------------------------------------------------------------------- Gyroflow


def test_the_orientation_of_a_gyroflow_log_is_said_not_to_be_applied(tmp_path):
    above = (
        "GYROFLOW IMU LOG\nversion,1.3\norientation,YxZ\ntscale,0.001\ngscale,1.0\nascale,1.0\nt,gx,gy,gz,ax,ay,az\n"
    )
    (tmp_path / "log.gcsv").write_text(above + rows(1e3 * MOVED.time, MOVED.gyro, MOVED.accel / G))
    record = is_read(tmp_path / "log.gcsv")
    axes = next(guess for guess in record.taken_for if guess.what == "axes")
    assert "orientation YxZ is of a camera and not applied" in axes.why


# --------------------------------------------------------------------------------------- clocks of several devices in a file

IMU, TWICE = {"gyro": MOVED.gyro, "accel": MOVED.accel}, 2.0 * MOVED.time + 5.0
TABLE = np.column_stack([MOVED.time, MOVED.gyro, MOVED.accel])
FIXES = {f"c{k}": np.zeros(40) for k in range(15)}


@pytest.mark.parametrize(
    "variables",
    [
        {"gps": {"time": TWICE, "lat": np.zeros(N)}, "imu": {"time": MOVED.time, "w": MOVED.gyro, "f": MOVED.accel}},
        {"gps_time": TWICE, "imu_time": MOVED.time, **IMU},
        {"ref": {"t": TWICE, "roll": np.zeros(N)}, "sens": {"t": MOVED.time, "acc": MOVED.accel, "gyr": MOVED.gyro}},
        {"t_acc": MOVED.time, "acc": MOVED.accel, "t_gyr": MOVED.time, "gyr": MOVED.gyro, "t_gps": TWICE},
        {"gnss": {f"c{k}": np.arange(40.0) + k for k in range(15)}, "data": TABLE},
        {"gnss": np.random.default_rng(1).random((40, 250)), "data": TABLE},
        {"gnss": {"t": np.arange(40.0), **FIXES}, "a": {"t": MOVED.time, "u": MOVED.gyro, "v": MOVED.accel}},
    ],
)  # fmt: skip
def test_the_sensors_clock_of_several(tmp_path, variables):
    """That of another device of as many rows was taken where it came first; many columns of one hid the sensors."""
    savemat(tmp_path / "log.mat", variables)
    is_read(tmp_path / "log.mat")


def test_two_clocks_that_nothing_tells_apart_are_asked_about(tmp_path):
    savemat(tmp_path / "log.mat", {"time_1": MOVED.time, "time_2": TWICE, **IMU})
    with pytest.raises(UnsureError):
        read_imu(tmp_path / "log.mat")
    savemat(tmp_path / "log.mat", {"t_s": MOVED.time, "t_ms": 1e3 * MOVED.time, **IMU})
    is_read(tmp_path / "log.mat")


@pytest.mark.parametrize("time", ["1e248", "1e400"])
def test_a_time_of_a_vbox_that_is_infinite(tmp_path, time):
    """It was a warning of NumPy, and no message."""
    path = vbo(tmp_path / "drive.vbo")
    lines = path.read_text().splitlines()
    k = lines.index("[data]") + 3
    lines[k] = " ".join([lines[k].split()[0], time, *lines[k].split()[2:]])
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError, match=r"drive.vbo: line \d+"):
        read_gnss(path)


def test_an_infinite_number_of_satellites_of_a_vbox_is_no_fix(tmp_path):
    """It was a warning of NumPy: of a row without a fix nothing is left."""
    path = vbo(tmp_path / "drive.vbo")
    lines = path.read_text().splitlines()
    k = lines.index("[data]") + 3
    lines[k] = " ".join(["9" * 400, *lines[k].split()[1:]])
    path.write_text("\n".join(lines) + "\n")
    assert np.isfinite(read_gnss(path).lat).sum() == 9


# -------------------------------------------------------------------------------------------------- headings of loggers


def test_headings_of_betaflights_decoder(tmp_path):
    """Elements of arrays with a unit behind them; the size of a count of the accelerometers, which it does not write, is asked."""
    names = [f"gyroADC[{k}] (deg/s)" for k in range(3)] + [f"accSmooth[{k}]" for k in range(3)]
    head = ", ".join(["time (us)", *names, "motor[0]"]) + "\n"
    counts = np.round(MOVED.accel / G * 2048.0)
    table = rows(1e6 * MOVED.time, MOVED.gyro / DEG, counts, 137.0 + 0.0 * MOVED.time)
    (tmp_path / "log.csv").write_text(head + table)
    with pytest.raises(DataError, match=r"the accelerometers show 20.* counts, say how large one is"):
        read_imu(tmp_path / "log.csv")
    record = read_imu(tmp_path / "log.csv", units={"accel": "0.00048828125 g"})
    np.testing.assert_allclose(record.gyro, MOVED.gyro, atol=1e-6)
    np.testing.assert_allclose(record.accel, MOVED.accel, atol=0.005)


def test_stamps_with_underscores(tmp_path):
    stamps = [f"2026_06_15_18_{59 if t < 30 else 0:02d}_{t % 60.0:06.3f}" for t in (20.0, 20.25, 20.5)]
    (tmp_path / "log.csv").write_text("time,alt\n" + "".join(f"{stamp},{k}\n" for k, stamp in enumerate(stamps)))
    record = read_height(tmp_path / "log.csv")
    np.testing.assert_allclose(record.time - 1781549960.0, [0.0, 0.25, 0.5])


def test_counts_of_gyros_are_not_said_to_show_gravity(tmp_path):
    """Their offset was taken for it."""
    rng = np.random.default_rng(1)
    gyro = np.round(rng.normal([500.0, 500.0, 680.0], 2.0, (500, 3)))
    accel = np.round(rng.normal(0.0, 300.0, (500, 3)))
    table = "".join(",".join(f"{v:.0f}" for v in (k, *f, *w)) + "\n" for k, (f, w) in enumerate(zip(accel, gyro)))
    (tmp_path / "log.dat").write_text("SampleNumber,AccX,AccY,AccZ,GyroR,GyroP,GyroY\n" + table)
    with pytest.raises(DataError, match=r"no columns of an IMU among .*name the columns"):
        read_imu(tmp_path / "log.dat", rate=100.0)
