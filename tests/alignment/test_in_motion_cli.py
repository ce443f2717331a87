"""`truenorth align` on the move, from the shell."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from truenorth.cli import app
from truenorth.core.errors import UsageError
from truenorth.formats import write_imu, write_record
from truenorth.simulation.scenario import read_scenario


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Four minutes on the ring, as files."""
    folder = tmp_path_factory.mktemp("drive")
    ring = read_scenario({**read_scenario("odometer_ring").to_mapping(), "duration": "240 s"})
    write_imu(ring.simulate(seed=4).record, folder / "imu.csv")
    write_record(ring.simulate_aiding(seed=4)["odometer"].record, folder / "odo.csv")
    return folder


def call(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def test_align_and_go_on(files, tmp_path):
    log, odometer = files / "imu.csv", files / "odo.csv"
    common = ["--odometer", odometer, "--lat", 39.9, "--alt", 50, "--imu", "navigation"]
    result = call("align", log, *common, "--to", 120, "-o", tmp_path / "start", "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert said["status"] == "aligned"
    assert said["heading_from"] == "the earth's rate"
    assert said["odometer_scale_sigma"] < 1e-3
    assert said["heading_sigma_deg"] < 1.0
    more = ["--odometer", odometer, "--estimate", "scale", "--to", 160, "--json"]
    track = call("navigate", log, "--start", tmp_path / "start", *more)
    assert track.exit_code == 0, track.output
    printed = call("align", log, *common, "--to", 40)
    assert "heading of the vehicle" in printed.stdout
    assert "odometer: scale" in printed.stdout


@pytest.mark.slow
def test_a_drive_of_unknown_latitude(files):
    unplaced = call(
        "align", files / "imu.csv", "--odometer", files / "odo.csv", "--imu", "navigation", "--to", 150, "--json"
    )
    assert unplaced.exit_code == 0, unplaced.output
    assert "the latitude was not given: found from the log" in unplaced.stdout


@pytest.mark.slow
def test_navigation_takes_the_wheel_over(files, tmp_path):
    """Pulses are 2 % shorter than given: the alignment finds it, and navigation takes it from there."""
    log, odometer = files / "imu.csv", tmp_path / "odo.csv"
    head, *rows = (files / "odo.csv").read_text().splitlines()
    size = head.split(",").index("pulse_size")
    changed = [[*row.split(",")[:size], f"{1.02 * float(row.split(',')[size]):.6f}"] for row in rows]
    odometer.write_text("\n".join([head, *(",".join(row) for row in changed)]) + "\n")
    common = ["--odometer", odometer, "--lat", 39.9, "--lon", 116.3, "--alt", 50, "--imu", "navigation"]
    result = call("align", log, *common, "--to", 200, "-o", tmp_path / "start", "--json")
    assert json.loads(result.stdout)["odometer_scale"] == pytest.approx(0.02, abs=0.004)
    truth = read_scenario("odometer_ring").ideal().motion.states(np.array([240.0]))

    def speed_off(*options):
        track = call("navigate", log, "--start", tmp_path / "start", "--odometer", odometer, "--json", *options)
        assert track.exit_code == 0, track.output
        said = json.loads(track.stdout)
        return np.hypot(*said["v_n_m_s"][:2]) / np.hypot(*truth.v_n[0, :2]) - 1.0, said["reasons"]

    for options in ([], ["--odometer-noise", "0.1"]):
        off, reasons = speed_off(*options)
        assert abs(off) < 0.004
        assert any("are the alignment's" in reason for reason in reasons)
        assert not any("warning" in reason for reason in reasons)
    # Given how it sits: how it counts is as found.
    off, reasons = speed_off("--mounting", "0,0,0")
    assert abs(off) < 0.004
    assert not any("warning" in reason for reason in reasons)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--lat", "39.9"], "--imu navigation"),
        (["--imu", "navigation", "--lat", "39.9", "--at", "50"], "cut the log with --to"),
        (["--imu", "navigation", "--lat", "39.9", "--method", "oba"], "gyrocompass"),
        (["--imu", "navigation", "--lat", "39.9", "--mounting-sigma", "0"], "--mounting-sigma"),
        (["--imu", "navigation", "--lat", "39.9", "--latency", "0.1"], "belongs to --gnss"),
    ],
)
def test_wrong_usage(files, arguments, words):
    result = call("align", files / "imu.csv", "--odometer", files / "odo.csv", *arguments)
    assert isinstance(result.exception, UsageError)
    assert words in str(result.exception)
