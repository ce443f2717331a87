"""Lines of README's block "Your log" that take longer: streams, turntables, indexers, days at sea, campaigns, studies."""

from __future__ import annotations

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

from tests.documents.test_commands import ELSEWHERE, ROOT, your_log
from truenorth.simulation import scenario as scenarios

LONG = [line for line in your_log() if any(word in shlex.split(line, comments=True) for word in ELSEWHERE)]
SCENARIOS = Path(scenarios.__file__).parent / "scenarios"
pytestmark = pytest.mark.slow


def words_of(text: str) -> list[str]:
    """The arguments of the one line that holds this text."""
    (line,) = [line for line in LONG if text in line]
    return shlex.split(line, comments=True)[1:]


def run(folder: Path, *words: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "truenorth", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"


def simulate(folder: Path, name: str, **changes: object) -> Path:
    """A scenario of the package, perhaps shorter, as CSV."""
    content = yaml.safe_load((SCENARIOS / f"{name}.yaml").read_text(encoding="utf-8")) | changes
    (folder / "scenario.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    run(folder, "simulate", "scenario.yaml", "--csv", "--no-plot", "-o", name)
    return folder / name


def test_an_indexer(tmp_path):
    logs = simulate(tmp_path, "rotary_ship")
    (logs / "imu.csv").rename(tmp_path / "ship.csv")
    (logs / "encoder.csv").rename(tmp_path / "encoder.csv")
    run(tmp_path, *words_of("--indexer"))


def test_a_turntable(tmp_path):
    (simulate(tmp_path, "table") / "imu.csv").rename(tmp_path / "table.csv")
    run(tmp_path, *words_of("--positions"))


def test_a_voyage(tmp_path):
    logs = simulate(tmp_path, "marine_damping", duration="6 h", imu="navigation", errors={})
    (logs / "imu.csv").rename(tmp_path / "voyage.csv")
    (logs / "velocity_log.csv").rename(tmp_path / "log.csv")
    run(
        tmp_path,
        "align",
        "voyage.csv",
        "--lat",
        "45.78",
        "--lon",
        "126.67",
        "--imu",
        "navigation",
        "--to",
        "900",
        "-o",
        "start",
    )
    run(tmp_path, *words_of("--damping"))


def test_a_campaign(tmp_path):
    text = (ROOT / "docs/campaigns.md").read_text(encoding="utf-8")
    plan = yaml.safe_load(re.search(r"```yaml\n(name: which_gyro\n.*?)```", text, re.DOTALL)[1]) | {"runs": 2}
    (tmp_path / "which_gyro.yaml").write_text(yaml.safe_dump(plan), encoding="utf-8")
    run(tmp_path, *words_of("campaign"))


def test_a_study(tmp_path):
    run(tmp_path, *words_of("reproduce"), "--runs", "2")


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
        some = 20 if port == 9000 else 1
        for at in range(0, len(lines), some):
            packets.append((float(lines[at].split(b",")[0]), port, b"".join(lines[at : at + some])))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _, port, packet in sorted(packets):
            if process.poll() is not None:
                break
            sender.sendto(packet, ("127.0.0.1", ports[port]))
            time.sleep(pace)
    return process


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


def test_live_on_the_move(tmp_path):
    """It navigates on until Ctrl-C."""
    logs = simulate(tmp_path, "van", imu="tactical")
    process = stream(tmp_path, words_of("--navigate"), {9000: logs / "imu.csv", 9001: logs / "gnss.csv"}, 0.005)
    time.sleep(20.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "Traceback" not in out + err
