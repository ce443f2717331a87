"""Clocks that stand in a file of their own, in the folder of a simulator."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import truenorth as tn

TIMES = [0.0, 0.25, 0.5, 0.75]
FIXES = "gps_lat (deg),gps_lon (deg),gps_alt (m),gps_vN (m/s),gps_vE (m/s),gps_vD (m/s)"


def write(path: Path, header: str, rows: Sequence[object]) -> Path:
    lines = [row if isinstance(row, str) else repr(row) for row in rows]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """As gnss-ins-sim writes it: fixes at 4 Hz, an odometer at the IMU's rate."""
    write(tmp_path / "gps-0.csv", FIXES, [f"31.5,120.{k},4.0,1.0,2.0,{0.1 * k}" for k in range(4)])
    write(tmp_path / "gps_time.csv", "gps_time (sec)", [*TIMES])
    write(tmp_path / "odo-0.csv", "odo (m/s)", [0.1 * k for k in range(8)])
    write(tmp_path / "time.csv", "time (sec)", [0.1 * k for k in range(8)])
    return tmp_path


def test_a_receiver_takes_the_times_that_are_named_after_it(folder: Path) -> None:
    fixes = tn.read_gnss(folder / "gps-0.csv")
    assert fixes.time.tolist() == TIMES
    assert np.degrees(fixes.lon).tolist() == pytest.approx([120.0, 120.1, 120.2, 120.3])
    assert fixes.v_n is not None
    assert fixes.v_n[3].tolist() == pytest.approx([2.0, 1.0, -0.3])


def test_an_odometer_takes_the_times_of_all_sensors_with_as_many_rows(folder: Path) -> None:
    wheel = tn.read_odometer(folder / "odo-0.csv")
    assert wheel.kind == "speed"
    assert wheel.time.tolist() == [0.1 * k for k in range(8)]
    assert wheel.values[-1] == pytest.approx(0.7)


def test_the_folder_stands_for_the_file_of_its_sensor(folder: Path) -> None:
    assert tn.read_gnss(folder).time.tolist() == TIMES
    assert tn.read_odometer(folder).time.tolist() == [0.1 * k for k in range(8)]


@pytest.mark.parametrize("times", [TIMES[:3], [0.0, 0.5, 0.25, 0.75]])
def test_times_that_do_not_fit_are_none(folder: Path, times: list[float]) -> None:
    write(folder / "gps_time.csv", "gps_time (sec)", [*times])
    with pytest.raises(tn.DataError, match="no column of time"):
        tn.read_gnss(folder / "gps-0.csv")


def test_a_clock_of_its_own_wins(folder: Path) -> None:
    write(folder / "gps-0.csv", "time," + FIXES, [f"{9 + k},31.5,120.{k},4.0,1.0,2.0,0.0" for k in range(4)])
    assert tn.read_gnss(folder / "gps-0.csv").time.tolist() == [9.0, 10.0, 11.0, 12.0]


def test_headings_with_the_receiver_in_front_are_no_rivals_of_plain_ones(tmp_path: Path) -> None:
    path = write(
        tmp_path / "both.csv", "time,lat,lon,alt,gps_lat,gps_lon", [f"{k},1.0,2.0,3.0,8.0,9.0" for k in range(3)]
    )
    assert np.degrees(tn.read_gnss(path).lat).tolist() == pytest.approx([1.0] * 3)


def test_a_total_under_the_name_odo_is_not_taken_for_a_speed(tmp_path: Path) -> None:
    path = write(tmp_path / "odo.csv", "time,odo", [f"{k},{k}" for k in range(3)])
    with pytest.raises(tn.DataError, match="expected time and one of"):
        tn.read_odometer(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("time.csv", b""),
        ("time.csv", b"no times\nhere\n"),
        ("time.csv", b"time\n0\nx\n2\n"),
        ("odo_time.csv", b"\x00\x01\x02"),
    ],
)
def test_a_file_that_is_no_clock_spoils_no_log(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    path = write(tmp_path / "odo.csv", "Zeit,speed", [f"{k},1.0" for k in range(3)])
    assert tn.read_odometer(path, columns="time=Zeit").time.tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(tn.DataError, match=r"odo\.csv: no column of time"):
        tn.read_odometer(path)


def test_a_column_that_may_be_the_clock_itself_is_asked_about(tmp_path: Path) -> None:
    path = write(tmp_path / "odo.csv", "Zeit,speed", [f"{10 + k},1.0" for k in range(3)])
    write(tmp_path / "time.csv", "time", [0.0, 1.0, 2.0])
    with pytest.raises(tn.DataError, match="no column of time"):
        tn.read_odometer(path)


def test_whose_clock_a_log_has_is_said(folder: Path) -> None:
    assert tn.read_odometer(folder).source == "odo-0.csv, clock of time.csv"


def test_two_files_of_one_sensor_are_named(folder: Path) -> None:
    write(folder / "odo-1.csv", "odo (m/s)", [0.1 * k for k in range(8)])
    with pytest.raises(tn.DataError, match=r"odo-0\.csv, odo-1\.csv; expected one: name the file"):
        tn.read_odometer(folder)


def test_an_archive_is_read_as_its_folder(folder: Path) -> None:
    with zipfile.ZipFile(folder / "sim.zip", "w") as archive:
        for name in ("odo-0.csv", "time.csv"):
            archive.write(folder / name, name)
    assert len(tn.read_odometer(folder / "sim.zip")) == 8


@pytest.mark.parametrize("header", ["time,speed,speed", "time,speed (m/s),time"])
def test_two_columns_of_one_heading_are_refused(tmp_path: Path, header: str) -> None:
    path = write(tmp_path / "odo.csv", header, [f"{k},1.0,2.0" for k in range(3)])
    with pytest.raises(tn.DataError, match=r"both|twice"):
        tn.read_odometer(path)


def test_what_stands_in_front_of_headings_is_a_receivers_alone(tmp_path: Path) -> None:
    """The speed of a receiver is no wheel's, and named columns are all that is read."""
    path = write(tmp_path / "odo.csv", "time,gps_speed,odo", [f"{k},1.0,2.0" for k in range(3)])
    with pytest.raises(tn.DataError, match="expected time and one of"):
        tn.read_odometer(path)
    rows = [f"{k},1.0,2.0,3.0,5.0,{k}" for k in range(3)]
    path = write(tmp_path / "fixes.csv", "time,a,b,c,gps_vE,gps_tow", rows)
    fixes = tn.read_gnss(path, columns="lat=a,lon=b,alt=c")
    assert fixes.v_n is None
    assert np.degrees(fixes.lon).tolist() == pytest.approx([2.0] * 3)


@pytest.mark.parametrize("heading", ["odo (km/h)", "odo [km/h]", "odo(km/h)"])
def test_odo_is_a_speed_in_units_of_one(tmp_path: Path, heading: str) -> None:
    path = write(tmp_path / "odo.csv", f"time,{heading}", [f"{k},3.6" for k in range(3)])
    wheel = tn.read_odometer(path)
    assert wheel.kind == "speed"
    assert wheel.values.tolist() == pytest.approx([1.0] * 3)
    path = write(tmp_path / "both.csv", f"time,speed (m/s),{heading}", [f"{k},2.0,3.6" for k in range(3)])
    assert tn.read_odometer(path).values.tolist() == pytest.approx([2.0] * 3)
