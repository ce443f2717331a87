"""The sources of the package as trees, each read once in a process for all tests of the house that ask for it."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path


@cache
def text_of(file: Path) -> str:
    """The text of a source."""
    return file.read_text(encoding="utf-8")


@cache
def nodes_of(file: Path) -> tuple[ast.AST, ...]:
    """All nodes of a source, the module first; parsed where a test asks for it, not while tests are collected."""
    return tuple(ast.walk(ast.parse(text_of(file))))
