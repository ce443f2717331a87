"""Documents are true: links lead somewhere, code runs, every public name has its place and its example."""

from __future__ import annotations

import ast
import functools
import importlib
import importlib.util
import inspect
import json
import re
import shlex
import subprocess
import sys
import textwrap
import unicodedata
from pathlib import Path

import pytest

import truenorth
from tests.forked import PLOTTER, Forks, python
from tests.runs import some

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
CHINESE = {"README.zh.md": "README.md", "docs/zh/start.md": "docs/start.md"}  # and the page that it follows
TUTORIALS = (*CHINESE.values(), *CHINESE)


def anchors(page: Path) -> set[str]:
    """Names of the headings, as the site and the forges make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", unicodedata.normalize("NFKC", h.lower())).strip() for h in headings)
    return {re.sub(r"[\s]+", "-", heading) for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if target.startswith(("http:", "https:", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.name}: {target}"
        if anchor and file.suffix == ".md":
            assert anchor in anchors(file), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_files_of_the_source_are_where_a_page_says(page):
    for path in re.findall(r"truenorth/[\w/]+\.(?:py|yaml)", page.read_text(encoding="utf-8")):
        assert (ROOT / path).exists(), f"{page.name}: {path}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_rows_stand_in_a_table_that_names_its_columns(page):
    """A row after an empty line is shown as text with bars; a column without a name says nothing to those who hear the page."""
    lines = ["", *re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL).splitlines(), ""]
    for before, line, after in zip(lines, lines[1:], lines[2:], strict=False):
        if line.startswith("|") and not before.startswith("|"):
            assert re.fullmatch(r"[|:\s-]+", after), f"{page.name}: {line}"
            assert all(cell.strip() for cell in line.strip("| ").split("|")), f"{page.name}: {line}"
            assert not line.startswith("| |"), f"{page.name}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_steps_of_a_list_follow_each_other(page):
    """A step after a table or a paragraph at the margin is part of that text: nothing counts on from it."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    outside = False
    for before, line in zip(["", *text.splitlines()], text.splitlines(), strict=False):
        number = re.match(r"(\d+)\. ", line)
        if number and int(number[1]) > 1:
            assert not outside, f"{page.name}: {line}"
        if number:
            outside = False
        elif line and not line.startswith(" ") and not before:
            outside = True  # a paragraph, a table or a heading of its own


def test_references_of_docstrings_become_links():
    hook = importlib.util.spec_from_file_location("site_hook", ROOT / "docs/site_hook.py")
    module = importlib.util.module_from_spec(hook)
    hook.loader.exec_module(module)
    page = '<h3 id="truenorth.read_imu"></h3> As for :func:<code>truenorth.read_imu</code>, of :class:<code>Odometer</code>.'
    shown = module.on_page_content(page, None, None, None)
    assert shown.endswith('As for <a href="#truenorth.read_imu"><code>read_imu</code></a>, of <code>Odometer</code>.')


def test_the_site_asks_nothing_of_the_network():
    site = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert re.search(r"^  - offline", site, re.MULTILINE)
    assets = re.findall(r"assets/[\w./-]+\.(?:js|css)", site)
    assert "assets/iframe-worker/shim.js" in assets  # which the search would fetch else
    for name in assets:
        assert not re.search(
            r"(?:src|url|import)[^\n]{0,9}https?://", (ROOT / "docs" / name).read_text(encoding="utf-8")
        )


