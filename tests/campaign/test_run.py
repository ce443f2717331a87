"""Campaigns: the same numbers wherever they are worked out; nothing lost, nothing twice."""

import json
import os
import re
import sys

import numpy as np
import pandas as pd
import pytest
import yaml
from typer.testing import CliRunner

from tests.campaign.test_plan import PLAN, REST
from tests.runs import few_and_all, some
from truenorth.campaign import outcomes, read_campaign, read_plan, read_table, run_campaign
from truenorth.campaign.bound import bounds
from truenorth.campaign.store import Block, Store, opened
from truenorth.cli import app
from truenorth.cli.campaign import pace
from truenorth.core.errors import DataError, UsageError


def test_every_run_of_every_method_is_there_once(undisturbed):
    table = undisturbed.table
    assert len(table[table["quantity"] == "outcome"]) == 6 * 2
    assert not table.duplicated(["case", "method", "run", "time_s", "quantity"]).any()
    assert set(table["quantity"]) >= {
        "outcome",
        "phi_e",
        "phi_n",
        "phi_u",
        "level",
        "nees",
        "gyro_bias_x",
        "accel_bias_z",
    }


def test_a_shard_is_plain_parquet(undisturbed):
    shard = sorted((undisturbed.folder / "runs").iterdir())[0]
    assert shard.name == "case0000_run000000-000001.parquet"
    assert list(pd.read_parquet(shard).columns)[:4] == ["case", "method", "run", "time_s"]


@pytest.mark.slow
def test_processes_give_the_bits_of_one_process(undisturbed, tmp_path):
    pd.testing.assert_frame_equal(run_campaign(PLAN, tmp_path, workers=2).table, undisturbed.table, check_exact=True)


def test_blocks_do_not_change_the_numbers(undisturbed, tmp_path):
    pd.testing.assert_frame_equal(
        run_campaign(PLAN | {"block": 5}, tmp_path).table, undisturbed.table, check_exact=True
    )


def test_more_runs_are_added_to_those_that_are_there(undisturbed, tmp_path):
    run_campaign(PLAN | {"runs": 3}, tmp_path)
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "runs").iterdir()}
    more = run_campaign(PLAN, tmp_path)
    pd.testing.assert_frame_equal(more.table, undisturbed.table, check_exact=True)
    after = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "runs").iterdir()}
    assert before.items() <= after.items()


def test_what_is_missing_is_worked_out_in_blocks(tmp_path):
    store = Store(tmp_path)
    store.runs.mkdir()
    for name in ("case0000_run000002-000003.parquet", "case0001_run000000-000009.parquet", ".case0001.5.part.parquet"):
        (store.runs / name).touch()
    assert store.missing(2, 12, 5) == [
        Block(0, 0, 1),
        Block(0, 4, 4),
        Block(0, 5, 9),
        Block(0, 10, 11),
        Block(1, 10, 11),
    ]


def test_methods_meet_the_same_data_and_points_of_the_grid_the_same_draws(tmp_path):
    """Twice the bias sigma: the bias that is drawn, here the error of a method that does not estimate it, is twice as large."""
    grid = {"imu.gyro.bias": ["0.01 deg/h", "0.02 deg/h"]}
    table = run_campaign(PLAN | {"grid": grid}, tmp_path).table
    bias = table[table["quantity"] == "gyro_bias_x"].pivot_table(
        index="run", columns=["case", "method"], values="value"
    )
    np.testing.assert_allclose(bias[(1, "oba")], 2 * bias[(0, "oba")], rtol=1e-12)
    np.testing.assert_array_equal(bias[(0, "oba")], bias[(0, "inertial")])


def test_a_run_that_fails_is_a_row_with_its_reason(tmp_path):
    short = REST | {"duration": "0.5 s"}
    table = run_campaign(PLAN | {"scenarios": [short, REST], "methods": ["oba"]}, tmp_path).table
    ends = outcomes(table)
    assert list(ends["runs"]) == [6, 6]
    assert ends["status"][0] == "failed"
    assert "AlignmentError" in ends["reason"][0]
    assert ends["status"][1] == "aligned"


@pytest.mark.slow
@pytest.mark.parametrize("others", [[], [REST]], ids=["alone", "with a good one"])
def test_a_scenario_that_cannot_be_is_rows_and_does_not_spoil_the_report(tmp_path, others):
    """What is wrong with the motion shows when it is built, after the plan has been read."""
    impossible = REST | {"motion": {"kind": "legs", "legs": [{"kind": "turn", "angle": "9 deg", "rate": "-1 deg/s"}]}}
    plan = {"scenarios": [impossible, *others], "runs": 2, "times": ["20 s"], "methods": ["oba"]}
    result = run_campaign(PLAN | plan, tmp_path)
    names = {path.name for path in result.save()}
    assert names >= {"summary.csv", "report.html", "convergence.png", "distribution.png"}
    ends = outcomes(result.table)
    assert list(ends["status"]) == ["failed"] * 2 + ["aligned"] * 2 * len(others)
    assert "turn of 9 deg at -1 deg/s" in ends["reason"][0]
    panels = result.plot()["convergence"].axes
    assert [text.get_text() for text in panels[0].texts] == ["no answer"]
    for panel in panels[1:]:
        (bound,) = [line for line in panel.lines if "Cramer-Rao" in str(line.get_label())]
        np.testing.assert_array_equal(bound.get_xdata(), [20.0, 40.0])
        assert not panel.texts


