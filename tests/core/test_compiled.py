"""Kernels on the disk: found again by what their code depends on, by any process, from any folder."""

from __future__ import annotations

import importlib
import os
import pkgutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

import truenorth
from truenorth.core.compiled import compiled
from truenorth.core.fingerprint import UnknownValueError, fingerprint
from truenorth.core.kernel_folder import prune
from truenorth.core.kernel_source import KernelSource

MODULES = {
    "plugin_constants": "RATE = 2.0\nUNUSED = 5.0\n",
    "plugin_inner": """
from truenorth.core.compiled import compiled
import plugin_constants
from plugin_constants import RATE

@compiled
def inner(x):
    '''Scaled.'''
    return RATE * x
""",
    "plugin_outer": """
from enum import IntEnum
from typing import NamedTuple
import numpy as np
from truenorth.core.compiled import compiled
import plugin_constants
from plugin_inner import inner

OFFSETS = np.arange(3.0)

class State(IntEnum):
    A = 0
    B = 1

class Pair(NamedTuple):
    left: float
    right: float

@compiled
def outer(x):
    return inner(x) + OFFSETS[State.B]

@compiled
def by_module(x):
    return x * plugin_constants.RATE

@compiled
def of_pair(pair):
    return pair.left + pair.right

@compiled
def alone(x):
    return x + 1.0
""",
}
SHOW = """
import sys
from numba import float64, typeof
from truenorth.core.compiled import Kernel
from truenorth.core.fingerprint import fingerprint
for folder in {folders!r}:
    sys.path[:1] = [folder]
    for name in [name for name in sys.modules if name.startswith("plugin_")]:
        del sys.modules[name]
    import plugin_inner, plugin_outer
    for k in (plugin_inner.inner, plugin_outer.outer, plugin_outer.by_module, plugin_outer.alone):
        print(fingerprint(k.py_func, k.options, (float64,)))
    pair = (typeof(plugin_outer.Pair(1.0, 2.0)),)
    print(fingerprint(plugin_outer.of_pair.py_func, {{}}, pair))
"""
KERNELS = ("inner", "outer", "by_module", "alone", "of_pair")
CALL = """
import sys
sys.path.insert(0, {folder!r})
import plugin_outer
print(plugin_outer.outer(1.5), plugin_outer.by_module(1.5))
for k in (plugin_outer.outer, plugin_outer.by_module):
    print(sum(k.stats.cache_misses.values()), sum(k.stats.cache_hits.values()))
"""


def write(folder, **edits):
    folder.mkdir(exist_ok=True)
    for name, text in (MODULES | edits).items():
        (folder / f"{name}.py").write_text(text)
    return folder


def run(program, cache, **environment):
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")} | {
        "XDG_CACHE_HOME": str(cache),
        "PYTHONDONTWRITEBYTECODE": "1",
        **environment,
    }
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment)
    return done.stdout.splitlines()


def edited(module, old, new):
    assert old in MODULES[module]
    return {module: MODULES[module].replace(old, new)}


EDITS = [
    (edited("plugin_constants", "RATE = 2.0", "RATE = 3.0"), {"inner", "outer", "by_module"}),
    (edited("plugin_constants", "UNUSED = 5.0", "UNUSED = 6.0"), set()),
    (edited("plugin_inner", "RATE * x", "x * RATE * x"), {"inner", "outer"}),
    (edited("plugin_inner", "@compiled", "@compiled(fastmath=True)"), {"inner", "outer"}),
    (edited("plugin_inner", "'''Scaled.'''", "# and why\n\n    '''What it is.'''"), set()),
    (edited("plugin_outer", "B = 1", "B = 2"), {"outer"}),
    (edited("plugin_outer", "x + 1.0", "x + 1"), {"alone"}),
    (edited("plugin_outer", "x + 1.0", "x - 1.0"), {"alone"}),
    (edited("plugin_outer", "pair.left + pair.right", "pair.left"), {"of_pair"}),
    (edited("plugin_outer", "    left: float\n    right: float", "    right: float\n    left: float"), {"of_pair"}),
]


