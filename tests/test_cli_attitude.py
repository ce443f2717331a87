"""Sensors of attitude, velocity logs and starts from another system, from the shell."""

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

from truenorth.aiding.magnetometer import earth_field
from truenorth.cli import app
from truenorth.core.attitude import euler_from_dcm
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight, turn

PLACE = Position.from_degrees(50.0, 10.0, 100.0)
LEGS = [*straight(8.0), *turn(2 * np.pi, np.radians(12.0)), *s_turn(np.radians(30.0), np.radians(6.0)), *straight(90.0)]
IMU = ["--imu", "tactical"]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A circle and an S turn of 80 s, as files; the logs' own noise is that of their options below."""
    folder = tmp_path_factory.mktemp("logs")
    motion = course(PLACE, LEGS, heading=0.7, speed=8.0)
    write_imu(
        simulate(ideal_log(motion, rate=50.0, duration=80.0), imu="tactical", seed=4).record, folder / "imu.parquet"
    )
    rng = np.random.default_rng(1)
    t = np.arange(0.5, 80.0, 0.5)
    at, n = motion.states(t), len(t)
    heading, pitch, roll = (np.degrees(x) for x in euler_from_dcm(at.C_nb))
    place = np.c_[np.degrees(at.lat), np.degrees(at.lon), at.alt]
    v = at.v_n + 0.05 * rng.standard_normal((n, 3))
    gnss = np.c_[t, place, v, (heading + 90.0 + 0.3 * rng.standard_normal(n)) % 360.0, np.full(n, 0.3)]
    save(folder / "gnss.csv", gnss, "time,lat,lon,alt,VE,VN,VU,heading,sigma_heading")
    save(folder / "plain.csv", gnss[:, :7], "time,lat,lon,alt,VE,VN,VU")
    body = np.einsum("kji,kj->ki", at.C_nb, at.v_n) + 0.02 * rng.standard_normal((n, 3))
    save(folder / "dvl.csv", np.c_[t, body], "time,v_right,v_forward,v_up")
    angles = np.c_[heading, pitch, roll] + 0.1 * rng.standard_normal((n, 3))
    save(
        folder / "ahrs.csv",
        np.c_[t, angles, place, at.v_n],
        "time,heading,pitch,roll,lat,lon,alt,VE,VN,VU",
    )
    B = earth_field(PLACE, 2025.5)
    m = np.einsum("kji,j->ki", at.C_nb, B) + np.linalg.norm(B) * (
        [0.05, -0.04, 0.02] + 0.005 * rng.standard_normal((n, 3))
    )
    save(folder / "mag.csv", np.c_[t, 1e6 * m], "time,mx,my,mz")  # uT, and nothing says so
    true = float(np.degrees(np.arctan2(*motion.states(np.array([80.0])).C_nb[0, :2, 1]))) % 360.0
    return folder, true


def save(path, rows, header):
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.10g")


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def off(result, true, code=0):
    """How many of its sigmas the heading is off, and the sigma in degrees."""
    assert result.exit_code == code, (result.output, result.exception)
    said = json.loads(result.stdout)
    return abs(math.remainder(said["heading_deg"] - true, 360.0)) / said["heading_sigma_deg"], said["heading_sigma_deg"]


BASELINE = ("--baseline", "90,0.5")
MAGNETOMETER = ("--date", "2025-07-01", "--magnetometer-iron", "5,1")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gnss", "more", "best"),
    [
        ("gnss.csv", BASELINE, 0.6),
        ("plain.csv", ("--magnetometer", "mag.csv", *MAGNETOMETER), 1.0),
        ("plain.csv", ("--attitude", "ahrs.csv", "--attitude-sigma", "0.1"), 0.2),
    ],
)
def test_align_and_navigate(files, gnss, more, best):
    folder, true = files
    more = [folder / x if x.endswith(".csv") else x for x in more]
    ratio, sigma = off(call("align", folder / "imu.parquet", "--gnss", folder / gnss, *IMU, *more, "--json"), true)
    assert ratio < 4.0
    assert sigma < best
    start = (
        "--heading",
        f"{math.degrees(0.7):.3f},5",
        "--position",
        "50,10,100",
        "--pitch",
        0,
        "--roll",
        0,
        "--speed",
        "8,0.3",
    )
    navigated = call("navigate", folder / "imu.parquet", *start, "--gnss", folder / gnss, *IMU, *more, "--json")
    ratio, sigma = off(navigated, true)
    assert ratio < 4.0
    assert sigma < best


def test_align_by_a_velocity_log(files):
    folder, true = files
    result = call(
        "align", folder / "imu.parquet", "--velocity", folder / "dvl.csv", "--lat", 50, "--lon", 10, *IMU, "--json"
    )
    said = json.loads(result.stdout)
    assert said["status"] == "not_converged"  # 80 s of tactical gyros tell no heading, and a log knows no north
    result = call("align", folder / "imu.parquet", "--velocity", folder / "dvl.csv", "--lat", 50, "--lon", 10, *IMU,
                  "--magnetometer", folder / "mag.csv", *MAGNETOMETER, "--json")  # fmt: skip
    ratio, sigma = off(result, true)
    assert ratio < 4.0
    assert sigma < 1.5


def test_a_start_from_a_row_of_a_master(files):
    folder, true = files
    known = ("--master", folder / "ahrs.csv", "--master-sigma", "0.15,0.15", *IMU, "--gnss", folder / "plain.csv")
    ratio, sigma = off(call("navigate", folder / "imu.parquet", *known, "--json"), true)
    assert ratio < 4.0
    assert sigma < 0.5


