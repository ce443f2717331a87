"""What tests draw in every call, and what where the slow ones run: runs of a statistic, cases of one law."""

import subprocess
import sys

import pytest

from tests.sizes import in_this_process

FEW = 8


def some(few, more):
    """Of cases of one law: `few` in every call, `more` in `test-all`."""
    values = [case if isinstance(case, tuple) else (case,) for case in more]
    return [*few, *(pytest.param(*case, marks=pytest.mark.slow) for case in values)]


def few_and_all(runs, few=FEW):
    """Parametrize `runs`: the bands of such a test follow from it."""
    return pytest.mark.parametrize("runs", [few, pytest.param(runs, marks=pytest.mark.slow)])


def said_by_a_second_process(program, first_will_do):
    """The words that a program prints in a process of its own.

    Its filters have the sizes of this process. It runs again where the kernels that it needs were not on the disk before:
    `first_will_do` says so of its words.
    """
    if in_this_process():
        program = f"from tests.sizes import compiled_only; compiled_only()\n{program}"
    for _ in range(2):
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        words = done.stdout.split()
        if first_will_do(words):
            break
    return words
