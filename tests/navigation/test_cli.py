"""`truenorth navigate` from the shell: results, exit codes, messages."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from tests.helpers import run_command
from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(48.0, 11.0, 500.0)


def run(*arguments):
    code = "import sys\nfrom truenorth.cli import main\nsys.argv = ['truenorth', *sys.argv[1:]]\nmain()"
    return subprocess.run([sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log at rest, its alignment, a GNSS log, and one of another day."""
    folder = tmp_path_factory.mktemp("navigate")
    spec = imu_spec("navigation")
    record = simulate(rest(PLACE, 0.6), rate=50.0, duration=260.0, imu=spec, seed=2).record
    write_imu(record, folder / "log.parquet")
    align(record.between(None, 200.0), PLACE, spec).save(folder / "start")
    time = np.arange(201.0, 260.0)
    rng = np.random.default_rng(0)
    table = pd.DataFrame(
        {
            "time": time,
            "lat": 48.0 + 1e-5 * rng.standard_normal(len(time)),
            "lon": 11.0 + 1e-5 * rng.standard_normal(len(time)),
            "alt": 500.0 + 2.0 * rng.standard_normal(len(time)),
        }
    )
    table.to_csv(folder / "gnss.csv", index=False)
    table.assign(time=time + 1e5).to_csv(folder / "late.csv", index=False)
    table.assign(lat=table["lat"] + np.where(time > 210.0, 0.01, 0.0)).to_csv(folder / "moved.csv", index=False)
    return folder


def test_a_folder_with_all_results(capsys, monkeypatch, folder):
    out = folder / "track"
    words = ["navigate", folder / "log.parquet", "--start", folder / "start", "--gnss", folder / "gnss.csv", "-o", out]
    code, said = run_command(capsys, monkeypatch, *words)
    assert code == 0, said.err
    assert "navigated" in said.out
    assert "GNSS position: 59 measurements" in said.out
    names = {"summary.json", "track.parquet", "innovations.parquet", "track.geojson", "report.html", "result.npz"}
    assert {path.name for path in out.iterdir()} == names
    assert json.loads((out / "summary.json").read_text())["altitude"] == "gnss"


def test_json_alone(folder):
    done = run("navigate", folder / "log.parquet", "--start", folder / "start", "--json", "--zupt", "200-260")
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout)
    assert shown["stops_s"] == 60
    assert abs(shown["lat_deg"] - 48.0) * 111e3 < 1.0


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (["--start", "{start}", "--gnss", "{late}"], 3, "no overlap"),
        (["--start", "{start}", "--gnss", "{moved}"], 4, ""),
        (["--start", "{start}", "--gnss", "{gnss}", "--lever-arm", "120,40,200"], 2, "centimetres"),
        (["--start", "{start}", "--gnss", "{gnss}", "--lever-arm", "1,2"], 2, "expected 3 numbers"),
        (["--start", "{start}", "--gnss", "{gnss}", "--gnss-drift", "2,0"], 2, "above zero, such as 2,60"),
        (["--start", "{start}", "--altitude", "up"], 2, "expected one of fixed"),
        (["--start", "{start}", "--estimate", "speed"], 2, "'speed' is not known"),
        (["--start", "{start}", "--zupt", "now"], 2, "expected auto"),
        (["--start", "{nothing}"], 3, "cannot be read"),
    ],
)
def test_exit_codes_and_messages(capsys, monkeypatch, folder, options, code, message):
    files = {name: folder / f"{name}.csv" for name in ("gnss", "late", "moved")}
    files |= {"start": folder / "start", "nothing": folder / "nothing"}
    words = ["navigate", folder / "log.parquet", *(option.format(**files) for option in options)]
    ended, said = run_command(capsys, monkeypatch, *words)
    assert ended == code, said.out + said.err
    assert message in said.err
    assert "Traceback" not in said.err