@pytest.mark.slow
def test_clocks_by_sensor(files, tmp_path):
    """A receiver and a magnetometer, each off by its own: corrected by name the answer is that of sound clocks to the bit."""
    folder = files[0]
    moved = []
    for name, by in (("plain.csv", 0.5), ("mag.csv", -2.0)):
        head, *rows = (folder / name).read_text().splitlines()
        cells = np.array([row.split(",") for row in rows], dtype=object)
        cells[:, 0] = [repr(float(t) + by) for t in cells[:, 0]]  # half seconds are exact
        (tmp_path / name).write_text("\n".join([head, *map(",".join, cells)]) + "\n")
        moved.append(tmp_path / name)

    def aligned(gnss, magnetometer, *more):
        sensors = ("--gnss", gnss, "--magnetometer", magnetometer, *MAGNETOMETER)
        return call("align", folder / "imu.parquet", *IMU, *sensors, *more, "--json")

    sound = json.loads(aligned(folder / "plain.csv", folder / "mag.csv").stdout)
    mended = json.loads(aligned(*moved, "--offset", "gnss=-0.5,magnetometer=2").stdout)
    assert mended["heading_deg"] == sound["heading_deg"]
    for offset, words in (
        ("odometer=1", "odometer is not given"),
        ("gnss=x", "expected 1 numbers"),
        ("1,gnss=2", "gnss is named twice"),
    ):
        result = aligned(*moved, "--offset", offset)
        assert isinstance(result.exception, UsageError)
        assert words in str(result.exception)


def test_a_receiver_that_counts_from_1970(files, tmp_path):
    """Its first fix gives the place of the magnetic field: that, too, is looked for by the clock that --offset corrects."""
    folder, date = files[0], 1585958400
    head, *rows = (folder / "plain.csv").read_text().splitlines()
    cells = [row.partition(",") for row in rows]
    dated = [f"{float(time) + date:.1f},{rest}" for time, _, rest in cells]
    (tmp_path / "plain.csv").write_text("\n".join([head, *dated]) + "\n")
    sensors = ("--gnss", tmp_path / "plain.csv", "--magnetometer", folder / "mag.csv", *MAGNETOMETER)
    refused = call("align", folder / "imu.parquet", *IMU, *sensors)
    assert isinstance(refused.exception, DataError)
    assert f"{-date} s added to the times of the aiding log" in str(refused.exception)
    mended = call("align", folder / "imu.parquet", *IMU, *sensors, "--offset", f"gnss={-date}", "--json")
    assert json.loads(mended.stdout)["status"] == "aligned"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("align", "--gnss", "plain.csv", "--magnetometer", "mag.csv"), "--date"),
        (("align", "--gnss", "plain.csv", "--attitude", "ahrs.csv"), "--attitude-sigma"),
        (("align", "--lat", "50", "--magnetometer", "mag.csv"), "belongs to --odometer or --gnss or --velocity"),
        (("align", "--velocity", "plain.csv", "--lat", "50"), "velocities in body axes"),
        (("navigate", "--master", "ahrs.csv"), "--master-sigma"),
        (
            ("navigate", "--master", "ahrs.csv", "--master-sigma", "1,1", "--heading", "1,1"),
            "without --start and --heading",
        ),
    ],
)
def test_what_is_refused(files, arguments, words):
    command, *more = arguments
    folder = files[0]
    more = [folder / x if x.endswith(".csv") else x for x in more]
    result = call(command, folder / "imu.parquet", *IMU, *more)
    assert isinstance(result.exception, UsageError)
    assert words in str(result.exception)


def test_a_magnetometer_in_no_unit(files, tmp_path):
    """A field that is the earth's in none, or in two, is asked for."""
    from truenorth import DataError, read_magnetometer

    rows = np.loadtxt(files[0] / "mag.csv", delimiter=",", skiprows=1)
    right = read_magnetometer(files[0] / "mag.csv").field
    for scale, unit in ((10.0, "mgauss"), (0.01, "gauss"), (1000.0, "nT"), (1e-6, "T")):
        save(tmp_path / "m.csv", np.c_[rows[:, 0], scale * rows[:, 1:]], "time,mx,my,mz")
        np.testing.assert_allclose(read_magnetometer(tmp_path / "m.csv").field, right, rtol=1e-6)
        np.testing.assert_allclose(read_magnetometer(tmp_path / "m.csv", units=f"mag={unit}").field, right, rtol=1e-6)
    save(tmp_path / "m.csv", np.c_[rows[:, 0], 3.0 * rows[:, 1:]], "time,mx,my,mz")
    with pytest.raises(DataError, match="name the unit"):
        read_magnetometer(tmp_path / "m.csv")


def test_a_heading_without_a_sigma_is_not_believed(files, tmp_path):
    """It is, in many a log, the course over ground."""
    from truenorth import read_gnss

    rows = np.loadtxt(files[0] / "gnss.csv", delimiter=",", skiprows=1)
    save(tmp_path / "g.csv", rows[:, :8], "time,lat,lon,alt,VE,VN,VU,heading")
    assert read_gnss(tmp_path / "g.csv").heading is None
    assert read_gnss(tmp_path / "g.csv", columns="heading=heading").heading is not None
    line = np.radians(rows[:, 7])
    flat = np.c_[rows[:, :4], 1.5 * np.sin(line), 1.5 * np.cos(line), np.zeros(len(rows))]
    save(tmp_path / "b.csv", flat, "time,lat,lon,alt,rel_pos_e,rel_pos_n,rel_pos_d")
    record = read_gnss(tmp_path / "b.csv")
    np.testing.assert_allclose(np.cos(record.heading - line), 1.0, atol=1e-12)
    np.testing.assert_allclose(record.heading_sigma, 0.01 / 1.5, rtol=1e-6)
