"""What starts every run stays light: the package, the program and its help load no numerical or plotting library."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass

import pytest

HEAVY = ("numba", "numpy", "scipy", "pandas", "pyarrow", "pydantic", "matplotlib", "plotly", "jinja2", "dask", "yaml")
OF_TYPER = ("pydantic",)  # typer itself loads it once it reads the options of a command
BUDGET = 0.4  # s of processor time, interpreter start included

HELP = "import sys; sys.argv = ['truenorth', {arguments}]\nfrom truenorth.cli import main\ntry: main()\nexcept SystemExit: pass"
STARTS = {
    "the package": "import truenorth",
    "the program": "import truenorth.cli",
    "its help": HELP.format(arguments="'--help'"),
    "a command's help": HELP.format(arguments="'align', '--help'"),
    "its version": HELP.format(arguments="'--version'"),
}


def run(code: str) -> str:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("what", STARTS)
def test_nothing_heavy_is_loaded(what):
    heavy = [m for m in HEAVY if not (what == "a command's help" and m in OF_TYPER)]
    code = f"{STARTS[what]}\nimport sys; print('loaded:', [m for m in {heavy!r} if m in sys.modules])"
    assert run(code).splitlines()[-1] == "loaded: []"


def test_an_alignment_of_a_base_that_stays_is_loaded_without_what_it_seldom_asks_for():
    """SciPy's linear algebra alone takes .15 s of the second that a whole alignment takes."""
    code = "import truenorth.alignment.procedure, sys; print([m for m in ('scipy', 'pandas', 'matplotlib') if m in sys.modules])"
    assert run(code).splitlines()[-1] == "[]"


def test_a_base_alone_loads_nothing_of_aids():
    """Neither their records, nor their readers, nor what they measure: each start of `align` would wait for them."""
    code = "import truenorth.alignment.procedure, truenorth.alignment.recipes, truenorth.formats, sys"
    others = ("aiding.aids", "records.gnss", "records.poses", "formats.aiding", "state.track", "alignment.published")
    assert run(f"{code}\nprint([m for m in {others} if f'truenorth.{{m}}' in sys.modules])").splitlines()[-1] == "[]"


@pytest.mark.parametrize("what", ["the package", "its help"])
def test_it_starts_within_its_budget(what):
    """The best of five at most, by the processor's time: what else a machine does is not counted."""

    def spent() -> float:
        times = os.times()
        return times.children_user + times.children_system

    def once() -> float:
        begin = spent()
        run(STARTS[what])
        return spent() - begin

    assert any(once() < BUDGET for _ in range(5))


def test_public_names_are_what_they_say():
    import truenorth

    for name in truenorth.__all__:
        assert getattr(truenorth, name) is not None
    assert set(truenorth.__all__) <= set(dir(truenorth))
    for module in (truenorth.errors, truenorth.aiding, truenorth.state, truenorth.strapdown):
        assert all(getattr(module, name).__module__.startswith(module.__name__) for name in module.__all__)
        assert dir(module) == sorted(module.__all__)
    for module in (truenorth, truenorth.errors):
        with pytest.raises(AttributeError, match="no attribute 'nothing'"):
            _ = module.nothing


def test_the_names_of_type_checkers_are_those_of_the_program():
    """The list for the eye, the homes, and the imports under TYPE_CHECKING name the same things."""
    import ast
    from pathlib import Path

    import truenorth

    tree = ast.parse(Path(truenorth.__file__).read_text(encoding="utf-8"))
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    seen = {
        (alias.name, node.module)
        for node in guarded.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if node.module != "truenorth"
    }
    assert seen == {(name, f"truenorth.{home}") for name, home in truenorth._HOMES.items()}
    assert truenorth.__all__ == sorted(truenorth._HOMES)


