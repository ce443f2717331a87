"""One decorator for every compiled function of the library."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"nopython": True, "error_model": "numpy", "fastmath": False, "nogil": True}
PACKAGE = Path(__file__).parents[1]


def compiled(function: F | None = None, **options: Any) -> Any:
    """Compile a function with Numba: IEEE arithmetic, NumPy division rules, cached on disk.

    The cache is kept by the text of all files that hold compiled code, since kernels call each other across files and
    Numba itself watches only the one a kernel stands in. Where no cache folder is writable (a read-only installation),
    Numba raises at decoration time; the function is then compiled anew in each process.

    Parameters
    ----------
    function : callable
        The function; may be left out when options are given (``@compiled(inline="always")``).
    **options
        Passed on to :func:`numba.jit`.

    Returns
    -------
    numba dispatcher, or a decorator when `function` is left out.
    """
    if function is None:
        return lambda f: compiled(f, **options)
    try:
        with _cache_folder(_folder()):
            return numba.jit(cache=True, **(OPTIONS | options))(function)
    except RuntimeError as error:  # "cannot cache function ...: no locator available"
        if "cache" not in str(error):
            raise
        return numba.jit(cache=False, **(OPTIONS | options))(function)


def compiled_callback(signature: str) -> Callable[[F], Any]:
    """Compile a function that kernels take as an *argument*, with a declared signature.

    A dispatcher or closure as an argument would make each kernel be compiled anew for each such function, and miss the
    disk cache; one with a declared signature is a pointer, and all functions of that signature share one kernel.

    Parameters
    ----------
    signature : str
        Of Numba's, such as ``"void(float64[::1], float64[::1], float64[::1])"``.

    Returns
    -------
    decorator
        Of functions; compiles at once.
    """

    def decorate(function: F) -> Any:
        options: dict[str, Any] = {"nopython": True, "error_model": "numpy"}
        try:
            with _cache_folder(_folder()):
                return numba.cfunc(signature, cache=True, **options)(function)
        except RuntimeError as error:  # "cannot cache function ...: no locator available"
            if "cache" not in str(error):
                raise
            return numba.cfunc(signature, cache=False, **options)(function)

    return decorate


@cache
def _folder() -> str:
    """The cache folder of this very source: beside the package where that is writable, else in the user's cache."""
    text = hashlib.sha256()
    for file in sorted(PACKAGE.rglob("*.py")):
        content = file.read_bytes()
        if b"compiled" in content:  # every kernel, and the plain functions that are said to be compiled elsewhere
            text.update(file.relative_to(PACKAGE).as_posix().encode())
            text.update(content)
    name = f"kernels-{text.hexdigest()[:16]}"
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for parent in (PACKAGE / "__pycache__", home / "truenorth"):
        try:
            (parent / name).mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=parent / name):
                return str(parent / name)
        except OSError:
            continue
    return str(PACKAGE / "__pycache__")


@contextmanager
def _cache_folder(folder: str) -> Iterator[None]:
    """Numba's cache folder for the functions decorated inside; an environment's own choice is respected."""
    config: Any = numba.config
    before = config.CACHE_DIR
    if not before:
        config.CACHE_DIR = folder
    try:
        yield
    finally:
        config.CACHE_DIR = before
