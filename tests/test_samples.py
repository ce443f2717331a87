"""The sample recordings: small, licensed, and each aligned by the command that its writer names."""

import shlex

import numpy as np
import pytest

from tests.runs import some
from truenorth.cli.example import COMMANDS
from truenorth.core.errors import UsageError
from truenorth.formats import read_gnss, read_imu, read_master
from truenorth.formats.samples import DATA, SAMPLES, write_sample


def test_they_are_small_and_say_whose_they_are():
    assert {path.stem for path in DATA.glob("*.npz")} == set(SAMPLES)
    assert all(path.stat().st_size < 400_000 for path in DATA.glob("*.npz"))
    text = (DATA / "README.md").read_text()
    assert "Copyright (c) Gongmin Yan" in text
    assert all(f"`{name}.npz`" in text for name in SAMPLES)


@pytest.mark.parametrize("name", some([name for name in SAMPLES if name != "transfer"], ["transfer"]))
def test_the_command_that_is_named_aligns_the_sample(name, tmp_path, monkeypatch, capsys):
    from truenorth.cli import app

    write_sample(name, tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        app(shlex.split(COMMANDS[name])[1:])
    out = capsys.readouterr().out
    assert stop.value.code == 0, out
    assert out.startswith(("aligned", "level_only"))
    with pytest.raises(UsageError, match="is there already"):
        write_sample(name, tmp_path)


def test_the_logs_hold_what_their_names_say(tmp_path):
    write_sample("fog", tmp_path)
    write_sample("transfer", tmp_path)
    gnss, imu = read_gnss(tmp_path / "gnss.csv"), read_imu(tmp_path / "drive.csv")
    assert imu.kind == "increments"
    np.testing.assert_allclose(np.degrees(gnss.lat), 34.0256, atol=0.01)
    master = read_master(tmp_path / "master.csv")
    assert np.median(np.linalg.norm(master.v_n, axis=1)) > 10.0


def test_another_name(tmp_path):
    with pytest.raises(UsageError, match="choose one of rlg, fog, transfer"):
        write_sample("mems", tmp_path)


def test_samples_are_listed():
    from typer.testing import CliRunner

    from truenorth.cli import app
    from truenorth.formats.samples import SAMPLES

    listed = CliRunner().invoke(app, ["example"])
    assert listed.exit_code == 0
    assert [line.partition(":")[0] for line in listed.output.splitlines()] == list(SAMPLES)
