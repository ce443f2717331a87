"""A disk that fails at any call of any command that writes: after each failure its folder holds the old result or the new one.

Two kinds of failure. The n-th call that opens for writing, renames, links, removes or syncs a file fails, for all n. And a file
takes no more than so many bytes, as the system's limit of a file's size has it, for writers of any language: none, half of a
usual file, all but one of the largest.
"""

import io
import itertools
import pkgutil
import shutil
import statistics
import sys
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

import pyarrow.parquet
import pytest
import yaml
from matplotlib.figure import Figure

import truenorth
from tests.campaign.test_plan import PLAN, REST
from tests.test_atomic import failing
from tests.test_faulty_disk import PLACE, contents, failing_libraries, record_of
from truenorth.campaign.fault_pages import read_trials
from truenorth.cli import main
from truenorth.formats import write_imu
from truenorth.papers.study import Study
from truenorth.papers.table import Table

resource = pytest.importorskip("resource", reason="this system has no limit of a file's size")

LOOK = ["--lat", "45", "--lon", "10", "--imu", "navigation"]
SHORT = REST | {"duration": "5 s", "rate": "10 Hz"}
SEARCH = {"name": "s", "scenario": SHORT, "method": "oba", "search": {"gyro.bias": ["0.001 deg/h", "1 deg/h"]}}
COMMANDS = {  # words of the old result and of the new one; {at} is the folder with the inputs, {out} the one with the results
    "align": [["align", "{at}/log.csv", *LOOK, "--to", to, "-o", "{out}"] for to in ("50", "60")],
    "navigate": [
        ["navigate", "{at}/log.csv", "--start", "{at}/start", "--imu", "navigation", "--to", to, "-o", "{out}"]
        for to in ("45", "60")
    ],
    "live": [
        ["live", "replay:{at}/log.csv@max", *LOOK[:4], "--imu", imu, "--resume", "-o", "{out}"]
        for imu in ("navigation", "tactical")
    ],
    "simulate": [["simulate", "{at}/scenario.yaml", "--seed", seed, "-o", "{out}"] for seed in ("1", "2")],
    "campaign": [["campaign", "{at}/plan.yaml", "--workers", "1", "--runs", n, "-o", "{out}"] for n in ("1", "2")],
    "tune": [["tune", "{at}/search{n}.yaml".replace("{n}", n), "-o", "{out}"] for n in ("1", "2")],
    "advise": [["advise", *LOOK[:2], *LOOK[4:], "--heading", h, "-o", "{out}"] for h in ("0.1", "0.2")],
    "noise": [["noise", "{at}/log.csv", "--like", like, "-o", "{out}"] for like in ("navigation", "tactical")],
    "inspect": [["inspect", log, "--plot", "{out}/figure.png"] for log in ("{at}/log.csv", "{at}/other.csv")],
    "inspect, layout": [[], ["inspect", "{out}/log.csv", "--write-layout"]],
    "example": [[], ["example", "transfer", "-o", "{out}"]],
    "reproduce": [["reproduce", "networks", "--seed", seed, "-o", "{out}"] for seed in ("0", "1")],
    "reproduce all": [["reproduce", "all", "--seed", seed, "-o", "{out}"] for seed in ("0", "1")],
    "faults": [
        ["faults", "--procedure", "still", "--fault", f, "--runs", "1", "-o", "{out}"] for f in ("none", "wrong height")
    ],
}
LONGER = ("navigate", "live", "simulate", "campaign", "tune", "advise", "reproduce all")
# What grows as the work goes on: rows, runs with the plan that they are of, trials. The rest is written at the end.
GROWING = {"live": ("rows/",), "campaign": ("runs/", "plan.yaml"), "faults": ("trials.csv",)}
# What takes long and writes nothing is done once for the old result, and once for the new one.
REMEMBERED = [
    "truenorth.alignment.align",
    "truenorth.navigation.navigate",
    "truenorth.quality.inspect",
    "truenorth.quality.noise.noise_from_log",
    "truenorth.figures.noise.plot_noise",
    "truenorth.core.shown.plot",
    "truenorth.simulation.scenario.Scenario.simulate",
    "truenorth.advice.positions.advise",
    "truenorth.campaign.execution.work",
    "truenorth.campaign.tuning.tune",
    "truenorth.report.page.alignment_page",
    "truenorth.report.navigation.navigation_page",
    "truenorth.report.campaign.campaign_page",
    "truenorth.report.study.study_page",
]


def study_of(name, *, seed, **options):
    """A study of one figure, its seed."""
    table = Table()
    table.value("case", "method", "phi_u", "value", float(seed), "deg")
    return Study(name, table, [], {"figure1": Figure()})