def test_what_goes_wrong_while_an_answer_is_judged_is_a_row(tmp_path, monkeypatch):
    def broken(*given):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr("truenorth.campaign.aligning._errors", broken)
    ends = outcomes(run_campaign(PLAN | {"methods": ["oba"], "runs": 2}, tmp_path).table)
    assert list(zip(ends["status"], ends["reason"], strict=True)) == [("failed", "LinAlgError: Singular matrix")]


def test_a_second_process_is_refused(tmp_path):
    plan = read_plan(PLAN)
    with opened(tmp_path, plan), pytest.raises(UsageError, match="another process works on this folder"):
        run_campaign(plan, tmp_path)


class Windows:
    """Stands for msvcrt: a byte of a file can be locked once, from where the file stands."""

    LK_NBLCK = 2

    def __init__(self):
        self.locked = set()

    def locking(self, file, mode, size):
        byte = (os.fstat(file).st_ino, os.lseek(file, 0, os.SEEK_CUR))
        if (mode, size) != (self.LK_NBLCK, 1) or byte in self.locked:
            raise PermissionError(13, "Permission denied")
        self.locked.add(byte)


def test_a_second_process_is_refused_on_windows_too(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)  # there is none on Windows
    monkeypatch.setitem(sys.modules, "msvcrt", Windows())
    test_a_second_process_is_refused(tmp_path)


def _begun_with(folder, **other):
    manifest = folder / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | other))


@pytest.mark.parametrize("name", ["truenorth", "numpy", "scipy", "numba", "platform"])
def test_runs_of_two_versions_are_not_mixed(tmp_path, name):
    plan = PLAN | {"methods": ["oba"], "runs": 2}
    before = run_campaign(plan, tmp_path).table
    _begun_with(tmp_path, **{name: "0.0"})
    with pytest.raises(UsageError, match=rf"was begun with {name} 0\.0 \(here .*`resume=False`"):
        run_campaign(plan | {"runs": 4}, tmp_path)
    pd.testing.assert_frame_equal(run_campaign(plan, tmp_path).table, before)  # nothing is missing: nothing is mixed


def test_begun_anew_a_folder_keeps_no_old_run(tmp_path):
    run_campaign(PLAN | {"methods": ["oba"], "runs": 4, "seed": 3}, tmp_path)
    _begun_with(tmp_path, numpy="0.0")
    plan = PLAN | {"methods": ["oba"], "runs": 2}
    anew = run_campaign(plan, tmp_path, resume=False)
    assert len(list((tmp_path / "runs").iterdir())) == 1
    pd.testing.assert_frame_equal(anew.table, run_campaign(plan, tmp_path).table, check_exact=True)
    assert json.loads((tmp_path / "manifest.json").read_text())["numpy"] == np.__version__


def test_another_plan_is_refused(undisturbed):
    with pytest.raises(UsageError, match="holds the runs of another plan"):
        run_campaign(PLAN | {"seed": 9}, undisturbed.folder)


def test_a_full_disk_stops_with_a_message_and_leaves_what_was_done(tmp_path, monkeypatch):
    import pyarrow.parquet as pq

    write, written = pq.write_table, []

    def full(table, path):
        if len(written) == 2:
            raise OSError(28, "No space left on device")
        written.append(path)
        write(table, path)

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(UsageError, match="No space left on device"):
        run_campaign(PLAN, tmp_path)
    assert len(list((tmp_path / "runs").iterdir())) == 2  # and nothing half-written


def test_a_damaged_shard_is_named(tmp_path):
    run_campaign(PLAN | {"runs": 2}, tmp_path)
    shard = next((tmp_path / "runs").iterdir())
    shard.write_bytes(shard.read_bytes()[:100])
    with pytest.raises(DataError, match=shard.name):
        read_table(tmp_path)


def test_the_pace_counts_what_was_done_since_the_start():
    assert pace(20, 1480, 4.0) == "5 runs/s, 0:04:56 left"
    assert pace(500, 0, 3.0) == "167 runs/s, 0:00:00 left"
    assert pace(0, 1500, 2.0) == ""


