"""Tables of several devices: headings with a device in front, or a third line of the header that says whose a column is."""

import numpy as np
import pytest
from scipy.io import savemat

from truenorth.core.errors import DataError
from truenorth.formats import read_gnss, read_height, read_odometer

LAT, LON, ALT, TIME = 48.0, 9.0, 320.0, np.arange(20.0)
VECTORNAV = ("Fix", "PosLla::latitude [deg]", "PosLla::longitude [deg]", "PosLla::altitude [m]", "VelNed::N [m/s]",
             "VelNed::E [m/s]", "VelNed::D [m/s]", "PosU::N [m]", "PosU::E [m]", "PosU::D [m]", "VelU [m/s]")  # fmt: skip
SAID = (3, LAT, LON, ALT, 1.0, 2.0, 0.5, 2.0, 1.0, 3.0, 0.2)
NAMES = "timestamp,fragment_id,elapsed_time,altitude,bearing,fix_type,latitude,longitude,satellites,speed,lean_angle,speed,speed"
UNITS = "unix time,,s,m,deg,,deg,deg,sats,m/s,deg,m/s,m/s"
SOURCES = ",,,100: gps,100: gps,100: gps,100: gps,100: gps,100: gps,100: gps,calc,calc,200: obd"


def table(path, head, rows):
    path.write_text("\n".join([*head, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def vectornav(path, receivers, first="", clocks=("Time [s]", "GpsTow [s]", "Time::TimeStartup [ns]")):
    """As INSTINCT writes it; the clock of the week is empty until the receiver knows it."""
    names = [*clocks, *(f"{of}::{name}" for of in receivers for name in VECTORNAV), "INS::PosLla::latitude [deg]"]
    rows = []
    for k, t in enumerate(TIME):
        fixes = [
            value + 1 * (name == VECTORNAV[1]) * n
            for n in range(len(receivers))
            for name, value in zip(VECTORNAV, SAID)
        ]
        rows.append([t if k or not first else "", 403000 + t, round((200 + t) * 1e9), *fixes, 1.0])
    return table(path, [",".join(names)], rows)


@pytest.mark.parametrize("receivers", [("GNSS1",), ("GNSS2",), ("GNSS2", "GNSS1")])
def test_fixes_of_a_vectornav_under_their_devices_names(tmp_path, receivers):
    """Nothing but the time was understood; of two receivers the first is taken, and named. The INS's solution is no receiver's."""
    fixes = read_gnss(vectornav(tmp_path / "gnss.csv", receivers))
    np.testing.assert_array_equal(fixes.time, TIME)
    at = LAT + receivers.index(min(receivers))
    np.testing.assert_allclose(np.degrees([fixes.lat, fixes.lon]), [[at] * 20, [LON] * 20])
    np.testing.assert_allclose(fixes.v_n, np.tile([2.0, 1.0, -0.5], (20, 1)))
    np.testing.assert_allclose(fixes.position_sigma, np.tile([1.0, 2.0, 3.0], (20, 1)))
    assert fixes.source == "gnss.csv" + (", GNSS1 of GNSS1, GNSS2" if len(receivers) > 1 else "")


def test_a_solution_of_an_ins_is_no_receivers(tmp_path):
    names = [
        "Time [s]",
        "IMU::Temp [C]",
        "INS::PosLla::latitude [deg]",
        "INS::PosLla::longitude [deg]",
        "INS::PosLla::altitude [m]",
    ]
    path = table(tmp_path / "ins.csv", [",".join(names)], [[t, 30.0, LAT, LON, ALT] for t in TIME])
    with pytest.raises(DataError, match=r"expected time and lat, lon, alt.*understood only Time \[s\]"):
        read_gnss(path)


def test_another_clock_than_the_one_that_is_empty(tmp_path):
    """The message names the others; with one of them the rest is found as before."""
    path = vectornav(tmp_path / "gnss.csv", ["GNSS1"], first="empty")
    with pytest.raises(DataError, match=r"line 2, column Time \[s\]: empty.*GpsTow \[s\], Time::TimeStartup \[ns\]"):
        read_gnss(path)
    fixes = read_gnss(path, columns={"time": "Time::TimeStartup [ns]"})
    np.testing.assert_allclose(fixes.time, 200.0 + TIME)
    np.testing.assert_allclose(fixes.alt, ALT)


def racechrono(path, twice=(7,)):
    rows = []
    for k, t in enumerate(TIME):
        fix = [ALT, 90.0, 3, LAT + 1e-4 * k, LON, 8, 20.0 + k]
        rows += [[1.7e9 + t, 0, t, *fix, 0.1, 99.0, 98.0]] * (1 + (k in twice))
    head = [
        "This file is created using RaceChrono Pro",
        "Format,3",
        "Created,31/12/2025,02:54",
        "",
        NAMES,
        UNITS,
        SOURCES,
    ]
    return table(path, head, rows)


def test_names_units_and_sources_in_three_lines(tmp_path):
    """The sources were taken for the names. Of three speeds the receiver's is taken; rows that were written twice are one."""
    fixes = read_gnss(racechrono(tmp_path / "session_v3.csv"))
    np.testing.assert_allclose(fixes.time, 1.7e9 + TIME)
    np.testing.assert_allclose(np.degrees(fixes.lat), LAT + 1e-4 * TIME)
    np.testing.assert_allclose(fixes.alt, ALT)
    np.testing.assert_allclose(fixes.v_n[:, :2], np.column_stack([20.0 + TIME, np.zeros(20)]), atol=1e-9)


def test_rows_of_one_time_that_differ_are_refused(tmp_path):
    path = racechrono(tmp_path / "session_v3.csv")
    text = path.read_text()
    path.write_text(text.replace(f"{1.7e9 + 7.0},0,7.0,320.0", f"{1.7e9 + 7.0},0,7.0,321.0", 1))
    assert path.read_text() != text
    with pytest.raises(DataError, match=r"line 16, column timestamp \[unix time\]: time repeats"):
        read_gnss(path)
    path = racechrono(tmp_path / "session_v3.csv", twice=range(0, 20, 2))
    with pytest.raises(DataError, match=r"line 9, column timestamp \[unix time\]: time repeats"):
        read_gnss(path)


def test_groups_above_names_are_still_groups(tmp_path):
    """A line of few words under another is no line of sources where no units stand above it."""
    path = table(tmp_path / "log.csv", ["Gps;;;Wheel;;", "time;lat;lon;time;speed;count"], [])
    rows = "\n".join(f"{t};{LAT};{LON};{t};5.0;1" for t in TIME)
    path.write_text(path.read_text() + rows + "\n")
    found = read_odometer(path, columns={"time": "Wheel time", "speed": "Wheel speed"})
    np.testing.assert_array_equal(found.values, 5.0)


def test_fields_of_the_one_struct_of_a_file(tmp_path):
    """Its name does not matter, be it an aid's or a receiver's; of two devices it would."""
    fix = {"t": TIME, "lat": np.full(20, LAT), "lon": np.full(20, LON), "alt": np.full(20, ALT)}
    savemat(tmp_path / "rover.mat", {"mine": fix})
    np.testing.assert_allclose(np.degrees(read_gnss(tmp_path / "rover.mat").lat), LAT)
    savemat(tmp_path / "baro.mat", {"mine": {"t": TIME, "alt": np.full(20, ALT)}})
    np.testing.assert_allclose(read_height(tmp_path / "baro.mat").alt, ALT)
    savemat(tmp_path / "both.mat", {"truth": fix, "mine": fix})
    with pytest.raises(DataError, match="no column of time"):
        read_gnss(tmp_path / "both.mat")
    savemat(tmp_path / "gps.mat", {"truth": fix | {"alt": np.zeros(20)}, "gps": fix})
    np.testing.assert_allclose(read_gnss(tmp_path / "gps.mat").alt, ALT)


@pytest.mark.parametrize(("name", "scale"), [("Time Stamp", 1.0), ("UTC_Time_ms", 1e3), ("sensor timestamp [us]", 1e6)])
def test_a_clock_as_logs_of_an_imu_call_it(tmp_path, name, scale):
    """`Time Stamp` was a clock to the reader of the IMU, and none to that of the receiver."""
    rows = [[1e5 + scale * t, LAT, LON, ALT] for t in TIME]
    fixes = read_gnss(table(tmp_path / "gnss.csv", [f"{name},lat,lon,alt"], rows))
    np.testing.assert_allclose(fixes.time - fixes.time[0], TIME)
    path = table(tmp_path / "two.csv", [f"{name},system time,lat,lon,alt"], [[row[0], *row] for row in rows])
    if name == "Time Stamp":  # plainly one, as `timestamp` is
        np.testing.assert_array_equal(read_gnss(path).time, fixes.time)
        return
    with pytest.raises(DataError, match=rf"no column of time among {name[:4]}.*system time"):
        read_gnss(path)
