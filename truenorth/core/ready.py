"""Calls of kernels that are on the disk as machine code, without Numba: what most processes need, and all that they need.

Where a kernel is called with arguments of a kind for the first time on a computer, Numba compiles it. Its machine code is then kept
once more, by itself, under a name that is worked out without Numba (:func:`~truenorth.core.fingerprint.fingerprint_of_call`).
The next process lays it into memory and calls it (:mod:`~truenorth.core.machine_code`). What is not of the plain kind is left
to Numba as before: other systems and processors, arguments that are functions or words, results that are arrays, settings
of Numba that are not the usual ones.

Kernels may come with the package, made for a level that many processors have (:mod:`~truenorth.core.processor`): they are
used where the cache has none. They have names of the same kind, so that one of other sources or versions is never used.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from numpy import ndarray

from truenorth.core import processor
from truenorth.core.fingerprint import UnknownValueError, fingerprints_of_call
from truenorth.core.kernel_folder import content_of, folders, read, write, write_folder
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
        (a.dtype, a.ndim, LAYOUTS[a.flags.num & FLAGS]) if type(a) is ndarray
        else (type(a), kind_of(a)) if isinstance(a, tuple)
        else type(a)
        for a in arguments
    ])  # fmt: skip


class Name(NamedTuple):
    """Of the file of a kernel: in the cache, and where it comes with the package (empty where none do)."""

    kept: str
    shipped: str

    def there(self) -> list[Path]:
        """Files of this name that exist."""
        return [path for path in (*self.in_cache(), *self.in_package()) if path.exists()]

    def in_cache(self) -> list[Path]:
        """Where the cache would have it."""
        return [folder / self.kept for folder in folders()]

    def in_package(self) -> list[Path]:
        """Where the package would have it."""
        return [processor.folder_of(processor.shipped_level()) / self.shipped] if self.shipped else []


def name_of(function: Callable[..., Any], options: dict[str, Any], arguments: tuple[Any, ...]) -> Name | None:
    """The name of the file for calls with such arguments; None where such calls are left to Numba."""
    if not _is_plain():
        return None
    level = processor.shipped_level()
    try:
        made_for = (processor.compiled_for(), level) if level else (processor.compiled_for(),)
        digests = fingerprints_of_call(function, options, arguments, made_for)
    except (UnknownValueError, OSError):
        return None
    readable = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__code__.co_qualname}")
    names = [f"{readable[-100:]}-{digest[:32]}{SUFFIX}" for digest in digests]
    return Name(names[0], names[1] if level else "")


def is_there(name: Name | None) -> bool:
    """Whether a file of this name is on the disk."""
    return name is not None and bool(name.there())


def found(name: Name | None, use: Callable[[bytes], T]) -> T | None:
    """What is made of the file of this name; None where there is none that can be used."""
    if name is None:
        return None
    for path, look in (*((p, read) for p in name.in_cache()), *((p, content_of) for p in name.in_package())):
        content = look(path)
        if content is not None:
            with suppress(*UNUSABLE):
                return use(content)
    return None


def keep(name: Name | None, content: bytes | None, use: Callable[[bytes], object]) -> None:
    """Keep machine code that Numba has made, where it can be used without Numba."""
    folder = write_folder()
    if name is None or content is None or folder is None:
        return
    with suppress(*UNUSABLE, OSError):  # a full disk costs the next process the time to load Numba
        use(content)
        write(folder / name.kept, content)


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
    of_level = {processor.NAME, processor.FEATURES} if processor.level_asked_for() else set()
    set_otherwise = any(name.startswith("NUMBA_") and name not in HARMLESS | of_level for name in os.environ)
    return can_link() and not set_otherwise and not os.path.exists(".numba_config.yaml")
