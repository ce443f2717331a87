"""Calls of kernels that are on the disk as machine code, without Numba: what most processes need, and all that they need.

Where a kernel is called with arguments of a kind for the first time on a computer, Numba compiles it. Its machine code is then kept
once more, by itself, under a name that is worked out without Numba (:func:`~truenorth.core.fingerprint.fingerprint_of_call`).
The next process lays it into memory and calls it (:mod:`~truenorth.core.machine_code`). What is not of the plain kind is left
to Numba as before: other systems and processors, arguments that are functions or words, results that are arrays, settings
of Numba that are not the usual ones.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import Any, TypeVar

import numpy as np

from truenorth.core.fingerprint import UnknownValueError, fingerprint_of_call
from truenorth.core.kernel_folder import folders, read, write, write_folder
from truenorth.core.machine_code import CALLBACK, WRAPPER, CannotLinkError, MachineCode, can_link
from truenorth.core.numba_part import numba_part

T = TypeVar("T")

UNUSABLE = (CannotLinkError, ImportError, AttributeError)  # the last two: a version of Numba with other names
HARMLESS = {"NUMBA_CACHE_DIR", "NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER"}  # settings that code does not depend on
SUFFIX = ".code"
IN_ORDER, BY_COLUMNS, FLAGS = 0x1, 0x2, 0x503  # of NumPy: C, F, and both with aligned and writeable
LAYOUTS = [flags & ~BY_COLUMNS if flags & IN_ORDER else flags for flags in range(FLAGS + 1)]


def kind_of(arguments: tuple[Any, ...]) -> tuple[Any, ...]:
    """What machine code depends on of arguments; quick, and of this process."""
    return tuple([
        (a.dtype, a.ndim, LAYOUTS[a.flags.num & FLAGS]) if type(a) is np.ndarray
        else (type(a), kind_of(a)) if isinstance(a, tuple)
        else type(a)
        for a in arguments
    ])  # fmt: skip


def name_of(function: Callable[..., Any], options: dict[str, Any], arguments: tuple[Any, ...]) -> str | None:
    """The name of the file for calls with such arguments; None where such calls are left to Numba."""
    if not _is_plain():
        return None
    try:
        digest = fingerprint_of_call(function, options, arguments)
    except (UnknownValueError, OSError):
        return None
    readable = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__code__.co_qualname}")
    return f"{readable[-100:]}-{digest[:32]}{SUFFIX}"


def is_there(name: str | None) -> bool:
    """Whether a file of this name is on the disk."""
    return name is not None and any((folder / name).exists() for folder in folders())


def found(name: str | None, use: Callable[[bytes], T]) -> T | None:
    """What is made of the file of this name; None where there is none that can be used."""
    for folder in folders() if name else ():
        content = read(folder / str(name))
        if content is not None:
            with suppress(*UNUSABLE):
                return use(content)
    return None


def keep(name: str | None, content: bytes | None, use: Callable[[bytes], object]) -> None:
    """Keep machine code that Numba has made, where it can be used without Numba."""
    folder = write_folder()
    if name is None or content is None or folder is None:
        return
    with suppress(*UNUSABLE, OSError):  # a full disk costs the next process the time to load Numba
        use(content)
        write(folder / name, content)


def function_of(function: Callable[..., Any], content: bytes) -> Callable[..., Any]:
    """A function that Python calls, whose code is in an object file.

    Raises
    ------
    CannotLinkError
        It is left to Numba.
    """
    functions = numba_part("_dynfunc")
    environment = functions.Environment(function.__globals__)
    code = MachineCode(content, environment)
    module, said = sys.modules.get(function.__module__), f"compiled {function.__qualname__}"
    at = code.function(WRAPPER)
    called: Callable[..., Any] = functions.make_function(module, function.__name__, said, at, environment, (code,))
    return called


def callback_of(function: Callable[..., Any], content: bytes) -> tuple[int, object]:
    """The address of a function that kernels call, and what must live as long as it is called.

    Raises
    ------
    CannotLinkError
        It is left to Numba.
    """
    code = MachineCode(content, numba_part("_dynfunc").Environment(function.__globals__))
    return code.function(CALLBACK), code


@cache
def _is_plain() -> bool:
    """Whether Numba has its usual settings, on a system whose machine code is understood."""
    set_otherwise = any(name.startswith("NUMBA_") and name not in HARMLESS for name in os.environ)
    return can_link() and not set_otherwise and not os.path.exists(".numba_config.yaml")
