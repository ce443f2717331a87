"""A kernel is compiled by one process, for which the others wait; and none holds what takes long and is never needed."""

from __future__ import annotations

import ast
import fcntl
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import truenorth
from tests.core.test_compiled import CALL, write
from truenorth.core.kernel_lock import KernelLock

PACKAGE = Path(truenorth.__file__).parent


@pytest.fixture
def elsewhere(tmp_path):
    """The lock, and a handle on its file as another process would have it."""
    lock = KernelLock(tmp_path / "one.kernel")
    handle = os.open(lock.path, os.O_RDWR | os.O_CREAT)
    fcntl.flock(handle, fcntl.LOCK_EX)
    yield lock, handle
    lock.release()


def test_it_is_waited_for(elsewhere):
    lock, handle = elsewhere
    assert lock.taken()
    waiting = threading.Thread(target=lock.take)
    waiting.start()
    waiting.join(0.1)
    assert waiting.is_alive()
    lock.path.unlink()  # as a process does that is done
    os.close(handle)
    waiting.join(10.0)
    assert lock.handle >= 0
    assert lock.path.exists()  # a file of its own: the one that it waited for is gone


def test_a_process_that_ends_lets_go(elsewhere):
    lock, handle = elsewhere
    os.close(handle)
    assert not lock.taken()
    lock.take()
    assert lock.handle >= 0
    lock.release()
    assert not lock.path.exists()


def test_nobody_waits_for_himself(tmp_path):
    lock, again = KernelLock(tmp_path / "one.kernel"), KernelLock(tmp_path / "one.kernel")
    lock.take()
    again.take()
    assert again.handle < 0
    again.release()
    assert lock.taken()
    lock.release()


def test_where_nothing_can_be_written_nobody_waits(tmp_path):
    lock = KernelLock(tmp_path / "missing" / "one.kernel")
    lock.take()
    assert not lock.taken()


@pytest.mark.slow
def test_two_processes_compile_a_kernel_once(tmp_path):
    program = CALL.format(folder=str(write(tmp_path / "one")))
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment["XDG_CACHE_HOME"] = str(tmp_path)
    command = [sys.executable, "-c", program]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) for _ in range(2)]
    counts = [process.communicate(timeout=120)[0].splitlines()[1:] for process in both]
    assert [sorted(pair) for pair in zip(*counts, strict=True)] == [["0 1", "1 0"]] * 2


def compiled_functions():
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text()
        for node in ast.parse(text).body if "@compiled" in text or "@borrowing" in text else ():
            if isinstance(node, ast.FunctionDef):
                marks = " ".join(map(ast.unparse, node.decorator_list))
                if "compiled" in marks or "borrowing" in marks:
                    yield path, node


def test_no_kernel_assigns_an_array_to_a_part_of_another():
    """Numba compiles the message of shapes that do not fit for it: 3 s of strings, and of no use to anybody."""
    found, count = [], 0
    for path, function in compiled_functions():
        count += 1
        for node in ast.walk(function):
            if isinstance(node, ast.Assign) and not isinstance(node.value, ast.Constant):
                parts = [
                    part for target in node.targets for part in ast.walk(target) if isinstance(part, ast.Subscript)
                ]
                if any(isinstance(inside, ast.Slice) for part in parts for inside in ast.walk(part.slice)):
                    found.append(f"{path.name}: {ast.unparse(node)}")
    assert count > 150
    assert found == []
