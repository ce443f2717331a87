"""Documents are true: links lead somewhere, code runs, every public name has its place and its example."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest

import truenorth

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
TUTORIALS = ("README.md", "README.zh.md", "docs/start.md", "docs/zh/start.md")


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


def test_the_site_has_every_page():
    named = set(re.findall(r"[\w/]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    assert named == {str(p.relative_to(ROOT / "docs")) for p in (ROOT / "docs").rglob("*.md")}


def test_every_public_name_has_a_place_and_an_example():
    text = (ROOT / "docs/api.md").read_text(encoding="utf-8")
    examples = "".join(code for language, code in BLOCK.findall(text) if language == "python")
    places = set(re.findall(r"^::: truenorth\.(\w+)$", text, re.MULTILINE))
    assert places == set(truenorth.__all__)
    without = {name for name in truenorth.__all__ if f"tn.{name}" not in examples}
    assert without <= {"UsageError", "DataError", "AlignmentError"}, "no example"


@pytest.mark.slow
@pytest.mark.parametrize("page", ["docs/api.md", "docs/filters.md", "docs/simulation.md"])
def test_the_code_of_a_page_runs(page, tmp_path):
    blocks = [
        code for language, code in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")) if language == "python"
    ]
    assert blocks
    run([sys.executable, "-c", "\n".join(blocks)], tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("page", TUTORIALS)
def test_a_newcomer_can_follow_the_page(page, tmp_path):
    """The commands of the page, then its code, in one empty folder."""
    blocks = BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))
    for line in "".join(code for language, code in blocks if language == "sh").splitlines():
        program, *arguments = shlex.split(line, comments=True)
        assert program == "truenorth", line
        run([str(Path(sys.executable).with_name(program)), *arguments], tmp_path)
    run([sys.executable, "-c", "\n".join(code for language, code in blocks if language == "python")], tmp_path)


def run(command: list[str], folder: Path) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command[:2]}\n{done.stdout}{done.stderr}"


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