def test_what_a_person_sees_is_what_is_public():
    """Names and submodules, nothing else; a submodule loads on its first touch."""
    import truenorth

    assert set(dir(truenorth)) == {"__version__", *truenorth._HOMES, *truenorth._SUBMODULES}
    code = "import truenorth as tn, sys; before = set(sys.modules); tn.filters.kalman; tn.analysis.nees; tn.errors"
    seen = "print('truenorth.filters' in before, 'truenorth.filters' in sys.modules)"
    assert run(f"{code}; {seen}").split() == ["False", "True"]


def test_the_record_of_each_public_aid_is_public():
    """Who has arrays and no file could make no `Indexer`: its record was not."""
    import truenorth

    aids = [thing for name in truenorth.__all__ if is_dataclass(thing := getattr(truenorth, name))]
    wanted = {word for aid in aids for x in fields(aid) for word in re.findall(r"\w+Record|Trajectory", str(x.type))}
    assert {"EncoderRecord", "GnssRecord", "MasterRecord"} <= wanted <= set(truenorth.__all__)


def test_python_ends_without_looking_for_garbage():
    """What is left at the end goes with the process; to look through it was a tenth of `align`."""
    ends = "import atexit, gc\natexit.register(lambda: print('left out:', gc.get_freeze_count() > len(gc.get_objects())))\n"
    assert run(ends + STARTS["its version"]).splitlines()[-1] == "left out: True"


@pytest.mark.parametrize("before", ["", "'--lang', 'zh', ", "'--lang=zh', "])
def test_a_command_loads_no_other(before):
    loaded = "\nprint([m for m in ('align', 'imu', 'navigate') if f'truenorth.cli.{m}' in sys.modules])"
    assert run(HELP.format(arguments=f"{before}'imu', '--help'") + loaded).splitlines()[-1] == "['imu']"


def test_help_and_what_is_no_command_know_all():
    loaded = "\nprint([m for m in ('align', 'imu', 'navigate') if f'truenorth.cli.{m}' in sys.modules])"
    for words in ("'--help'", "'aling', '--help'"):
        assert run(HELP.format(arguments=words) + loaded).splitlines()[-1] == "['align', 'imu', 'navigate']"


def test_a_table_is_read_without_pandas(tmp_path):
    """It takes a tenth of the time that `align` takes; pyarrow loads it where it makes a table without rows."""
    code = (
        "import numpy as np; from truenorth.records import ImuRecord; from truenorth.formats import write_imu\n"
        "ones = np.ones((100, 3)); record = ImuRecord(0.01 * np.arange(100.0), ones, 9.8 * ones, 'rates')\n"
        f"write_imu(record, {str(tmp_path / 'log.parquet')!r})"
    )
    read = f"import sys; from truenorth.formats import read_imu; read_imu({str(tmp_path / 'log.parquet')!r})"
    run(code)
    assert run(f"{read}\nprint('pandas' in sys.modules)").strip() == "False"


def test_a_module_does_not_hide_the_function_of_its_name():
    """Whatever was loaded first: a package of lazy names has functions whose modules have the same name."""
    code = "\n".join(
        [
            "import truenorth.filters.kalman, truenorth.filters.fading, truenorth.analysis.cramer_rao",
            "import truenorth.filters, truenorth.analysis",
            "from truenorth.filters import kalman, recursion",
            "for package in (truenorth.filters, truenorth.analysis):",
            "    for name in package.__all__:",
            "        assert type(getattr(package, name)) is not type(recursion), name",
            "print(type(kalman).__name__, type(recursion).__name__, dir(truenorth.filters) == sorted(truenorth.filters.__all__))",
        ]
    )
    assert run(code).split() == ["function", "module", "True"]


def test_an_alignment_loads_no_filter_of_nonlinear_systems():
    code = "import truenorth.alignment.procedure, sys; print(*[m for m in sys.modules if m.startswith('truenorth.')])"
    loaded = set(run(code).split())
    assert "truenorth.filters.system" in loaded
    assert not loaded & {"truenorth.filters.particle", "truenorth.filters.extended", "truenorth.analysis.cramer_rao"}
