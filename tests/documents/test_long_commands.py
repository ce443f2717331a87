"""Lines of README's block "Your log" that take longer: streams, turntables, indexers, days at sea, campaigns, studies.

Each runs as it stands in every call, on a short log or with few runs; `test-all` has longer ones.
"""

from __future__ import annotations

import contextlib
import re
import shlex
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from tests.documents.test_commands import ELSEWHERE, ROOT, your_log
from tests.runs import some
from truenorth.cli import app
from truenorth.simulation import scenario as scenarios

LONG = [line for line in your_log() if any(word in shlex.split(line, comments=True) for word in ELSEWHERE)]
SCENARIOS = Path(scenarios.__file__).parent / "scenarios"


def words_of(text: str) -> list[str]:
    """The arguments of the one line that holds this text."""
    (line,) = [line for line in LONG if text in line]
    return shlex.split(line, comments=True)[1:]


def run(folder: Path, *words: str) -> None:
    with contextlib.chdir(folder):
        done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, f"{words}\n{done.output}{done.exception}"


def simulate(folder: Path, name: str, **changes: object) -> Path:
    """A scenario of the package, perhaps shorter, as CSV."""
    content = yaml.safe_load((SCENARIOS / f"{name}.yaml").read_text(encoding="utf-8")) | changes
    (folder / "scenario.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    run(folder, "simulate", "scenario.yaml", "--csv", "--no-plot", "-o", name)
    return folder / name


@pytest.mark.slow
@pytest.mark.parametrize("rate", some(["50 Hz"], ["100 Hz"]))
def test_an_indexer(rate, tmp_path):
    logs = simulate(tmp_path, "rotary_ship", rate=rate)
    (logs / "imu.csv").rename(tmp_path / "ship.csv")
    (logs / "encoder.csv").rename(tmp_path / "encoder.csv")
    run(tmp_path, *words_of("--indexer"))


@pytest.mark.slow
def test_a_turntable(tmp_path):
    (simulate(tmp_path, "table") / "imu.csv").rename(tmp_path / "table.csv")
    run(tmp_path, *words_of("--positions"))


@pytest.mark.slow
@pytest.mark.parametrize("duration", some(["2 h"], ["6 h"]))
def test_a_voyage(duration, tmp_path):
    logs = simulate(tmp_path, "marine_damping", duration=duration, imu="navigation", errors={})
    (logs / "imu.csv").rename(tmp_path / "voyage.csv")
    (logs / "velocity_log.csv").rename(tmp_path / "log.csv")
    place = ("--lat", "45.78", "--lon", "126.67")
    run(tmp_path, "align", "voyage.csv", *place, "--imu", "navigation", "--to", "900", "-o", "start")
    run(tmp_path, *words_of("--damping"))


@pytest.mark.slow
@pytest.mark.parametrize("points", some([1], [3]))
def test_a_campaign(points, tmp_path):
    """The plan of the page on campaigns, with some points of its grid and two runs of each."""
    text = (ROOT / "docs/campaigns.md").read_text(encoding="utf-8")
    plan = yaml.safe_load(re.search(r"```yaml\n(name: which_gyro\n.*?)```", text, re.DOTALL)[1]) | {"runs": 2}
    plan["grid"] = {path: values[:points] for path, values in plan["grid"].items()}
    (tmp_path / "which_gyro.yaml").write_text(yaml.safe_dump(plan), encoding="utf-8")
    run(tmp_path, *words_of("campaign"))


@pytest.mark.slow
def test_a_study(tmp_path):
    run(tmp_path, *words_of("reproduce"), "--runs", "2")


@pytest.mark.slow
def test_another_study(tmp_path):
    run(tmp_path, "reproduce", "rotary", "-o", "rotary", "--runs", "2")


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


def stream(folder: Path, words: list[str], logs: dict[int, Path], pace: float) -> subprocess.Popen[str]:
    """Start the program with the line's ports, 9000 on, exchanged for free ones, and send it the logs, clocks together."""
    ports = {port: free_port() for port in logs}
    words = [re.sub(r":(900\d)$", lambda found: f":{ports[int(found[1])]}", word) for word in words]
    program = [sys.executable, "-m", "truenorth", *words]
    process = subprocess.Popen(program, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "rows from udp" in process.stderr.readline()
    time.sleep(5.0)  # all is imported: nothing that is sent waits
    packets = []  # some rows in each datagram: none gets lost then
    for port, log in logs.items():
        header, *lines = log.read_bytes().splitlines(keepends=True)
        packets.append((-1e9, port, header))
        rows = 20 if port == 9000 else 1
        for at in range(0, len(lines), rows):
            packets.append((float(lines[at].split(b",")[0]), port, b"".join(lines[at : at + rows])))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _, port, packet in sorted(packets):
            if process.poll() is not None:
                break
            sender.sendto(packet, ("127.0.0.1", ports[port]))
            time.sleep(pace)
    return process


@pytest.mark.slow
def test_live_until_heading_is_good_enough(tmp_path):
    """It ends by itself, before the rows do."""
    still = {"lat": "48.1 deg", "lon": "11.5 deg", "alt": "500 m"}
    logs = simulate(
        tmp_path, "static_kalman", position=still, imu="navigation", errors={}, rate="20 Hz", duration="900 s"
    )
    process = stream(tmp_path, words_of("--lat 48.1"), {9000: logs / "imu.csv"}, 0.005)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    assert "aligned" in out + err


@pytest.mark.slow
def test_live_on_the_move(tmp_path):
    """It navigates on until Ctrl-C."""
    logs = simulate(tmp_path, "van", imu="tactical")
    process = stream(tmp_path, words_of("--navigate"), {9000: logs / "imu.csv", 9001: logs / "gnss.csv"}, 0.005)
    time.sleep(20.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "Traceback" not in out + err
