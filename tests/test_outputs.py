"""Nothing that a person has is written over without being asked for: what a command reads, other results, other files."""

import json
import shutil

import pytest
import yaml

import truenorth
from tests.campaign.test_plan import PLAN, REST
from tests.helpers import run_command
from tests.test_faulty_disk import PLACE, contents, record_of
from truenorth.formats import write_imu

WHERE = ["--lat", "45", "--lon", "10", "--imu", "navigation"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A log, and the folder of its alignment."""
    folder = tmp_path_factory.mktemp("made")
    write_imu(record_of(1), folder / "log.parquet")
    truenorth.save(truenorth.align(record_of(1).between(None, 30.0), PLACE, "navigation"), folder / "start")
    return folder


def refused(capsys, monkeypatch, folder, *words):
    """A message of one line, and the folder as it was but for empty folders and a lock."""
    before = contents(folder)
    before.pop(".lock", None)
    code, said = run_command(capsys, monkeypatch, *words)
    assert code == 2, said.err
    assert len(said.err.strip().splitlines()) == 1
    assert "--force" in said.err or "is an input of the command" in said.err
    assert {name: text for name, text in contents(folder).items() if name != ".lock"} == before


@pytest.mark.parametrize("source", ["replay:{}", "replay:{}@max", "follow:{}"])
def test_the_log_of_a_live_source(source, made, tmp_path, capsys, monkeypatch):
    log = tmp_path / "history.parquet"
    shutil.copy(made / "log.parquet", log)
    refused(capsys, monkeypatch, tmp_path, "live", source.format(log), *WHERE, "-o", tmp_path)


def test_a_scenario_of_a_plan_and_a_specification_of_a_scenario(tmp_path, capsys, monkeypatch):
    for name in ("plan.yaml", "summary.json"):
        (tmp_path / name).write_text(json.dumps(REST))
    (tmp_path / "mine.yaml").write_text(json.dumps(PLAN | {"scenarios": ["plan.yaml"]}))
    refused(capsys, monkeypatch, tmp_path, "campaign", tmp_path / "mine.yaml", "-o", tmp_path, "--workers", "1")
    (tmp_path / "mine.yaml").write_text(json.dumps(REST | {"imu": "scenario.yaml"}))
    (tmp_path / "scenario.yaml").write_text("gyro: {bias: 1 deg/h}\naccel: {bias: 1 mg}\n")
    refused(capsys, monkeypatch, tmp_path, "simulate", tmp_path / "mine.yaml", "-o", tmp_path)


def test_what_is_read_within_a_result_of_the_same_kind(tmp_path, capsys, monkeypatch):
    """The folder may be written to, but not what the scenario in it is made of."""
    (tmp_path / "scenario.yaml").write_text("gyro: {bias: 1 deg/h}\naccel: {bias: 1 mg}\n")
    (tmp_path / "truth.csv").write_text("")
    (tmp_path / "mine.yaml").write_text(json.dumps(REST | {"imu": "scenario.yaml", "duration": "5 s"}))
    refused(capsys, monkeypatch, tmp_path, "simulate", tmp_path / "mine.yaml", "-o", tmp_path)


@pytest.mark.parametrize("count", [["--runs", "2"], ["--runs=1", "--run", "1"]])
def test_folders_of_runs(count, made, tmp_path, capsys, monkeypatch):
    """Another kind of result, somebody's own file, or a scenario that is read, in a later run's folder: no run is written."""
    (tmp_path / "mine.yaml").write_text(json.dumps(REST | {"duration": "5 s"}))
    words = ["simulate", tmp_path / "mine.yaml", *count, "--no-plot", "-o"]
    shutil.copytree(made / "start", tmp_path / "kind" / "run_0001")
    (tmp_path / "own" / "run_0001").mkdir(parents=True)
    (tmp_path / "own" / "run_0001" / "scenario.yaml").write_text("mine: 1")
    (tmp_path / "log" / "run_0001").mkdir(parents=True)
    (tmp_path / "log" / "run_0001" / "imu.parquet").write_text("")
    for name in ("kind", "own", "log"):
        refused(capsys, monkeypatch, tmp_path, *words, tmp_path / name)
    code, said = run_command(capsys, monkeypatch, *words, tmp_path / "runs")
    assert code == 0, said.err
    words[1] = tmp_path / "runs" / "run_0001" / "scenario.yaml"
    refused(capsys, monkeypatch, tmp_path, *words, tmp_path / "runs")
    words[1] = tmp_path / "mine.yaml"
    code, said = run_command(capsys, monkeypatch, *words, tmp_path / "runs")
    assert code == 0, said.err  # of the same kind: replaced
    code, said = run_command(
        capsys, monkeypatch, "simulate", words[1], "--runs", "1", "--no-plot", "-o", tmp_path / "own"
    )
    assert code == 0, said.err  # run 0 alone: run_0001 stays as it is
    assert (tmp_path / "own" / "run_0001" / "scenario.yaml").read_text() == "mine: 1"


@pytest.mark.parametrize("option", ["-o {}", "-o{}", "--output {}", "--output={}", "-o elsewhere -o {}"])
def test_a_folder_with_a_result_of_another_kind_by_any_spelling(option, made, tmp_path, capsys, monkeypatch):
    shutil.copytree(made / "start", tmp_path / "start")
    words = option.format(tmp_path / "start").split()
    refused(capsys, monkeypatch, tmp_path, "navigate", made / "log.parquet", "--start", tmp_path / "start", *words)


OTHERS = {  # a file that stands in the folder, and the words of a command that would write one of that name
    "align": ("summary.json", ["align", "{log}", *WHERE]),
    "noise": ("imu.yaml", ["noise", "{log}"]),
    "simulate": ("imu.parquet", ["simulate", "{scenario}"]),
    "campaign": ("summary.csv", ["campaign", "{plan}", "--workers", "1"]),
    "reproduce": ("figures.csv", ["reproduce", "networks"]),
    "faults": ("faults.md", ["faults", "--procedure", "still", "--fault", "none", "--runs", "1"]),
    "advise": ("advice.png", ["advise", "--lat", "45", "--imu", "navigation", "--heading", "0.1"]),
    "example": ("log.csv", ["example", "rlg"]),
}


@pytest.mark.parametrize("command", OTHERS)
def test_a_file_of_somebody_else(command, made, tmp_path, capsys, monkeypatch):
    name, words = OTHERS[command]
    files = {"log": made / "log.parquet", "scenario": tmp_path / "s.yaml", "plan": tmp_path / "p.yaml"}
    files["scenario"].write_text(yaml.safe_dump(REST | {"duration": "5 s"}))
    files["plan"].write_text(yaml.safe_dump(PLAN))
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / name).write_text("years of work")
    if command == "example":
        code, said = run_command(capsys, monkeypatch, *words, "-o", mine)
        assert (code, "is there already" in said.err) == (2, True)
        return
    refused(capsys, monkeypatch, mine, *(word.format(**files) for word in words), "-o", mine)


def test_a_result_of_the_same_kind_is_replaced_and_anything_by_force(made, tmp_path, capsys, monkeypatch):
    words = ["align", made / "log.parquet", *WHERE, "-o", tmp_path]
    (tmp_path / "summary.json").write_text("years of work")
    for extra, expected in (([], 2), (["--force"], 0), ([], 0)):
        assert run_command(capsys, monkeypatch, *words, *extra)[0] == expected