@pytest.fixture(scope="module")
def fingerprints(tmp_path_factory):
    """Of the kernels of each edit, by name; the last are those of the original."""
    home = tmp_path_factory.mktemp("plugin")
    folders = [write(home / f"edit{number}", **edit) for number, (edit, _) in enumerate([*EDITS, ({}, None)])]
    lines = iter(run(SHOW.format(folders=[str(folder) for folder in folders]), home))
    return [{name: next(lines) for name in KERNELS} for _ in folders]


@pytest.mark.parametrize("number", range(len(EDITS)))
def test_an_edit_changes_its_dependents_only(fingerprints, number):
    new, original = fingerprints[number], fingerprints[-1]
    assert {name for name in KERNELS if new[name] != original[name]} == EDITS[number][1]


def test_every_kernel_of_the_library_is_covered():
    count = 0
    for info in pkgutil.walk_packages(truenorth.__path__, "truenorth."):
        if not info.name.endswith("__main__"):
            for value in vars(importlib.import_module(info.name)).values():
                if isinstance(value, KernelSource):
                    assert len(fingerprint(value.py_func, value.options, ())) == 64
                    count += 1
    assert count > 100


def test_a_value_of_another_kind_is_not_guessed():
    held = object()

    def kernel():
        return held

    with pytest.raises(UnknownValueError, match="object object"):
        fingerprint(kernel, {}, ())


@pytest.mark.slow
def test_another_process_and_another_checkout_compile_nothing(tmp_path):
    first, second = write(tmp_path / "one"), write(tmp_path / "two")
    assert run(CALL.format(folder=str(first)), tmp_path) == ["4.0 3.0", "1 0", "1 0"]
    assert run(CALL.format(folder=str(first)), tmp_path) == ["4.0 3.0", "0 1", "0 1"]
    assert run(CALL.format(folder=str(second)), tmp_path) == ["4.0 3.0", "0 1", "0 1"]
    write(second, **edited("plugin_outer", "inner(x) + OFF", "inner(x) - OFF"))
    assert run(CALL.format(folder=str(second)), tmp_path) == ["2.0 3.0", "1 0", "0 1"]
    assert len(list((tmp_path / "truenorth" / "kernels").glob("plugin_inner.inner-*"))) == 1
    write(second, **edited("plugin_inner", "RATE * x", "x + RATE"))
    assert run(CALL.format(folder=str(second)), tmp_path) == ["4.5 3.0", "1 0", "0 1"]
    assert run(CALL.format(folder=str(first)), tmp_path) == ["4.0 3.0", "0 1", "0 1"]


@pytest.mark.slow
def test_the_folder_that_the_environment_names_is_taken(tmp_path):
    folder = write(tmp_path / "one")
    run(CALL.format(folder=str(folder)), tmp_path / "cache", NUMBA_CACHE_DIR=str(tmp_path / "named"))
    assert list((tmp_path / "named" / "truenorth").glob("plugin_outer.outer-*.kernel"))
    assert not (tmp_path / "cache").exists()


@pytest.mark.slow
def test_without_a_folder_to_write_to_a_process_compiles_for_itself(tmp_path):
    folder = write(tmp_path / "one")
    (tmp_path / "file").write_text("no folder can stand below a file")
    for _ in range(2):
        lines = run(CALL.format(folder=str(folder)), tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "file"))
        assert lines == ["4.0 3.0", "1 0", "1 0"]


@pytest.mark.slow
def test_a_torn_file_is_compiled_anew(tmp_path):
    folder = write(tmp_path / "one")
    run(CALL.format(folder=str(folder)), tmp_path)
    for kernel in (tmp_path / "truenorth" / "kernels").glob("plugin_outer.outer-*"):
        kernel.write_bytes(kernel.read_bytes()[:-100])
    assert run(CALL.format(folder=str(folder)), tmp_path) == ["4.0 3.0", "1 0", "0 1"]
    assert run(CALL.format(folder=str(folder)), tmp_path) == ["4.0 3.0", "0 1", "0 1"]


