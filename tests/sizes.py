"""Sizes of kernels in `make test`: those that `truenorth warm` compiles. Padding changes no bit (tests/filters/test_kalman.py).

Each size of a filter takes 5 to 30 s to compile. `make test-all` runs each model in the size that the library gives it.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from truenorth.core.linalg import Size, padded
from truenorth.estimate import run

COMPILED = {  # rows, by the module that asks for a size
    "truenorth.errors.model": (32,),
    "truenorth.estimate.run": (32, 48),
    "truenorth.filters.drive": (12, 24, 40, 64),
    "truenorth.filters.h_infinity": (12, 24, 40, 64),
    "truenorth.filters.smoother": (24,),
}


def of_compiled(sizes: tuple[int, ...]) -> Callable[[int], Size]:
    """`padded` to the next of the sizes; beyond the last as it is."""
    return lambda n: padded(min((size for size in sizes if size >= n), default=n))


def compiled_only() -> None:
    """Let models of other sizes run in the next that is compiled, for the rest of this process."""
    for module, sizes in COMPILED.items():
        import_module(module).padded = of_compiled(sizes)


def in_this_process() -> bool:
    """Whether they do."""
    return run.padded is not padded
