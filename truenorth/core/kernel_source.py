"""What a kernel is made from: a Python function, options, and steps that the type of an argument chooses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

STEPS = "compiled_steps"  # attribute of a class: functions by name that a kernel takes for arguments of this class


class KernelSource:
    """A function to be compiled.

    Parameters
    ----------
    function : callable
        The Python function, of what Numba understands; it may call other kernels.
    options : dict
        For :func:`numba.jit`.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        self.__module__, self.__qualname__ = function.__module__, function.__qualname__
        self.__wrapped__ = function
        self.py_func = function
        self.options = options