ARRAYS = """
import sys
sys.path.insert(0, {folder!r})
import plugin_arrays

for n in (2, 5, -1):
    try:
        print(plugin_arrays.filled(n))
    except ValueError as error:
        print(error)
print("numba.np.arrayobj" in sys.modules)
"""


@pytest.mark.slow
def test_kernels_that_make_arrays_come_from_the_disk_without_what_compiled_them(tmp_path):
    """It takes longer to load than the kernel; what they say in errors, Numba's own among it, stays."""
    kernel = """
import numpy as np
from truenorth.core.compiled import compiled

@compiled
def filled(n):
    a = np.zeros(n)
    for i in range(n):
        a[i] = i + 1.0
    if n > 3:
        raise ValueError("too many")
    return a[0] + a[1]
"""
    folder = write(tmp_path / "code", plugin_arrays=kernel)
    said = ["3.0", "too many", "negative dimensions not allowed"]
    assert run(ARRAYS.format(folder=str(folder)), tmp_path) == [*said, "True"]
    assert run(ARRAYS.format(folder=str(folder)), tmp_path) == [*said, "False"]


MADE_ANEW = """
import sys
import numpy as np
from truenorth.core.compiled import compiled

def made(factor):
    @compiled
    def kernel(x):
        return factor * x
    return kernel

for factor in sys.argv[1:]:
    print(made(float(factor))(1.0))
"""


@pytest.mark.slow
def test_functions_of_one_name_stay_apart(tmp_path):
    """Each compiled by a process of its own: the linker of a third sees two functions of one name."""
    for factors in (("2",), ("3",), ("2", "3", "4")):
        program = f"import sys; sys.argv = ['-', *{factors!r}]\n" + MADE_ANEW
        assert run(program, tmp_path) == [str(float(factor)) for factor in factors]


TWO_TYPES = """
import sys
from truenorth.core.compiled import compiled

@compiled
def twice(x):
    return x + x

for kind in sys.argv[1:]:
    print(twice({"int": 3, "float": 1.5, "complex": 1j}[kind]))
"""


@pytest.mark.slow
def test_processes_that_compile_at_once_leave_each_signature_its_own_code(tmp_path):
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}

    def start(*kinds):
        command = [sys.executable, "-c", TWO_TYPES, *kinds]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)

    started = [start(kind) for kind in ("int", "float", "complex", "int")]
    assert [process.communicate()[0].strip() for process in started] == ["6", "3.0", "2j", "6"]
    assert start("int", "float", "complex").communicate()[0].split() == ["6", "3.0", "2j"]
    assert len(list((tmp_path / "truenorth" / "kernels").glob("*.kernel"))) == 3


def test_what_was_unused_longest_goes_first(tmp_path):
    now = time.time()
    for age in range(8):
        path = tmp_path / f"k-{age}.kernel"
        path.write_bytes(bytes(100))
        os.utime(path, (now - age, now - age))
    left = tmp_path / "left.aside"
    left.write_bytes(bytes(1))
    os.utime(left, (now - 90000.0, now - 90000.0))
    prune(tmp_path, 1000)
    assert len(list(tmp_path.glob("*.kernel"))) == 8
    assert not left.exists()
    prune(tmp_path, 400)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["k-0.kernel", "k-1.kernel", "k-2.kernel"]


@pytest.mark.parametrize("name", ["dispatcher", "inner"])
def test_threads_that_call_a_kernel_for_the_first_time_share_one_dispatcher(name, monkeypatch):
    kernel = compiled(lambda x: x)
    together = threading.Barrier(4)

    def slowly(*_):
        time.sleep(0.05)
        return object()

    def ask(_):
        together.wait()
        return getattr(kernel, name)

    monkeypatch.setattr(kernel, "_dispatcher", slowly)
    with ThreadPoolExecutor(4) as threads:
        assert len(set(threads.map(ask, range(4)))) == 1
