"""Kernels from the disk that are called without Numba: the same answers, and Numba wherever it is needed."""

import os
import shutil
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from truenorth.core import processor, ready
from truenorth.core.compiled import compiled
from truenorth.core.kernel_folder import content_of, write
from truenorth.core.kernel_store import machine_code_of
from truenorth.core.machine_code import WRAPPER, CannotLinkError, MachineCode, can_link
from truenorth.core.numba_part import numba_part

pytestmark = pytest.mark.skipif(not can_link(), reason="machine code of this system is left to Numba")

KERNELS = """
import math
from typing import NamedTuple

import numpy as np
from truenorth.core.compiled import compiled, compiled_callback
from truenorth.core.pointers import Pointer
from truenorth.core.vectors import load4, plus4, store4

OF_ONE = "float64(float64)"

class Parts(NamedTuple):
    at: int
    values: np.ndarray

@compiled
def mixed(parts, scale, wanted, out):
    if parts.at < 0:
        raise ValueError("before the first")
    room = np.zeros(parts.values.size)
    for i in range(parts.values.size):
        room[i] = scale * math.exp(parts.values[i])
    if wanted is not None:
        for i in range(room.size):
            out[i] = room[i]
    return room[parts.at], parts.at + 1, math.sin(scale)

@compiled
def lanes(A):
    store4(A, (0, 0), plus4(load4(A, (0, 0)), load4(A, (0, 4))))

@compiled
def made(n):
    return np.zeros(n)

@compiled_callback(OF_ONE)
def twice(x):
    return 2.0 * x

at = Pointer(OF_ONE)

@compiled
def through(address, x):
    return at(address)(x)
"""
CALLS = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
from plugin_ready import Parts, at, lanes, made, mixed, through, twice

out = np.zeros(3)
values = np.array([0.1, 0.2, 0.3])
for scale in (1.5, np.float64(0.7), 2):
    print(mixed(Parts(1, values), scale, True, out), out.tolist(), mixed(Parts(0, values), scale, None, out))
A = np.arange(8.0)[None].copy()
lanes(A)
print(A.tolist(), through(twice.address, 21.0))
print("numba" in sys.modules)
for call in (lambda: mixed(Parts(-1, values), 1.0, True, out), lambda: mixed(Parts(0, values), None, None, out)):
    try:
        call()
    except Exception as error:
        print(type(error).__name__, str(error).splitlines()[0])
