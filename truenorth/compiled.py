"""One decorator for every compiled function of the library."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"nopython": True, "error_model": "numpy", "fastmath": False, "nogil": True}


def compiled(function: F | None = None, **options: Any) -> Any:
    """Compile a function with Numba: IEEE arithmetic, NumPy division rules, cached on disk.

    Where no cache folder is writable (a read-only installation), Numba raises at decoration time; the function
    is then compiled anew in each process instead.

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
        return numba.jit(cache=True, **(OPTIONS | options))(function)
    except RuntimeError as error:  # "cannot cache function ...: no locator available"
        if "cache" not in str(error):
            raise
        return numba.jit(cache=False, **(OPTIONS | options))(function)
