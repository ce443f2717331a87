"""What a user meets whose log, place or option is wrong: the message names what is wrong, and the option that mends it."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.runs import some
from truenorth.cli import app
from truenorth.core.position import Position
from truenorth.simulation import ideal_log, rest, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, s_turn, straight

PLACE = Position.from_degrees(48.0, 11.0, 500.0)
STEP = 0.02
IMU = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
FIXES = "time,lat,lon,alt,VE,VN,VU"


def save(path, header, *columns):
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.10g")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A base at rest (navigation grade) and a drive (tactical), each with its mistakes."""
    folder = tmp_path_factory.mktemp("logs")
    still = simulate(rest(PLACE, 1.0, 0.05, 0.02), rate=50.0, duration=120.0, imu="navigation", seed=5).record
    t, gyro, accel = still.time, still.gyro / STEP, still.accel / STEP
    save(folder / "rest.csv", IMU, t, gyro, accel)
    save(folder / "flipped.csv", IMU, t, gyro * [1, -1, 1], accel)
    save(folder / "degrees.csv", IMU, t, np.degrees(gyro), accel)
    rows = len(t) // 8 * 8
    stamps = np.repeat(np.arange(rows // 8) * 8 * STEP + 0.3, 8) + np.tile(np.arange(8) * 0.0016, rows // 8)
    save(folder / "bunches.csv", IMU, stamps, gyro[:rows], accel[:rows])
    motion = course(
        PLACE,
        [*straight(10.0), *accelerate(15.0, 1.0, 8.0), *s_turn(0.6, 0.1), *straight(60.0)],
        heading=0.7,
        speed=8.0,
    )
    drive = simulate(ideal_log(motion, rate=50.0, duration=60.0), imu="tactical", seed=4).record
    save(folder / "drive.csv", IMU, drive.time, drive.gyro / STEP, drive.accel / STEP)
    at = motion.states(when := np.arange(0.5, 60.0, 0.5))
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((len(when), 6))
    lat, lon = np.degrees(at.lat) + 1e-5 * noise[:, 0], np.degrees(at.lon) + 1e-5 * noise[:, 1]
    v = at.v_n + 0.05 * noise[:, 3:]
    save(folder / "gnss.csv", FIXES, when, lat, lon, at.alt + noise[:, 2], v)
    save(folder / "away.csv", FIXES, when, lat + 185.0 / 111e3, lon, at.alt + noise[:, 2], v)
    save(folder / "odo.csv", "time,speed", when, np.hypot(at.v_n[:, 0], at.v_n[:, 1]) + 0.02 * noise[:, 0])
    return folder


def said(folder, *arguments):
    """All that the program says, and its exit code."""
    files = [folder / a if str(a).endswith(".csv") else a for a in arguments]
    done = CliRunner().invoke(app, [str(a) for a in files])
    text = done.output + (str(done.exception) if done.exception is not None else "")
    for name in ("nan", "NaN", "Traceback"):
        assert not re.search(rf"\b{name}\b", text), text
    return text, done.exit_code


BASE = ("--lat", 48, "--lon", 11, "--alt", 500)
LONG = "a start 185 m off"
CASES = {
    "a flipped gyro": (
        ("align", "flipped.csv", *BASE, "--imu", "navigation"),
        "check the IMU's axes (--axes)",
        "record longer",
    ),
    "degrees under names that mean rad/s": (("align", "degrees.csv", *BASE), "--units 'gyro=deg/s", "record longer"),
    "stamps in bunches": (("inspect", "bunches.csv"), "--rate 50", "625.00"),
    LONG: (
        ("align", "drive.csv", "--gnss", "away.csv", *BASE, "--imu", "tactical"),
        "about 185 m from where the track began: check the position at the start",
        "clock",
    ),
    "a drive without aids": (("align", "drive.csv", *BASE), "does not stay where it is", "not symmetric"),
    "a drive without aids, by the inertial frame": (
        ("align", "drive.csv", *BASE, "--method", "inertial"),
        "stay",
        "broke down",
    ),
    "a latitude that nobody can tell": (
        ("align", "drive.csv", "--odometer", "odo.csv", "--imu", "tactical"),
        "a log as short, do not see the difference",
        "found from the log",
    ),
}


@pytest.mark.parametrize("case", some([case for case in CASES if case != LONG], [LONG]))
def test_the_message_names_what_is_wrong(folder, case):
    arguments, words, misleading = CASES[case]
    text, _ = said(folder, *arguments)
    assert words in text, text
    assert misleading not in text, text


@pytest.mark.parametrize(
    "arguments",
    [
        ("align", "flipped.csv", *BASE, "--imu", "navigation", "--columns", "gyro_y=-gyro_y"),
        ("align", "degrees.csv", *BASE, "--imu", "navigation", "--units", "deg/s,m/s^2"),
        ("align", "bunches.csv", *BASE, "--imu", "navigation", "--rate", 50),
        ("align", "drive.csv", "--gnss", "gnss.csv", "--imu", "tactical"),
    ],
)
def test_what_the_message_names_mends_it(folder, arguments):
    text, code = said(folder, *arguments)
    assert code == 0, text


def test_innovations_have_their_unit_everywhere(folder, tmp_path):
    """Of an alignment on the move: metres are metres in the table and on the page."""
    import truenorth as tn

    record, fixes = tn.read_imu(folder / "drive.csv"), tn.read_gnss(folder / "gnss.csv")
    answer = tn.align(record, imu="tactical", aid=tn.Gnss(fixes))
    history = answer.history
    assert history.innovation_of == "GNSS position"
    names = [name for name in answer.to_frame() if name.startswith("innovation")]
    assert {name.rpartition("_")[2] for name in names} == {"m"}
    answer.save(tmp_path / "answer")
    page = (tmp_path / "answer" / "report.html").read_text("utf-8")
    assert "Predicted less measured: GNSS position." in page
    assert "velocity of the base" not in page
    row = slice(0, 2)
    place = {name: getattr(fixes, name)[row] for name in ("lat", "lon", "alt")}
    master = tn.MasterRecord(fixes.time[row], answer.C_nb[None].repeat(2, 0), fixes.v_n[row], **place)
    start = tn.start_from_master(record, master, "tactical", 0.05, 0.05)
    track = tn.navigate(record, start, imu="tactical", aid=tn.Gnss(fixes), check_clocks=False)
    table = track.innovations()
    assert set(table["unit"][table["sensor"] == "GNSS position"]) == {"m"}
    assert set(table["unit"][table["sensor"] == "GNSS velocity"]) == {"m/s"}