def test_the_site_has_every_page():
    named = set(re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    assert named == {str(p.relative_to(ROOT / "docs")) for p in (ROOT / "docs").rglob("*.md")}


def test_every_public_name_has_a_place_and_an_example():
    text = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    examples = "".join(block for language, block in BLOCK.findall(text) if language == "python")
    places = set(re.findall(r"^::: truenorth\.(\w+)$", text, re.MULTILINE))
    assert places == set(truenorth.__all__)
    without = {name for name in truenorth.__all__ if f"tn.{name}" not in examples}
    assert without <= {"UsageError", "DataError", "AlignmentError"}, "no example"


LIVE = """
import numpy as np
from truenorth.simulation import rest, simulate
rows = simulate(rest(tn.Position.from_degrees(48.1), .7), imu="navigation", rate=50.0, duration=400.0, seed=1).record
values = (rows.time, rows.gyro / rows.interval, rows.accel / rows.interval)  # rates
time, gyro, accel = (x[:15000] for x in values)
later, later_gyro, later_accel = (x[15000:] for x in values)
"""
# What a block takes for given, made before it runs; None: nothing.
CODE = {
    "docs/api.md": None,
    "docs/filters.md": None,
    "docs/simulation.md": None,
    "docs/extending.md": None,
    "docs/zh/howto.md": None,
    "docs/live.md": LIVE,
}
QUICK = ["docs/filters.md", "docs/extending.md", "docs/zh/howto.md"]


@pytest.fixture(scope="module")
def run():
    """``python`` with some arguments in a folder; what is loaded already is of other libraries (a second a page)."""
    forks = Forks(PLOTTER, python)
    yield lambda folder, *arguments: ends_well(forks.call(*arguments, folder=folder))
    forks.close()


@pytest.mark.parametrize("page", some(QUICK, [page for page in CODE if page not in QUICK]))
def test_the_code_of_a_page_runs(page, tmp_path, run):
    text = python_of(ROOT / page)
    assert text
    if (given := CODE[page]) is not None:
        first, _, rest = text.partition("\n")
        text = f"{first}{given}{rest}".replace('"tactical"', '"navigation"')  # whose heading is known after 300 s
    run(tmp_path, "-c", text)


def test_no_page_has_code_that_is_not_run():
    assert {page for page in PAGES if python_of(page)} == {ROOT / page for page in (*CODE, *TUTORIALS)}


def python_of(page: Path) -> str:
    return "\n".join(text for language, text in BLOCK.findall(page.read_text(encoding="utf-8")) if language == "python")


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_calls_in_passing_are_calls_that_exist(page):
    """Indented lines of Python without the log that they are about: their names and keywords are ours."""
    for block in re.findall(r"(?:^    .*\n)+", page.read_text(encoding="utf-8"), re.MULTILINE):
        if "truenorth." in block and not re.search(r"^    truenorth ", block, re.MULTILINE):
            assert_calls_exist(textwrap.dedent(block), "truenorth", page.name)


@pytest.mark.parametrize(("page", "least"), [("docs/api.md", 41), ("docs/live.md", 1), ("docs/simulation.md", 1)])
def test_calls_of_a_page_that_runs_with_the_slow_tests_are_calls_that_exist(page, least):
    assert assert_calls_exist(python_of(ROOT / page), "tn", page) >= least


def assert_calls_exist(text: str, package: str, page: str) -> int:
    """Names that code calls of the package, as it is named there, are there and know the keywords; how many calls there are."""
    nodes = list(ast.walk(ast.parse(text)))
    ours = {package: truenorth}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("truenorth"):
            ours |= {name.name: getattr(importlib.import_module(str(node.module)), name.name) for name in node.names}
    calls = [node for node in nodes if isinstance(node, ast.Call) and re.fullmatch(r"[\w.]+", ast.unparse(node.func))]
    calls = [node for node in calls if ast.unparse(node.func).split(".")[0] in ours]
    for node in calls:
        first, *names = ast.unparse(node.func).split(".")
        function = functools.reduce(getattr, names, ours[first])
        known = inspect.signature(function).parameters
        keywords = {word.arg for word in node.keywords} - {None}
        anything = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
        assert anything or keywords <= set(known), f"{page}: {ast.unparse(node)}"
    return len(calls)


def steps_of(page: str) -> list[str]:
    """Lines of a page's commands and code, without comments and language."""
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    lines = "".join(text for language, text in blocks if language in ("sh", "python")).splitlines()
    return [step for line in lines if (step := line.partition("  # ")[0].replace(" --lang zh", "").strip())]


@pytest.mark.parametrize("page", CHINESE)
def test_a_chinese_page_has_the_steps_of_the_english_one(page):
    steps = steps_of(page)
    assert steps
    assert set(steps) <= set(steps_of(CHINESE[page]))


@pytest.mark.parametrize("page", some(["README.md"], [page for page in TUTORIALS if page != "README.md"]))
def test_a_newcomer_can_follow_the_page(page, tmp_path, run):
    """The commands of the page, the first one by the program itself, then its code, in one empty folder."""
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    for at, line in enumerate("".join(text for language, text in blocks if language == "sh").splitlines()):
        program, *arguments = shlex.split(line, comments=True)
        assert program == "truenorth", line
        if at == 0:
            by_itself = [str(Path(sys.executable).with_name(program)), *arguments]
            ends_well(subprocess.run(by_itself, cwd=tmp_path, capture_output=True, check=False))
        else:
            run(tmp_path, "-m", program, *arguments)
    run(tmp_path, "-c", "\n".join(text for language, text in blocks if language == "python"))


def ends_well(done: subprocess.CompletedProcess[bytes]) -> None:
    assert done.returncode == 0, f"{done.args[:2]}\n{(done.stdout + done.stderr).decode()}"


def test_the_film_is_small_and_moves():
    film = ROOT / "docs/assets/heading.svg"
    assert film.stat().st_size < 1e6
    assert film.read_text(encoding="utf-8").count("<animate ") > 30


NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("[0-9]_*.py"))


@pytest.mark.parametrize("script", NOTEBOOKS, ids=lambda p: p.stem)
def test_a_notebook_is_its_script_executed(script):
    """The .ipynb holds the cells of the script, every one with a number, none with an error, and some with pictures."""
    cells = json.loads(script.with_suffix(".ipynb").read_text(encoding="utf-8"))["cells"]
    parts = re.split(r"^# %%.*\n", script.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    assert len(parts) == len(cells), "run make notebooks"
    for part, cell in zip(parts, cells, strict=True):
        if cell["cell_type"] == "code":
            assert "".join(cell["source"]).strip() == part.strip(), "run make notebooks"
            assert cell["execution_count"]
            assert all(output["output_type"] != "error" for output in cell["outputs"])
    shown = [output for cell in cells if cell["cell_type"] == "code" for output in cell["outputs"]]
    assert any("image/png" in json.dumps(output) for output in shown)