print(made(2).tolist(), mixed(Parts(1, values), 1.5, True, out))
"""


def said(folder, **environment):
    kept = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment = kept | {"XDG_CACHE_HOME": str(folder / "cache")} | environment
    program = CALLS.format(folder=str(folder))
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment)
    return done.stdout.splitlines()


@pytest.mark.slow
def test_a_second_process_gives_the_same_bits_and_errors_without_numba(tmp_path):
    (tmp_path / "plugin_ready.py").write_text(KERNELS)
    first, second, by_numba = said(tmp_path), said(tmp_path), said(tmp_path, NUMBA_OPT="3")
    where = first.index("True")
    assert second[where] == "False"
    assert by_numba[where] == "True"
    assert said(tmp_path, NUMBA_NUM_THREADS="1")[where] == "False"  # as workers of campaigns have it
    for lines in (first, second, by_numba):
        del lines[where]
    assert first == second == by_numba
    assert second[where] == "ValueError before the first"


SHIPPED = """
from pathlib import Path
from truenorth.core import processor
processor.SHIPPED = Path({shipped!r})
"""


@pytest.mark.slow
@pytest.mark.parametrize("level", processor.levels())
def test_code_of_a_level_gives_the_bits_of_this_processor_from_an_empty_cache(tmp_path, monkeypatch, level):
    (tmp_path / "plugin_ready.py").write_text(KERNELS)
    own = said(tmp_path)
    of_level = {processor.NAME: level, processor.FEATURES: ""}
    made = said(tmp_path, XDG_CACHE_HOME=str(tmp_path / level), **of_level)
    monkeypatch.setattr(processor, "SHIPPED", tmp_path / "kernels")
    folder = processor.folder_of(level)
    folder.mkdir(parents=True)
    for file in (tmp_path / level).rglob("*.code"):
        shutil.copy(file, folder)
    monkeypatch.setitem(globals(), "CALLS", SHIPPED.format(shipped=str(tmp_path / "kernels")) + CALLS)
    empty = tmp_path / "empty"
    first = said(tmp_path, XDG_CACHE_HOME=str(empty), **of_level)
    where = own.index("True")
    assert first[where] == "False"
    for lines in (own, made, first):
        del lines[where]
    assert own == made == first
    assert [file.name for file in empty.rglob("*.code") if "mixed" in file.name] == []
    (tmp_path / "plugin_ready.py").write_text(
        KERNELS.replace("room[parts.at], parts.at + 1", "room[parts.at], parts.at + 2")
    )
    edited = said(tmp_path, XDG_CACHE_HOME=str(empty), **of_level)
    assert edited != own
    assert [file.name for file in empty.rglob("*.code") if "mixed" in file.name] != []


class Point(NamedTuple):
    x: float


class Other(NamedTuple):
    x: float


@compiled
def of_one(value):
    """Nothing of its argument."""
    return 1


GRID = np.zeros((3, 4))
FIXED = np.zeros((3, 4))
FIXED.flags.writeable = False
ODD = np.frombuffer(bytes(8 * 12 + 1), dtype=np.uint8)[1:].view(np.float64).reshape(3, 4)
APART = (
    *(GRID, GRID.T, GRID[:, ::2], FIXED, ODD, GRID[0], GRID.astype(np.float32), GRID.astype(">f8"), GRID.astype(int)),
    *(
        1,
        1.0,
        True,
        None,
        1j,
        np.float64(1.0),
        np.int32(1),
        (1, 2),
        (1, 2.0),
        (1,),
        Point(1.0),
        Other(1.0),
        Point(GRID),
    ),
)


def test_each_kind_of_argument_has_a_name_of_its_own():
    names = [ready.name_of(of_one.py_func, of_one.options, (value,)) for value in APART]
    assert None not in names
    assert len(set(names)) == len(names)
    assert len({ready.kind_of((value,)) for value in APART}) == len(APART)


def test_values_sizes_and_one_column_do_not_count():
    same = [
        (GRID, np.ones((7, 2))),
        (GRID, np.zeros((5, 1))),
        (GRID[0], np.zeros(1)),
        (1, -5),
        (Point(1.0), Point(2.0)),
    ]
    for one, other in same:
        assert ready.kind_of((one,)) == ready.kind_of((other,))
        assert ready.name_of(of_one.py_func, {}, (one,)) == ready.name_of(of_one.py_func, {}, (other,))


@pytest.mark.parametrize("value", ["word", 2**63, object(), [1.0], np.array(["a"]), np.zeros(2, dtype="f8,i4"), of_one])
def test_what_is_not_plain_is_left_to_numba(value):
    assert ready.name_of(of_one.py_func, of_one.options, (value,)) is None


@compiled
def summed(values):
    """A sum, in order."""
    total = 0.0
    for value in values:
        total += value
    return total


@pytest.fixture(scope="module")
def code():
    """An object file."""
    summed.dispatcher(np.ones(3))
    (kernel,) = summed.dispatcher.overloads.values()
    return machine_code_of(kernel)


def test_the_package_is_asked_where_the_cache_has_nothing(code, tmp_path, monkeypatch):
    monkeypatch.setattr(processor, "SHIPPED", tmp_path)
    monkeypatch.setattr(processor, "shipped_level", lambda: "x86-64-v3")
    monkeypatch.setattr(ready, "folders", lambda: (tmp_path,))
    name = ready.name_of(summed.py_func, summed.options, (np.ones(3),))
    assert name.kept != name.shipped
    assert not ready.is_there(name)
    assert ready.found(name, bytes) is None
    processor.folder_of("x86-64-v3").mkdir()
    (file,) = name.in_package()
    write(file, code)
    assert ready.is_there(name)
    assert ready.found(name, lambda content: ready.function_of(summed.py_func, content))(np.ones(3)) == 3.0
    write(tmp_path / name.kept, b"of the cache")
    assert ready.found(name, bytes) == b"of the cache"
    (tmp_path / name.kept).unlink()
    file.write_bytes(file.read_bytes()[:-1])
    assert ready.found(name, bytes) is None


@pytest.mark.skipif(
    not processor.shipped_level(), reason="no kernels come with the package for this processor and Python"
)
def test_what_comes_with_the_package_is_whole():
    """Also what is of older sources, which nobody calls."""
    files = list(processor.folder_of(processor.shipped_level()).iterdir())
    assert len(files) > 20
    for file in files:
        code = MachineCode(content_of(file), numba_part("_dynfunc").Environment({}))
        assert code.function(WRAPPER) > 0


def test_machine_code_is_linked_beside_numbas(code):
    call = ready.function_of(summed.py_func, code)
    values = np.random.default_rng(1).normal(size=1000)
    assert call(values) == summed.dispatcher(values) == summed.py_func(values)
    with pytest.raises(TypeError):
        call(None)
    with pytest.raises(TypeError):
        call(values, values)


def test_the_code_lives_as_long_as_the_function(code):
    calls = [ready.function_of(summed.py_func, code) for _ in range(50)]
    last = calls.pop()
    del calls
    assert last(np.ones(5)) == 5.0


def test_other_files_are_left_to_numba(code):
    environment = numba_part("_dynfunc").Environment({})
    for content in (b"", code[:40], b"MZ" + code[2:], code[:18] + b"\xb7\x00" + code[20:]):
        with pytest.raises(CannotLinkError):
            MachineCode(content, environment)
    unknown = code.replace(b"PyEval_SaveThread", b"PyEval_SaveThreaf")
    assert unknown != code
    with pytest.raises(CannotLinkError, match="PyEval_SaveThreaf"):
        MachineCode(unknown, environment)
    with pytest.raises(CannotLinkError, match="0 functions"):
        MachineCode(code, environment).function("nowhere")
    assert MachineCode(code, environment).function(WRAPPER) > 0
