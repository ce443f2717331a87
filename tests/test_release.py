"""What is written of a release in several places is the same in all of them."""

from __future__ import annotations

import json
import re
import tomllib
from importlib.metadata import requires
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import truenorth

ROOT = Path(__file__).resolve().parent.parent
CONDA_NAMES = {"matplotlib": "matplotlib-base"}


def requirements(lines: list[str]) -> dict[str, str]:
    found = (re.match(r"([A-Za-z0-9_-]+)\s*(.*)", line) for line in lines)
    return {m[1].lower(): m[2].replace(" ", "") for m in found if m}


def conda(lines: list[str]) -> dict[str, str]:
    return {CONDA_NAMES.get(name, name): version for name, version in requirements(lines).items()}


def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_the_version_is_one():
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))["version"] == truenorth.__version__
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert next(h for h in headings if h != "Unreleased") == truenorth.__version__


def test_the_conda_recipe_asks_for_what_the_wheel_asks_for():
    text = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8")
    needed, figures = text.split("  run:\n")[1].split("\n\n")[0].split("  run_constrained:")
    recipe = requirements([line.strip(" -") for line in needed.splitlines()])
    assert recipe.pop("python") == project()["requires-python"]
    assert recipe == conda(project()["dependencies"])
    constrained = requirements([line.strip(" -") for line in figures.splitlines()[1:]])
    assert constrained == conda(project()["optional-dependencies"]["plot"])
    assert f"- truenorth = {project()['scripts']['truenorth']}\n" in text


def test_the_image_runs_as_a_user_without_rights_and_copies_what_it_builds_from():
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("FROM ") and "-slim" in line for line in lines) == 2
    assert max(i for i, x in enumerate(lines) if x.startswith("USER navigator")) < lines.index(
        'ENTRYPOINT ["truenorth"]'
    )
    allowed = {x[1:] for x in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines() if x.startswith("!")}
    copied = {word for x in lines if x.startswith("COPY ") and "--from" not in x for word in x.split()[1:-1]}
    assert copied == allowed
    assert all((ROOT / name).exists() for name in copied)


def test_the_devcontainer_is_json():
    assert json.loads((ROOT / ".devcontainer/devcontainer.json").read_text(encoding="utf-8"))["name"] == "truenorth"


@pytest.mark.parametrize("name", ["README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE", "CONTRIBUTING.md"])
def test_what_a_reader_looks_for_is_there(name):
    assert (ROOT / name).stat().st_size > 200


def test_the_lock_has_what_the_demo_installs():
    """`make demo` installs by constraints: uv holds against the lock's hashes what stands there, and what does not against none."""
    entry = r"^([a-z0-9.-]+)==\S+.*\\\n    --hash=sha256:[0-9a-f]{64}\b"
    locked = set(re.findall(entry, (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.MULTILINE))
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    left, needed = [Requirement(line) for line in [*project()["dependencies"], *build]], set()
    while left:
        one = left.pop()
        name = re.sub(r"[-_.]+", "-", one.name).lower()
        if name not in needed and (one.marker is None or one.marker.evaluate({"extra": ""})):
            needed.add(name)
            left += map(Requirement, requires(name) or [])
    assert {"llvmlite", "pydantic-core", "pathspec"} <= needed
    assert needed - locked == set()
