"""One decorator for every compiled function of the library."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core.ccallback import CFunc
from numba.core.sigutils import normalize_signature

from truenorth.core.kernel_store import KernelStore

F = TypeVar("F", bound=Callable[..., Any])

OPTIONS: dict[str, Any] = {"nopython": True, "error_model": "numpy", "fastmath": False, "nogil": True}


def compiled(function: F | None = None, **options: Any) -> Any:
    """Compile a function with Numba: IEEE arithmetic, NumPy division rules, cached on disk.

    A kernel on the disk is named by all that its code depends on (:mod:`~truenorth.core.fingerprint`), where Numba's
    own cache watches only the file that a kernel stands in, not those that it calls into. Where no folder can be
    written to, the function is compiled anew in each process.

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
    dispatcher = numba.jit(**(OPTIONS | options))(function)
    dispatcher._cache = KernelStore(dispatcher.py_func, dispatcher.targetoptions)
    return dispatcher


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
        options = {"nopython": True, "error_model": "numpy"}
        callback: Any = CFunc(function, normalize_signature(signature), locals={}, options=options)
        callback._cache = KernelStore(function, options | {"callback": True})
        callback.compile()
        return callback

    return decorate
