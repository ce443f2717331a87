"""Files and folders whose names are no UTF-8: results are written, and the name is shown."""

import os
import shutil
import sys
from pathlib import Path

import pandas as pd
import pytest

import truenorth
from tests import test_cli
from tests.helpers import run_command
from truenorth import __main__ as last_resort
from truenorth.core.arrow import words
from truenorth.live.journal import Parts
from truenorth.report.document import packed

WHERE, log = test_cli.WHERE, test_cli.log
NAME = os.fsdecode(b"tr\xe9s")


@pytest.fixture
def folder(tmp_path) -> Path:
    try:
        (tmp_path / NAME).mkdir()
    except OSError:  # macOS
        pytest.skip("this file system has names in UTF-8 only")
    return tmp_path / NAME


def test_align_writes_into_such_a_folder_and_of_such_a_log(log, folder, capsys, monkeypatch):
    strange = folder / f"{NAME}.csv"
    shutil.copy(log, strange)
    code, out = run_command(
        capsys, monkeypatch, "align", str(strange), *WHERE, "--imu", "navigation", "-o", str(folder)
    )
    assert code == 0, out.err
    assert r"tr\udce9s" in (folder / "report.html").read_text(encoding="utf-8")
    assert len(pd.read_parquet((folder / "history.parquet").open("rb")))
    assert truenorth.load(folder).source == strange.name


def test_navigate_and_simulate_write_into_such_a_folder(log, folder, capsys, monkeypatch):
    begun = str(folder / "start")
    run_command(capsys, monkeypatch, "align", str(log), *WHERE, "--imu", "navigation", "--at", "60", "-o", begun)
    code, out = run_command(capsys, monkeypatch, "navigate", str(log), "--start", begun, "-o", str(folder))
    assert code == 0, out.err
    assert {"track.parquet", "innovations.parquet", "report.html"} <= {path.name for path in folder.iterdir()}
    target = folder / "simulated"
    code, out = run_command(capsys, monkeypatch, "simulate", "static_kalman", "-o", str(target), "--no-plot")
    assert code == 0, out.err
    code, out = run_command(capsys, monkeypatch, "inspect", str(target / "imu.parquet"))
    assert code == 0, out.err


def test_a_live_run_keeps_its_parts_in_such_a_folder(folder):
    parts = Parts(folder)
    parts.write(pd.DataFrame({"time": [1.0, 2.0]}))
    assert [path.name for path in parts.paths] == ["000001.parquet"]


def test_a_name_may_stand_in_a_page_s_data_and_in_a_column():
    assert words([NAME]).to_pylist() == [r"tr\udce9s"]
    assert packed(NAME)


def test_the_last_resort_writes_such_a_name(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["truenorth", "align", NAME])
    assert "please report them" in last_resort._details()
    (details,) = tmp_path.iterdir()
    assert r"align tr\udce9s" in details.read_text(encoding="utf-8")