def test_the_command_writes_tables_figures_and_a_page(tmp_path):
    plan = PLAN | {"times": ["20 s"], "grid": {"imu.gyro.bias": ["0.01 deg/h", "0.1 deg/h"]}, "runs": 4}
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(plan))
    result = CliRunner().invoke(
        app, ["campaign", str(tmp_path / "p.yaml"), "-o", str(tmp_path / "out"), "--workers", "1"]
    )
    assert result.exit_code == 0, result.output
    assert "heading RMS" in result.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    figures = {"distribution.png", "overview.png", "convergence.png", "requirement_imu_gyro_bias.png"}
    assert names >= figures | {
        "summary.csv",
        "comparison.csv",
        "outcomes.csv",
        "report.html",
        "plan.yaml",
        "manifest.json",
    }
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count('class="chart"') == 4  # two cases' convergence, the errors, what the gyro costs
    assert "http" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL).split("<pre")[0]
    assert page.index('class="badge"') < page.index("arcmin (RMS") < page.index("<h2>")
    assert "NEES and NIS at the end of the log" in page
    again = read_campaign(tmp_path / "out")
    assert set(again.convergence["converged"]) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert len(again.summary) == len(pd.read_csv(tmp_path / "out" / "summary.csv"))


@pytest.mark.slow
@pytest.mark.parametrize("workers", some([1], [2]))
def test_alignment_in_motion_is_a_method_too(tmp_path, workers):
    """By the odometer that the scenario has; the same bits by two processes; no error beyond five sigma."""
    ring = {"kind": "ring", "radius": "60 m", "speed": "10 m/s", "wait": "20 s"}
    drive = REST | {
        "name": "drive",
        "duration": "90 s",
        "motion": ring,
        "odometer": {"scale_sigma": "0.3 %", "noise": "0.02 m/s"},
    }
    plan = PLAN | {"scenarios": [drive], "methods": ["in_motion"], "runs": 2, "block": 1, "times": ["60 s"]}
    one = run_campaign(plan, tmp_path / "one").table
    if workers > 1:
        pd.testing.assert_frame_equal(
            run_campaign(plan, tmp_path / "two", workers=workers).table, one, check_exact=True
        )
    ends = outcomes(one)
    assert list(zip(ends["time_s"], ends["status"], ends["runs"], strict=True)) == [
        (60.0, "aligned", 2),
        (90.0, "aligned", 2),
    ]
    attitude = one[one["quantity"].isin(["phi_e", "phi_n", "phi_u"])]
    assert len(attitude) == 2 * 2 * 3
    assert (attitude["value"].abs() < 5 * attitude["sigma"]).all()


def test_a_base_that_sways_has_no_bound():
    """A filter that takes sway for white noise bounds nothing."""
    tones = {"roll": [{"amplitude": "1 deg", "period": "6 s"}]}
    sway = REST | {"motion": {"kind": "sway", "tones": tones}, "lever_arm": ["0 m", "0 m", "3 m"]}
    plan = read_plan(PLAN | {"scenarios": [sway, REST], "runs": 1})
    table = bounds(plan)
    assert table.groupby("case")["bound"].count().tolist() == [0, 3]


@few_and_all(100)
def test_the_bound_is_not_beaten_and_nearly_reached(tmp_path, runs):
    """Still runs, a filter that is given the truth: RMS over the Cramer-Rao bound within its 99.9 % band of 1."""
    plan = PLAN | {"runs": runs, "block": 50, "methods": ["kalman"]}
    table = run_campaign(plan, tmp_path, workers=min(2, runs // 50 + 1)).summary.set_index("quantity")
    assert 0.5 < table.loc["nis", "mean"] < table.loc["nis", "ratio_high"]  # below 1: it allows for a base that sways
    for quantity in ("phi_e", "phi_n", "phi_u"):
        ratio = table.loc[quantity, "rms_over_bound"]
        assert ratio == table.loc[quantity, "rms"] / table.loc[quantity, "bound"]
        assert abs(ratio - 1) < 3.3 / np.sqrt(2 * runs)


@pytest.mark.slow
def test_published_filters_on_an_indexer_and_on_the_move_are_judged_by_the_truth(tmp_path):
    """Errors within four of their own sigmas: of the body on the indexer, of the vehicle by its odometer."""
    plan = {
        "name": "published",
        "runs": 2,
        "scenarios": ["rotary_ship"],
        "grid": {"duration": ["240 s"]},
        "methods": ["imakf", "swaying"],
    }
    drive = {**plan, "scenarios": ["odometer_ring"], "methods": ["sgkf", "in_motion"]}
    for number, content in enumerate((plan, drive)):
        table = run_campaign(content, tmp_path / str(number)).table
        heading = table[table["quantity"] == "phi_u"]
        assert len(heading) == 4
        assert (heading["value"].abs() < 4.0 * heading["sigma"]).all()
    with pytest.raises(DataError, match="has no odometer"):
        read_plan({**plan, "methods": ["sgkf"]})
