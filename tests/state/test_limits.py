"""The one table of limits: each is used, each has a reason, and no code asks for one that is not there."""

import ast
import math
from pathlib import Path

import pytest

import truenorth
from tests.sources import nodes_of, text_of
from truenorth.state.limits import LIMITS, limit

FILES = sorted(Path(truenorth.__file__).parent.rglob("*.py"))


def _words(file: Path) -> set[str]:
    """Texts in a file's code, but for docstrings and the table's own keys."""
    keys = {id(key) for node in nodes_of(file) if isinstance(node, ast.Dict) for key in node.keys}
    return {
        node.value
        for node in nodes_of(file)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in keys
    }


def _asked(file: Path) -> set[str]:
    """Names in ``limit("...")``."""
    calls = (node for node in nodes_of(file) if isinstance(node, ast.Call))
    return {
        call.args[0].value
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id == "limit" and isinstance(call.args[0], ast.Constant)
    }


def test_each_limit_is_used():
    named = [file for file in FILES if any(f'"{name}"' in text_of(file) for name in LIMITS)]
    words = set().union(*(_words(file) for file in named))
    assert not LIMITS.keys() - words


def test_no_limit_is_missing():
    asked = set().union(*(_asked(file) for file in FILES if "limit(" in text_of(file)))
    assert len(asked) > 50  # the search itself finds them
    assert not asked - LIMITS.keys()


@pytest.mark.parametrize("name", LIMITS)
def test_a_limit_says_why(name):
    value, unit, reason = LIMITS[name]
    assert math.isfinite(value)
    assert value > 0.0
    assert unit
    assert len(reason) > 20
    assert limit(name) == value
