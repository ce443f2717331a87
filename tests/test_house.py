"""The house: who may import whom, no circles, no function over 120 lines, no file over 400. Imports for type checkers count."""

import ast
import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.sources import nodes_of, text_of

ROOT = Path(__file__).parents[1] / "truenorth"
FLOORS = [
    ["core"],
    ["filters", "analysis"],
    ["records"],
    ["formats"],
    ["state", "strapdown"],
    ["errors", "aiding"],
    ["estimate", "coarse", "quality"],
    ["alignment", "navigation", "damping"],
    ["advice"],
    ["live", "campaign", "figures", "report"],
    ["papers"],
    ["cli"],
]
FLOOR = {folder: number for number, folders in enumerate(FLOORS) for folder in folders}
FLOOR["simulation"] = FLOOR["state"] + 0.5  # it stands aside: on floors up to the strapdown algorithms
FLOOR[""] = FLOOR["report"] + 0.5  # the table of results, next to the package itself
SIMULATES = {"advice", "campaign", "figures", "report", "papers", "cli", "simulation"}
LONGEST = 120
LONGEST_FILE = 400

FILES = {".".join(("truenorth", *path.relative_to(ROOT).with_suffix("").parts)): path for path in ROOT.rglob("*.py")}


@cache
def imports(name: str) -> set[str]:
    """Files that a file imports: a name that is a file itself, or the file in which the name stands."""
    found = set()
    for node in nodes_of(FILES[name]):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {
                f"{node.module}.{a.name}" if f"{node.module}.{a.name}" in FILES else node.module for a in node.names
            }
    return {f for f in found if f.split(".")[0] == "truenorth"}


def folder(name: str) -> str:
    parts = name.split(".")
    return parts[1] if len(parts) > 2 or (len(parts) == 2 and (ROOT / parts[1]).is_dir()) else ""


def test_every_folder_has_its_floor():
    assert {p.name for p in ROOT.iterdir() if (p / "__init__.py").exists()} <= FLOOR.keys()


def test_no_circles():
    graph = {name: {f for f in imports(name) if f in FILES and f != name} for name in FILES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(reversed(error.args[1])))


def test_no_floor_imports_a_higher_one():
    wrong = [
        f"{name}: {other}"
        for name in FILES
        if folder(name)
        for other in imports(name)
        if FLOOR.get(folder(other), 99.0) > FLOOR[folder(name)]
    ]
    assert wrong == []


def test_no_procedure_imports_the_simulator():
    wrong = [
        f"{name}: {other}"
        for name in FILES
        if folder(name) not in SIMULATES
        for other in imports(name)
        if folder(other) == "simulation" and folder(name)
    ]
    assert wrong == []


def test_no_long_functions():
    wrong = [
        f"{name}:{node.name}"
        for name in FILES
        for node in nodes_of(FILES[name])
        if isinstance(node, ast.FunctionDef) and node.end_lineno - node.lineno + 1 > LONGEST
    ]
    assert wrong == []


def test_no_long_files():
    lengths = {name: path.read_text(encoding="utf-8").count("\n") for name, path in FILES.items()}
    assert {name: lines for name, lines in lengths.items() if lines > LONGEST_FILE} == {}


DIALECT = re.compile(r"\b(told|told_by|beside|hears|base of stone|(that|which) (is|are) none(?! of))\b")


def test_the_text_has_no_dialect():
    """Words that readers of the field stumbled over: what is said is plain English, in code and pages alike."""
    pages = [*ROOT.parent.glob("*.md"), *(ROOT.parent / "docs").rglob("*.md"), *ROOT.rglob("*.yaml"), *FILES.values()]
    wrong = [
        f"{page.relative_to(ROOT.parent)}: {found.group()}"
        for page in pages
        for found in DIALECT.finditer(page.read_text(encoding="utf-8"))
    ]
    assert wrong == []


@cache
def documented(name):
    """The docstrings of a module: their nodes."""
    kinds = ast.Module | ast.ClassDef | ast.FunctionDef
    return {
        id(node.body[0].value) for node in nodes_of(FILES[name]) if isinstance(node, kinds) and ast.get_docstring(node)
    }


def test_the_library_names_no_options():
    """Messages name Python's parameters, between backticks; the command line makes its options of them."""
    wrong = [
        f"{name}: {node.value!r}"
        for name in FILES
        if folder(name) != "cli" and ("--" in text_of(FILES[name]) or "-o" in text_of(FILES[name]))
        for node in nodes_of(FILES[name])
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if re.search(r"(?<![\w-])--[a-z]|(?<!\S)-o\b", node.value) and id(node) not in documented(name)
    ]
    assert wrong == []


def test_what_a_message_names_has_an_option():
    """Each option that the table of names offers exists, and each name in it stands in a message of the library."""
    from typer.main import get_command

    from truenorth.cli import app
    from truenorth.cli.wording import OPTIONS

    program = get_command(app)
    parameters = [p for command in (program, *program.commands.values()) for p in command.params]
    known = {flag for p in parameters for flag in (*p.opts, *p.secondary_opts)}
    text = "".join(path.read_text("utf-8") for name, path in FILES.items() if folder(name) != "cli")
    for name, option in OPTIONS.items():
        assert set(re.findall(r"--[a-z-]+", option)) <= known, option
        assert f"`{name}`" in text, name


def test_no_merge_is_left_half_done():
    """No text of the repository, its documents among it, holds the marks of a merge."""
    home = ROOT.parent
    kinds = {".py", ".md", ".yaml", ".yml", ".toml", ".po", ".txt"}
    folders = [home / name for name in ("truenorth", "tests", "docs", "benchmarks", "examples")]
    texts = [path for path in home.iterdir() if path.suffix in kinds]
    texts += [path for folder in folders for path in folder.rglob("*") if path.suffix in kinds]
    mark = re.compile(r"^(<{7} |>{7} |={7}$)", re.MULTILINE)
    assert [path.name for path in texts if mark.search(path.read_text("utf-8", errors="replace"))] == []
