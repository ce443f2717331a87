"""Compiled steps that borrow their arrays: no references are counted in them, so none may be made or handed back."""

from __future__ import annotations

import ast
import inspect
import pkgutil
import textwrap
from importlib import import_module

import numpy as np
import pytest

import truenorth
from truenorth.core.compiled import COUNT, Kernel, borrowing

OF_NUMBERS = {
    "isnan",
    "isfinite",
    "sqrt",
    "sin",
    "cos",
    "tan",
    "log",
    "log1p",
    "exp",
    "abs",
    "inf",
    "nan",
    "pi",
    "arctan2",
    "float64",
    "int64",
    "uint64",
    "bool_",
}


def kernels():
    """Every compiled function of the library."""
    found = {}
    for module in pkgutil.walk_packages(truenorth.__path__, "truenorth."):
        if module.name.endswith("__main__"):
            continue
        for value in vars(import_module(module.name)).values():
            if isinstance(value, Kernel):
                found[id(value)] = value
    return found.values()


def borrows(kernel):
    return kernel.options[COUNT] is False


def complaints(kernel):
    """What of a borrowing function is not sure to leave references alone."""
    function = kernel.py_func
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    parameters = {a.arg for a in tree.args.args}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "np":
            if node.attr not in OF_NUMBERS:
                yield f"names np.{node.attr}"
        elif isinstance(node, ast.Name) and isinstance(named := function.__globals__.get(node.id), Kernel):
            if not (borrows(named) or named.py_func.__module__ == "truenorth.core.earth"):
                yield f"calls {node.id}, which counts"
        elif isinstance(node, ast.Return) and node.value is not None:
            for part in node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]:
                if isinstance(part, ast.Name) and part.id in parameters:
                    yield f"returns {part.id}"
                if isinstance(part, ast.Subscript) and isinstance(part.slice, ast.Slice):
                    yield "returns a part of an array"


def test_what_borrows_makes_and_returns_no_array():
    every = [kernel for kernel in kernels() if borrows(kernel)]
    assert len(every) > 40
    found = {f"{k.__module__}.{k.__name__}": list(complaints(k)) for k in every}
    assert not {name: what for name, what in found.items() if what}


def test_no_kernel_has_an_option_that_nobody_reads():
    """Numba looks for `inline` at dispatchers of its own, not at a Kernel; LLVM reads `forceinline`."""
    assert [kernel.__qualname__ for kernel in kernels() if "inline" in kernel.options] == []


def test_a_step_that_makes_an_array_is_not_compiled():
    @borrowing
    def step(n):
        return np.zeros(n)[0]

    with pytest.raises(Exception, match="returning of array"):
        step(3)
