"""Commands in the documents: each names a command and options that exist, with values they take; README's own are run."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from truenorth.cli import _language_first, app

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted(ROOT.glob("README*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
PLACEHOLDERS = re.compile(r"\.\.\.|…|<\w+>|\bNAME\b|\[")


def commands(page: Path) -> list[str]:
    """Lines of code that call the program, and whole commands between backticks in a line of text."""
    text = page.read_text(encoding="utf-8")
    lines = [
        line.strip().removeprefix("$ ") for line in text.splitlines() if line.startswith(("truenorth ", "    ", "$ "))
    ]
    inline = re.findall(r"`(truenorth [a-z][^`\n]* [^`\n]+)`", text)
    found = [line.partition(" > ")[0] for line in (*lines, *inline) if line.startswith("truenorth ")]
    return [line for line in found if not PLACEHOLDERS.search(line)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_command_of_a_page_exists_with_its_options(page):
    program = typer.main.get_command(app)
    for line in commands(page):
        _, *words = shlex.split(line, comments=True)
        context = program.make_context("truenorth", _language_first(words))
        name, command, arguments = program.resolve_command(context, [*context._protected_args, *context.args])
        try:
            command.make_context(name, arguments, parent=context)
        except Exception as error:
            said = getattr(error, "message", "") or type(error).__name__
            if "MissingParameter" not in said and "requires an argument" not in said:  # text may name an option alone
                pytest.fail(f"{page.name}: {line}: {said}")


def test_there_are_commands_to_look_at():
    assert len(commands(ROOT / "README.md")) >= 15
    assert sum(len(commands(page)) for page in PAGES) > 60


def your_log() -> list[str]:
    """The lines of README's block "Your log"."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text[text.index("## Your log") :].split("```")[1]
    return [line for line in block.splitlines() if line.startswith("truenorth ")]


# Streams, turntables, indexers, days at sea, campaigns and studies are run in test_long_commands.
ELSEWHERE = ("live", "--indexer", "--positions", "--damping", "campaign", "reproduce")
RUN = [line for line in your_log() if not any(word in shlex.split(line, comments=True) for word in ELSEWHERE)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The logs that the block names, simulated: a vehicle that stands where the page's does, a drive, a slave and its master."""
    import numpy as np

    from truenorth import Position
    from truenorth.core.attitude import euler_from_dcm
    from truenorth.formats import write_imu
    from truenorth.simulation import ideal_log, rest, simulate
    from truenorth.simulation.course import course
    from truenorth.simulation.manoeuvres import s_turn, straight, turn

    home = tmp_path_factory.mktemp("logs")

    def save(name: str, header: str, *columns: object) -> None:
        np.savetxt(home / name, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.10g")

    def aids(motion: object, t: np.ndarray) -> tuple[np.ndarray, ...]:
        at = motion.states(t)
        return np.degrees(at.lat), np.degrees(at.lon), at.alt, *at.v_n.T, *np.degrees(euler_from_dcm(at.C_nb))

    gnss = "time,lat,lon,alt,VE,VN,VU"
    still = rest(Position.from_degrees(34.246, 108.910, 380.0), 0.7)
    write_imu(simulate(still, rate=10.0, duration=330.0, imu="navigation", seed=1).record, home / "log.csv")
    t = np.arange(1.0, 330.0)
    save("gnss.csv", gnss, t, *aids(still, t)[:6])
    legs = [*straight(5.0), *turn(2 * np.pi, 0.2), *s_turn(0.5, 0.1), *straight(60.0)]
    drive = course(Position.from_degrees(50.0, 10.0, 0.0), legs, heading=0.7, speed=8.0)
    record = simulate(ideal_log(drive, rate=20.0, duration=80.0), imu="tactical", seed=1).record
    t = np.arange(0.5, 80.0, 0.5)
    columns = aids(drive, t)
    for name in ("drive.csv", "slave.csv"):
        write_imu(record, home / name)
    save("odo.csv", "time,speed", t, np.full(len(t), 8.0))
    save("drive_gnss.csv", gnss, t, *columns[:6])
    save("master.csv", f"{gnss},heading,pitch,roll", t, *columns)
    return home


@pytest.mark.parametrize("line", RUN, ids=lambda line: " ".join(line.split()[1:5]))
def test_a_line_of_your_log_runs(line, folder, monkeypatch):
    """In order, as they stand; a drive has another GNSS log than the vehicle that stands."""
    monkeypatch.chdir(folder)
    words = shlex.split(line, comments=True)[1:]
    if "drive.csv" in words:
        words[words.index("gnss.csv")] = "drive_gnss.csv"
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, f"{result.output}\n{result.exception}"


def test_every_line_is_run_here_or_there():
    from tests.documents.test_long_commands import LONG

    assert len(RUN) >= 6
    assert {line.split("#")[0].strip() for line in your_log()} == {line.split("#")[0].strip() for line in [*RUN, *LONG]}
