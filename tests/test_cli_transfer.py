"""`truenorth align --master` from the shell: the real recording, its options and its messages."""

import json
import re

import pandas as pd
import pytest
from typer.testing import CliRunner

from tests import recordings
from truenorth.cli import app


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    slave, master = recordings.transfer_fog_mems()
    folder = tmp_path_factory.mktemp("transfer")
    slave.to_frame().to_csv(folder / "slave.csv")
    master.to_frame().to_csv(folder / "master.csv")
    return str(folder / "slave.csv"), str(folder / "master.csv")


def test_a_slave_against_its_master(logs):
    slave, master = logs
    result = CliRunner().invoke(app, ["align", slave, "--master", master, "--delay", "10 ms,20 ms", "--json"])
    assert result.exit_code == 0, result.output
    summary = json.loads(result.stdout)
    assert summary["status"] == "aligned"
    assert 10 < summary["delay_ms"] < 20
    assert abs(summary["mounting_deg"][0] - 0.293) < 0.15


def test_what_a_person_reads(logs):
    slave, master = logs
    result = CliRunner().invoke(
        app, ["align", slave, "--master", master, "--matching", "both", "--lever-arm-sigma", "0"]
    )
    assert result.exit_code == 0, result.output
    found = re.search(r"mounting, deg: heading ([\d.]+) ± ([\d.]+)", result.stdout)
    assert found, result.stdout
    assert float(found[1]) == pytest.approx(
        0.293, abs=3.0 * float(found[2])
    )  # as the makers of the recording calibrated it
    assert float(found[2]) < 0.05
    assert "right 0 (as given)" in result.stdout
    assert "left open by this motion" in result.stdout


@pytest.mark.slow
def test_sigma_is_absolute_where_the_master_s_own_errors_are_given(logs):
    slave, master = logs
    found = {}
    for options in ((), ("--master-sigma", "tactical"), ("--master-sigma", "heading=1 deg,level=1 deg")):
        result = CliRunner().invoke(app, ["align", slave, "--master", master, "--json", *options])
        assert result.exit_code in (0, 3), result.output
        found[options] = json.loads(result.stdout)
    alone, tactical, poor = found.values()
    assert alone["sigma_is"] == "relative to the master"
    assert tactical["sigma_is"] == poor["sigma_is"] == "absolute"
    # A master without errors of velocity shows the slave's heading by its accelerations, however poor its own heading is.
    assert alone["heading_sigma_deg"] < 0.9 * min(tactical["heading_sigma_deg"], poor["heading_sigma_deg"])
    assert poor["heading_sigma_deg"] < 1.0
    result = CliRunner().invoke(app, ["align", slave, "--master", master, "--master-sigma", "tactical"])
    assert "sigma is absolute" in result.stdout


@pytest.mark.slow
def test_another_time_base_and_what_is_not_seen(logs, tmp_path):
    """A delay of more than an hour keeps the digits that its sigma has; what velocity does not see is not "as given"."""
    slave, master = logs
    late = pd.read_csv(master)
    late["time"] += 5000.0
    late.to_csv(tmp_path / "late.csv", index=False)
    result = CliRunner().invoke(app, ["align", slave, "--master", str(tmp_path / "late.csv")])
    assert result.exit_code == 0, result.output
    assert re.search(r"delay, ms: 50000\d\d\.\d+ ± 0\.", result.stdout)
    result = CliRunner().invoke(app, ["align", slave, "--master", master, "--matching", "velocity"])
    assert "mounting, deg: not seen by velocity matching" in result.stdout


def test_bad_options(logs):
    slave, master = logs

    def message(*options):
        result = CliRunner().invoke(app, ["align", slave, *options])
        assert result.exit_code != 0
        return f"{result.output} {result.exception}"

    assert "--lat" in message()
    assert "expected 3 numbers" in message("--master", master, "--mounting", "1,2")
    assert "such as '3 arcmin,5 s'" in message("--master", master, "--flexure", "3 arcmin")
    assert "choose one of" in message("--master", master, "--matching", "place")