class Commands:
    """Runs a command's words in this process; what was worked out once is remembered, figures are a few bytes."""

    def __init__(self, monkeypatch):
        self.answers, self.number, self.words = {}, 0, []
        for name in REMEMBERED:
            monkeypatch.setattr(name, self.remembered(name))
        monkeypatch.setattr("truenorth.papers.reproduce", study_of)
        monkeypatch.setattr("truenorth.papers.STUDIES", dict.fromkeys(("static", "networks")))
        monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **options: self.drawn(path))

    def remembered(self, name):
        real = pkgutil.resolve_name(name)

        def call(*args, **kwargs):
            self.number += 1
            key = (*self.words, self.number, name)
            if key not in self.answers:
                self.answers[key] = real(*args, **kwargs)
            return self.answers[key]

        return call

    def drawn(self, path):
        content = f"figure of {' '.join(self.words)}".encode()
        path.write(content) if hasattr(path, "write") else Path(path).write_bytes(content)

    def run(self, words, at, out):
        """Exit code and what was said."""
        self.words, self.number = words, 0
        said = io.StringIO()
        arguments = ["truenorth", *(word.format(at=at, out=out) for word in words)]
        with mock.patch.object(sys, "argv", arguments), redirect_stdout(said), redirect_stderr(said):
            try:
                main()
            except SystemExit as stop:
                return int(stop.code or 0), said.getvalue()
        return 0, said.getvalue()


@pytest.fixture(scope="module")
def at(tmp_path_factory):
    """A folder with the inputs of all commands."""
    folder = tmp_path_factory.mktemp("inputs")
    for name, seed in (("log", 1), ("other", 2)):
        write_imu(record_of(seed), folder / f"{name}.csv")
    truenorth.save(
        truenorth.align(record_of(1).between(None, 30.0), PLACE, "navigation", heading_limit=3.0), folder / "start"
    )
    (folder / "scenario.yaml").write_text(yaml.safe_dump(REST | {"duration": "5 s", "gnss": {"rate": "1 Hz"}}))
    (folder / "plan.yaml").write_text(yaml.safe_dump(PLAN))
    for n in (1, 2):
        (folder / f"search{n}.yaml").write_text(yaml.safe_dump(SEARCH | {"seed": n, "runs": 4, "trials": 2}))
    return folder


def failures(monkeypatch, sizes):
    """What a disk may do, by name, each a context: a call of the system that fails, for all calls; files that end too early."""
    left = [1]

    @contextmanager
    def call_fails(number):
        with failing(monkeypatch, number) as calls, failing_libraries(monkeypatch, number, calls):
            yield
        left[0] = calls[0] - number + 1

    @contextmanager
    def file_ends(limit):
        soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))

    for number in itertools.count(1):
        if not left[0]:
            break
        yield f"call {number}", call_fails(number)
    for limit in (0, statistics.median(sizes) // 2, max(sizes) - 1):
        yield f"files of {limit} bytes", file_ends(limit)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [pytest.param(name, marks=[pytest.mark.slow] if name in LONGER else []) for name in COMMANDS]
)
def test_the_old_result_stands_or_the_new_one_whole(command, at, tmp_path, monkeypatch):
    commands, (old_words, new_words) = Commands(monkeypatch), COMMANDS[command]
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    (before / "log.csv").write_bytes((at / "log.csv").read_bytes())
    if old_words:
        assert commands.run(old_words, at, before)[0] in (0, 4)
    shutil.copytree(before, after)
    code, said = commands.run(new_words, at, after)
    assert code in (0, 4), said
    old, new = results(command, before), results(command, after)
    assert old != new
    sizes = [len(content) for name, content in contents(after).items() if name != "log.csv" and content]
    for number, (failure, broken) in enumerate(failures(monkeypatch, sizes)):
        folder = tmp_path / str(number)
        shutil.copytree(before, folder)
        with broken:
            code, said = commands.run(new_words, at, folder)
        found = results(command, folder)
        assert found in (old, new), f"{failure}: {said}"
        assert found == new or code in (1, 2), f"{failure}: exit code {code}, {said}"
        assert "Traceback" not in said


def results(command, folder):
    """The files by name; of those that grow as the work goes on each is whole, and some more are no harm."""
    found = contents(folder)
    for name in [name for name in found if name.startswith(GROWING.get(command, ()))]:
        content = found.pop(name)
        if name.endswith(".parquet"):
            pyarrow.parquet.read_table(io.BytesIO(content))
        elif name.endswith(".csv"):
            read_trials(folder / name)
    return found
