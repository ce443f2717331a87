"""Without matplotlib everything but the figures is there, and one line says what would bring them."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

PROGRAM = """
import sys
import tomllib
from pathlib import Path
sys.modules["matplotlib"] = None
import truenorth as tn
from typer.testing import CliRunner
from truenorth.cli import app

def run(*words):
    result = CliRunner().invoke(app, list(words))
    print(words[0], result.exit_code, type(result.exception).__name__ if result.exit_code == 1 else "", result.stderr.strip())

run("simulate", "still.yaml", "--csv", "-o", "still")
run("align", "still/imu.csv", "--lat", "45", "--imu", "navigation", "-o", "result")
run("navigate", "still/imu.csv", "--start", "result", "-o", "track")
known = ["--heading", "0,1", "--position", "45,0", "--pitch", "0", "--roll", "0"]
run("navigate", "still/imu.csv", *known, "--imu", "navigation", "-o", "t2")
run("noise", "still/imu.csv", "-o", "noise")
answer = tn.load("result")
print("picture", answer._repr_png_())
try:
    answer.plot()
except tn.UsageError as error:
    print("plot", error)
"""
STILL = """\
name: still
duration: 120 s
rate: 20 Hz
position: {lat: 45 deg, lon: 0 deg}
motion: {kind: rest}
imu: navigation
"""


@pytest.mark.slow
def test_without_matplotlib(tmp_path):
    (tmp_path / "still.yaml").write_text(STILL, encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=tmp_path, capture_output=True, text=True, check=False)
    said = done.stdout.splitlines()
    need = "figures need matplotlib: pip install 'truenorth[plot]'"
    assert said[0] == f"simulate 0  truenorth: {need}; none is written", done.stdout + done.stderr
    assert said[1].startswith("align 0")
    assert said[3].startswith("navigate 0")
    assert said[4] == f"noise 0  truenorth: {need}; none is written"
    assert said[5:] == ["picture None", f"plot {need}"]
    for name in ("still/truth.csv", "result/report.html", "t2/report.html", "noise/imu.yaml"):
        assert (tmp_path / name).exists() or (tmp_path / name.replace("csv", "parquet")).exists(), name


def test_all_extras_but_the_largest_are_locked():
    here = Path(__file__).parents[1]
    if not (here / "Makefile").exists():
        pytest.skip("an sdist has no Makefile")
    extras = set(tomllib.loads((here / "pyproject.toml").read_text())["project"]["optional-dependencies"])
    locked = re.search(r"^LOCKED := (.*)$", (here / "Makefile").read_text(), re.MULTILINE)[1].split()
    assert set(locked) == extras - {"cuda"}
