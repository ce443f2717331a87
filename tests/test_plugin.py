"""The example package of plug-ins, installed into a folder of its own: found by its entry points."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLE = Path(__file__).parents[1] / "examples" / "plugin"
UV = shutil.which("uv", path=str(Path(sys.executable).parent))

PROGRAM = """
import numpy as np, sys, truenorth as tn
from dataclasses import replace
from truenorth.simulation.scenario import read_scenario
folder = sys.argv[1]
place = tn.Position.from_degrees(40.0, 118.0, 50.0)
record = tn.simulate(__import__("truenorth.simulation", fromlist=["rest"]).rest(place, 0.3), rate=20.0, duration=60.0,
                     imu="navigation", seed=1, kind="rates").record
np.savetxt(f"{folder}/log.semicolon", np.column_stack([record.time, record.gyro, record.accel]), delimiter=";", fmt="%.17g")
again = tn.read_imu(f"{folder}/log.semicolon")
print(np.array_equal(again.gyro, record.gyro))
answer = tn.align(again.between(None, 30.0), place, "navigation", method="triad")
print(answer.method)
answer.save(f"{folder}/start")
scenario = read_scenario({"name": "s", "duration": "60 s", "position": {"lat": "40 deg", "lon": "118 deg"},
                          "motion": {"kind": "plug-in", "name": "spiral", "options": {"speed": 5.0}}})
print(round(float(np.linalg.norm(scenario.simulate().truth.v_n[-1])), 2))
rows = ["time,lat,lon,alt", *(f"{t},40.0,118.0,50.0" for t in range(31, 60))]
open(f"{folder}/fixes.csv", "w").write(chr(10).join(rows))
spec = replace(tn.imu_spec("navigation"), gyro_g_sensitivity=1e-6)
ends = [tn.navigate(record, answer, imu=spec, altitude="fixed", errors=e).track.sigma[-1, :3] for e in ([], ["g_sensitivity"])]
print(float(np.sqrt(ends[1] ** 2 - ends[0] ** 2)[2]))
"""


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder into which the example is installed, without the network."""
    if UV is None:
        pytest.skip("uv is not installed with this Python")
    folder = tmp_path_factory.mktemp("plugin")
    source = folder / "source"
    shutil.copytree(EXAMPLE, source)
    command = [
        UV,
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-build-isolation",
        "--offline",
        "--python",
        sys.executable,
    ]
    subprocess.run([*command, "--target", str(folder / "site"), str(source)], check=True, capture_output=True)
    return folder


def run(installed, *arguments):
    import os

    root = str(Path(__file__).parents[1])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(installed / "site"), root])}
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, env=environment)


@pytest.mark.slow
def test_reader_method_motion_errors_and_aid(installed):
    done = run(installed, "-c", PROGRAM, str(installed))
    same, method, speed, grown = done.stdout.split() or ["", "", "", "nan"]
    assert (same, method, speed) == ("True", "triad", "5.0"), done.stderr
    # At rest a sensitivity of 1e-6 rad/s by m/s^2 turns the heading by 9.8e-6 rad in each of the 30 seconds.
    assert float(grown) == pytest.approx(9.8e-6 * 30.0, rel=0.01)
    aid = f"fixes={installed / 'fixes.csv'}"
    log, start = installed / "log.semicolon", installed / "start"
    done = run(installed, "-m", "truenorth", "navigate", log, "--start", start, "--aid", aid, "--altitude", "free")
    assert "fixes: 29 measurements, 0 rejected" in done.stdout, done.stderr
    done = run(installed, "-m", "truenorth", "navigate", log, "--start", start, "--error", "nothing")
    assert "plug-in 'nothing' of truenorth.errors is not installed; installed: g_sensitivity" in done.stderr


def test_a_plug_in_that_is_not_installed(tmp_path):
    import truenorth as tn
    from truenorth.simulation.scenario import read_scenario

    motion = {"kind": "plug-in", "name": "nothing"}
    scenario = read_scenario(
        {"name": "s", "duration": "1 s", "position": {"lat": "1 deg", "lon": "2 deg"}, "motion": motion}
    )
    with pytest.raises(tn.TruenorthError, match=r"'nothing' of truenorth\.motions is not installed"):
        scenario.build_motion()
