"""The command line as a person meets it: answers, exit codes, and one clear message for each kind of bad input."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.campaign.test_plan import PLAN, REST
from tests.helpers import run_command
from truenorth.cli.console import make_console
from truenorth.core.position import Position
from truenorth.formats import read_imu, write_imu
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(34.25, 108.9, 380.0)
WHERE = ["--lat", "34.25", "--lon", "108.9", "--alt", "380"]


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("logs") / "still.csv"
    motion = rest(PLACE, np.radians(77.0), 0.02, -0.01)
    write_imu(simulate(motion, rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=6).record, path)
    return path


def run(capsys, monkeypatch, *arguments) -> tuple[int, str, str]:
    code, out = run_command(capsys, monkeypatch, *arguments)
    return code, out.out, out.err


def test_json_is_one_object_with_the_documented_keys(capsys, monkeypatch, log):
    code, out, _ = run(capsys, monkeypatch, "align", log, *WHERE, "--imu", "navigation", "--json")
    assert code == 0
    found = json.loads(out)
    documented = (
        "status reasons method time_s pitch_deg roll_deg heading_deg pitch_sigma_deg roll_sigma_deg heading_sigma_deg "
        "heading_sigma_floor_deg gyro_bias_deg_h gyro_bias_sigma_deg_h accel_bias_ug accel_bias_sigma_ug"
    )
    assert set(documented.split()) <= set(found)
    assert found["status"] == "aligned"
    assert abs(found["heading_deg"] - 77.0) < 4 * found["heading_sigma_deg"] < 1.0
    assert found["time_s"] == 120.0


@pytest.mark.parametrize("method", ["auto", "analytic", "inertial", "oba", "kalman"])
def test_every_method_prints_json(capsys, monkeypatch, log, method):
    code, out, _ = run(capsys, monkeypatch, "align", log, *WHERE, "--method", method, "--json")
    assert code == 0
    assert json.loads(out)["method"] == ("kalman" if method == "auto" else method)


def test_results_are_written_and_named(capsys, monkeypatch, log, tmp_path):
    code, out, _ = run(capsys, monkeypatch, "align", log, *WHERE, "-o", tmp_path / "result")
    assert code == 0
    for name in ("summary.json", "history.parquet", "report.html"):
        assert (tmp_path / "result" / name).stat().st_size > 0
        assert name in out
    assert not list((tmp_path / "result").glob(".*"))


def test_window_and_epoch(capsys, monkeypatch, log):
    code, out, _ = run(capsys, monkeypatch, "align", log, *WHERE, "--from", 20, "--to", 90, "--at", 50, "--json")
    assert code == 0
    found = json.loads(out)
    assert found["time_s"] == 50.0
    assert found["duration_s"] == pytest.approx(70.05)


def _lines(log: Path) -> list[str]:
    return log.read_text().splitlines()


def _write(folder: Path, lines: list[str], name: str = "bad.csv") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def _with_cell(lines, line, column, text):
    cells = lines[line - 1].split(",")
    cells[column] = text
    return [*lines[: line - 1], ",".join(cells), *lines[line:]]


BAD = {
    "missing column": (lambda x: [",".join(row.split(",")[:-1]) for row in x], 3, ["dvel_z", "missing", "dvel_y"]),
    "text in a number": (lambda x: _with_cell(x, 11, 3, "abc"), 3, ["line 11", "dtheta_z", "'abc'"]),
    "NaN": (lambda x: _with_cell(x, 7, 1, "nan"), 3, ["line 7", "dtheta_x", "nan"]),
    "inf": (lambda x: _with_cell(x, 7, 5, "-inf"), 3, ["line 7", "dvel_y", "inf"]),
    "time going back": (lambda x: _with_cell(x, 100, 0, "1.0"), 3, ["line 100", "time", "goes back"]),
    "time that repeats": (
        lambda x: _with_cell([*x[:50], x[49], *x[50:]], 51, 1, "2e-5"),
        3,
        ["line 51", "time", "repeats"],
    ),
    "a gap": (lambda x: x[:500] + x[600:], 3, ["gap of 5.050 s", "row 500", "--from"]),
    "a short line": (lambda x: [*x[:20], "1,2", *x[20:]], 3, ["line 21", "2 columns"]),
    "3 rows": (lambda x: x[:4], 4, ["3 samples", "record longer"]),
    "a header alone": (lambda x: x[:1], 3, ["no rows"]),
}


@pytest.mark.parametrize("what", BAD)
def test_bad_logs_get_one_message(capsys, monkeypatch, log, tmp_path, what):
    spoil, expected_code, words = BAD[what]
    path = _write(tmp_path, spoil(_lines(log)))
    code, out, err = run(capsys, monkeypatch, "align", path, *WHERE)
    assert code == expected_code, err
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert "bad.csv" in err
    for word in words:
        assert word in err


def _scaled(log_path: Path, gyro: float, accel: float) -> ImuRecord:
    from truenorth.formats import read_imu

    record = read_imu(log_path)
    T = record.interval
    return ImuRecord(record.time, record.gyro / T * gyro, record.accel / T * accel, "rates")


def test_wrong_units_are_found(capsys, monkeypatch, log, tmp_path):
    path = tmp_path / "in_g.csv"
    write_imu(_scaled(log, 1.0, 1 / 9.80665), path)
    code, _, err = run(capsys, monkeypatch, "align", path, *WHERE)
    assert code == 3
    assert "in g" in err
    assert "in_g.csv" in err
    code, out, _ = run(capsys, monkeypatch, "align", path, *WHERE, "--units", "rad/s,g", "--json")
    assert code == 0
    assert json.loads(out)["status"] == "aligned"


def _in_degrees(log, path):
    write_imu(_scaled(log, np.degrees(1.0), 1.0), path)


def _in_frd(log, path):
    frd = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    write_imu(read_imu(log).rotated(frd), path)


@pytest.mark.parametrize(
    ("write", "named", "option"),
    [(_in_degrees, "deg/s", ("--units", "deg/s,m/s^2")), (_in_frd, "--axes FRD", ("--axes", "FRD"))],
    ids=["degrees a second", "axes"],
)
def test_wrong_units_and_axes_are_found(capsys, monkeypatch, log, tmp_path, write, named, option):
    path = tmp_path / "other.csv"
    write(log, path)
    code, _, err = run(capsys, monkeypatch, "align", path, *WHERE)
    assert code == 3
    assert named in err
    code, out, _ = run(capsys, monkeypatch, "align", path, *WHERE, *option, "--json")
    assert code == 0
    assert abs(json.loads(out)["heading_deg"] - 77.0) < 1.0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--lat", "95"], ["latitude 95", "-90 to 90"]),
        (["--lat", "34", "--alt", "4e5"], ["height"]),
        (["--lat", "34", "--imu", "rocket"], ["rocket", "navigation"]),
        (["--lat", "34", "--method", "magic"], ["magic", "kalman"]),
        (["--lat", "34", "--axes", "FFD"], ["FFD"]),
        (["--lat", "34", "--units", "deg/s,deg"], ["deg"]),
        (["--lat", "34", "--kind", "counts"], ["counts", "increments"]),
        (["--lat", "34", "--at", "500"], ["500", "0.05"]),
        (["--lat", "34", "--heading-limit", "-1"], ["heading limit"]),
    ],
)
def test_wrong_usage_is_exit_code_2(capsys, monkeypatch, log, arguments, words):
    code, _, err = run(capsys, monkeypatch, "align", log, *arguments)
    assert code == 2, err
    for word in words:
        assert word in err


def test_missing_file_and_missing_latitude(capsys, monkeypatch, log):
    code, _, err = run(capsys, monkeypatch, "align", "nowhere.csv", *WHERE)
    assert code == 2
    assert "no such file" in err.lower()
    code, _, err = run(capsys, monkeypatch, "align", log)
    assert code == 2
    assert "--lat" in err


def test_empty_file_and_misnamed_file(capsys, monkeypatch, log, tmp_path):
    empty = tmp_path / "empty.csv"
    empty.touch()
    code, _, err = run(capsys, monkeypatch, "align", empty, *WHERE)
    assert (code, "empty" in err) == (3, True)
    from truenorth.formats import read_imu

    parquet = tmp_path / "log.parquet"
    write_imu(read_imu(log), parquet)
    misnamed = parquet.rename(tmp_path / "log.csv")
    code, _, err = run(capsys, monkeypatch, "align", misnamed, *WHERE)
    assert code == 3
    assert "parquet" in err
    text = tmp_path / "text.parquet"
    text.write_bytes(log.read_bytes())
    code, _, err = run(capsys, monkeypatch, "align", text, *WHERE)
    assert code == 3


def test_a_folder_that_cannot_be_written_is_shown_before_the_work(capsys, monkeypatch, log, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file where a folder is wanted")
    code, _, err = run(capsys, monkeypatch, "align", log, *WHERE, "-o", blocked)
    assert code == 2
    assert "blocked" in err


def test_a_file_that_is_no_specification_names_key_and_fix(capsys, monkeypatch, log, tmp_path):
    spec = tmp_path / "imu.yaml"
    spec.write_text("gyro: {bias: 0.01 deg/sqrt(h)}\n")
    code, _, err = run(capsys, monkeypatch, "align", log, *WHERE, "--imu", spec)
    assert code == 3
    for word in ("imu.yaml", "gyro.bias", "deg/h"):
        assert word in err


def test_inspect(capsys, monkeypatch, log, tmp_path):
    code, out, _ = run(capsys, monkeypatch, "inspect", log, "--lat", 34.25, "--json")
    assert code == 0
    assert json.loads(out)["motion"]["overall"] == "still"
    code, out, _ = run(capsys, monkeypatch, "inspect", log, "--plot", tmp_path / "log.png")
    assert code == 0
    assert (tmp_path / "log.png").stat().st_size > 10_000
    assert "Hz" in out


def test_a_layout_under_a_name_of_ones_own(capsys, monkeypatch, log, tmp_path):
    own, named = tmp_path / "day1.csv", tmp_path / "day2.yaml"
    shutil.copy(log, own)
    code, out, _ = run(capsys, monkeypatch, "inspect", own, "--write-layout", named)
    assert (code, named.is_file(), own.with_suffix(".yaml").exists()) == (0, True, False)
    assert "day2.yaml" in out
    code, _, err = run(capsys, monkeypatch, "inspect", own, "--write-layout", named)
    assert code == 2
    assert "day2.yaml: is there already and is kept" in err
    assert "--force" in err
    named.write_text("spoilt")
    assert run(capsys, monkeypatch, "inspect", own, "--force", "--write-layout", named)[0] == 0
    assert "spoilt" not in named.read_text()
    # The word behind the option may be the log.
    assert run(capsys, monkeypatch, "inspect", "--write-layout", own)[0] == 0
    assert own.with_suffix(".yaml").read_text() == named.read_text()
    code, _, err = run(capsys, monkeypatch, "inspect", own, "--write-layout=day.txt")
    assert code == 2
    assert ".yaml" in err


def test_lines_are_whole_where_no_terminal_reads_them(capsys, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    make_console().print(" ".join(["word"] * 60))
    assert len(capsys.readouterr().out.splitlines()) == 1
    monkeypatch.setenv("COLUMNS", "80")
    make_console().print(" ".join(["word"] * 60))
    assert len(capsys.readouterr().out.splitlines()) == 4


def test_near_the_vertical_the_combination_is_said_with_its_floor(capsys, monkeypatch, tmp_path):
    path = tmp_path / "up.csv"
    motion = rest(PLACE, np.radians(77.0), np.radians(89.0))
    write_imu(simulate(motion, rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=6).record, path)
    code, out, _ = run(capsys, monkeypatch, "align", path, *WHERE, "--imu", "navigation")
    assert code == 0
    row = next(line for line in out.splitlines() if line.startswith("heading minus roll"))
    value, sigma, floor = map(float, row.split()[3:])
    assert abs(value - 77.0) < 4 * sigma < 1.0
    assert 0.0 < floor <= sigma


def test_help_shows_examples(capsys, monkeypatch):
    for command in ("align", "inspect"):
        code, out, _ = run(capsys, monkeypatch, command, "--help")
        assert code == 0
        assert "Examples" in out
        assert f"truenorth {command} log.csv" in out


def test_a_refused_alignment_is_exit_code_4_and_still_json(capsys, monkeypatch, log):
    arguments = ["align", log, "--lat", "10", "--imu", "navigation", "--json"]
    code, out, _ = run(capsys, monkeypatch, *arguments)
    assert code == 4
    assert json.loads(out)["status"] == "inconsistent"


def start(folder: Path, *arguments: str, **options) -> subprocess.Popen:
    code = "from truenorth.cli import main; main()"
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], cwd=folder, **pipes, **options)


INPUTS = {
    "align a history": (["align", "history.parquet", *WHERE, "-o", "."], "history.parquet"),
    "simulate a scenario": (["simulate", "scenario.yaml", "-o", "."], "scenario.yaml"),
    "a campaign's plan": (["campaign", "plan.yaml", "-o", "."], "plan.yaml"),
}


@pytest.mark.parametrize("case", INPUTS)
def test_no_command_writes_over_its_input(capsys, monkeypatch, log, tmp_path, case):
    arguments, name = INPUTS[case]
    monkeypatch.chdir(tmp_path)
    write_imu(read_imu(log), tmp_path / "history.parquet")
    (tmp_path / "scenario.yaml").write_text(yaml.safe_dump(REST))
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    before = (tmp_path / name).read_bytes()
    code, _, err = run(capsys, monkeypatch, *arguments)
    assert (tmp_path / name).read_bytes() == before
    assert code == 2
    assert "is an input of the command" in err


@pytest.mark.slow
def test_a_result_of_another_kind_is_not_overwritten_unless_forced(capsys, monkeypatch, log, tmp_path):
    out = tmp_path / "start"
    assert run(capsys, monkeypatch, "align", log, *WHERE, "--imu", "navigation", "-o", out)[0] == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    for arguments in (
        ["navigate", log, "--start", out, "-o", out],
        ["advise", "--lat", "40", "--imu", "navigation", "--heading", "1", "-o", out],
        ["simulate", "quay", f"--output={out}"],
    ):
        code, _, err = run(capsys, monkeypatch, *arguments)
        assert code == 2
        assert "Alignment" in err
        assert "--force" in err
        assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    advised = ["advise", "--lat", "40", "--imu", "navigation", "--heading", "1", "-o", out]
    assert run(capsys, monkeypatch, *advised, "--force")[0] in (0, 4)
    assert run(capsys, monkeypatch, "align", log, *WHERE, "--imu", "navigation", "-o", out, "--force")[0] == 0
    assert run(capsys, monkeypatch, "align", log, *WHERE, "--imu", "navigation", "-o", out)[0] == 0  # of the same kind


def test_brackets_in_names_are_no_markup(capsys, monkeypatch, log, tmp_path):
    odd = tmp_path / "run[red]1.csv"
    odd.write_bytes(log.read_bytes())
    folder = tmp_path / "out[" / "b]"  # "[/b]" would close a tag that was never opened
    code, out, _ = run(capsys, monkeypatch, "align", odd, *WHERE, "-o", folder)
    assert code == 0
    assert "run[red]1.csv" in out
    assert f"wrote {folder / 'report.html'}" in out
    code, out, _ = run(capsys, monkeypatch, "inspect", odd)
    assert code == 0
    assert "run[red]1.csv" in out


@pytest.mark.slow
def test_a_terminal_without_plus_minus_still_gets_the_answer(log, tmp_path):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    process = start(tmp_path, "align", str(log), *WHERE, env=environment)
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert "heading" in out


def test_messages_leave_the_json_alone(capsys, monkeypatch, log):
    """The latitude warning goes to standard error; standard output is one object on one line."""
    code, out, err = run(capsys, monkeypatch, "align", log, "--lat", "10", "--imu", "navigation", "--json")
    assert code == 4
    assert err.startswith("truenorth: warning: ")
    assert "latitude" in err
    assert len(out.splitlines()) == 1
    assert json.loads(out)["lat_deg"] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--plot", "log.txt"], ["--plot log.txt", ".png"]),
        (["--lat", "95"], ["latitude 95"]),
        (["--from", "50", "--to", "20"], ["--from 50 --to 20"]),
        (["--to", "nan"], ["--to nan"]),
    ],
)
def test_wrong_usage_of_inspect(capsys, monkeypatch, log, arguments, words):
    code, out, err = run(capsys, monkeypatch, "inspect", log, *arguments)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1
    for word in words:
        assert word in err


def test_a_folder_named_as_the_command_or_as_what_is_shipped_is_no_input(tmp_path, monkeypatch):
    from truenorth.cli.files import inputs

    monkeypatch.chdir(tmp_path)
    for name in ("align", "static", "rows"):
        (tmp_path / name).mkdir()
    assert list(inputs(["align", "rows", "--lat", "1", "-o", "align"])) == ["rows", "--lat", "1"]
    assert list(inputs(["reproduce", "static", "-o", "static"])) == []
