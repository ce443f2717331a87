"""One decorator for every compiled function of the library."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cached_property, partial
from typing import Any, NamedTuple, TypeVar

from truenorth.core import ready
from truenorth.core.kernel_source import KernelSource

F = TypeVar("F", bound=Callable[..., Any])

COUNT = "_nrt"  # Numba's switch of its runtime: memory of its own, and counts of references
OPTIONS: dict[str, Any] = {"nopython": True, "error_model": "numpy", "fastmath": False, "nogil": True, COUNT: True}
INNER = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


class Found(NamedTuple):
    """How often kernels of each kind of arguments came from the disk, and how often they were compiled."""

    cache_hits: dict[Any, int]
    cache_misses: dict[Any, int]


class made_once(cached_property):  # noqa: N801 (a decorator)
    """As :class:`functools.cached_property`, made by one thread only.

    Since Python 3.12 that one lets several threads make a value each, of which the last stays: a kernel that threads call for the
    first time had several dispatchers of Numba, and what one had compiled was looked for in another.
    """

    def __init__(self, func: Callable[[Any], Any]) -> None:
        super().__init__(func)
        self.making = threading.RLock()  # of this name alone: what is made under it may wait for Numba's own lock

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        with self.making:
            return super().__get__(instance, owner)


class Kernel(KernelSource):
    """A compiled function: called by its machine code where that is on the disk, else by Numba, which is loaded then.

    Other kernels call the function without the code that unpacks Python's arguments, a third of the time that
    compilation takes; that code is made only for what Python calls.
    """

    def __init__(
        self, function: Callable[..., Any], options: dict[str, Any], prepare: Callable[[], None] | None = None
    ) -> None:
        super().__init__(function, options)
        self.prepare = prepare
        self._count = function.__code__.co_argcount
        self._ready: dict[Any, Callable[..., Any]] = {}  # what is called, by the kinds of the arguments

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        kind = ready.kind_of(arguments)
        call = self._ready.get(kind)
        return self._first(kind, arguments) if call is None else call(*arguments)

    def _first(self, kind: Any, arguments: tuple[Any, ...]) -> Any:
        """Call with arguments of a kind that was not there yet in this process: by machine code from the disk, else by Numba."""
        name, use = self._file(arguments), partial(ready.function_of, self.py_func)
        call = ready.found(name, use)
        if call is not None:
            self._ready[kind] = call
            return call(*arguments)
        result = self.dispatcher(*arguments)
        self._ready[kind] = self.dispatcher
        if name is not None:
            from truenorth.core.kernel_store import machine_code_of

            ready.keep(name, machine_code_of(self.dispatcher.overloads[self._types(arguments)]), use)
        return result

    def _file(self, arguments: tuple[Any, ...]) -> ready.Name | None:
        """The name of the file of machine code; none for calls that leave out arguments."""
        return ready.name_of(self.py_func, self.options, arguments) if len(arguments) == self._count else None

    @made_once
    def dispatcher(self) -> Any:
        """Numba's own, for calls from Python."""
        from truenorth.core.inner_library import SteadyCompiler

        return self._dispatcher(self.options, SteadyCompiler)

    @made_once
    def inner(self) -> Any:
        """Numba's own, for calls from other kernels."""
        from truenorth.core.inner_library import InnerCompiler

        return self._dispatcher(self.options | INNER, InnerCompiler)

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes a kernel for that another one names."""
        return self.inner._numba_type_

    def _dispatcher(self, options: dict[str, Any], compiler: Any) -> Any:
        import numba

        from truenorth.core.kernel_store import KernelStore

        if self.prepare is not None:
            self.prepare()
        dispatcher: Any = numba.jit(pipeline_class=compiler, **options)(self.py_func)
        dispatcher._cache = KernelStore(self.py_func, options | compiler.kept_as)
        dispatcher.compile = dispatcher._cache.guarded(dispatcher.compile)
        return dispatcher

    def is_there(self, *arguments: Any) -> bool:
        """Whether a call with such arguments compiles nothing."""
        if ready.kind_of(arguments) in self._ready:
            return True
        if ready.is_there(self._file(arguments)):
            return True
        types = self._types(arguments)
        return types in self.dispatcher.overloads or self.dispatcher._cache.is_there(types, self._codegen)

    def is_under_way(self, *arguments: Any) -> bool:
        """Whether another process compiles the kernel for such arguments now."""
        return bool(self.dispatcher._cache.is_under_way(self._types(arguments), self._codegen))

    def _types(self, arguments: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(self.dispatcher.typeof_pyval(argument) for argument in arguments)

    @property
    def _codegen(self) -> Any:
        return self.dispatcher.targetctx.codegen()

    @property
    def stats(self) -> Found:
        """What was found on the disk, and what was compiled."""
        by_numba = vars(self).get("dispatcher")
        by_itself = {kind: 1 for kind, call in self._ready.items() if call is not by_numba}
        if by_numba is None:
            return Found(by_itself, {})
        return Found(by_itself | by_numba.stats.cache_hits, by_numba.stats.cache_misses)

    @property
    def signatures(self) -> Any:
        """The kinds of arguments that it was called with."""
        return list(self._ready)


def compiled(function: F | None = None, *, prepare: Callable[[], None] | None = None, **options: Any) -> Any:
    """Compile a function with Numba where it is first called: IEEE arithmetic, NumPy division rules, cached on disk.

    A kernel on the disk is named by all that its code depends on (:mod:`~truenorth.core.fingerprint`), where Numba's
    own cache watches only the file that a kernel stands in, not those that it calls into. Where no folder can be
    written to, the function is compiled anew in each process.

    Parameters
    ----------
    function : callable
        The function; may be left out when options are given (``@compiled(forceinline=True)``).
    prepare : callable, optional
        What is done before Numba is given the function.
    **options
        Passed on to :func:`numba.jit`.

    Returns
    -------
    Kernel, or a decorator when `function` is left out.
    """
    if function is None:
        return lambda f: compiled(f, prepare=prepare, **options)
    return Kernel(function, OPTIONS | options, prepare)


def borrowing(function: F | None = None, **options: Any) -> Any:
    """Compile a step of a loop, which works in arrays that its caller holds: as :func:`compiled`, without reference counts.

    Numba counts up and down, atomically, each array of each tuple that a function is given: 5 ns an array, twice the time of
    the arithmetic where a step is given a workspace. A function that borrows need not count. It must make no array (Numba
    refuses that), and neither return one nor call a function that does: nothing would hold it, or let it go. A test watches
    over that.
    """
    return compiled(function, **(options | {COUNT: False}))


class Callback(KernelSource):
    """A compiled function behind an address; made, or loaded from the disk, where it is first asked for.

    Parameters
    ----------
    function : callable
        The Python function, of what Numba understands; it may call other kernels.
    signature : str
        Numba's, of arguments and result.
    """

    def __init__(self, function: Callable[..., Any], signature: str) -> None:
        super().__init__(function, {"nopython": True, "error_model": "numpy"})
        self.signature = signature

    def __call__(self, *arguments: Any) -> Any:
        """Call the Python function."""
        return self.py_func(*arguments)

    @made_once
    def compiled(self) -> Any:
        """Numba's own, which kernels take as an argument."""
        import numba.experimental.function_type  # noqa: F401 (it registers the type)
        from numba.core.ccallback import CFunc
        from numba.core.sigutils import normalize_signature

        from truenorth.core.kernel_store import KernelStore

        callback: Any = CFunc(self.py_func, normalize_signature(self.signature), locals={}, options=self.options)
        callback._cache = KernelStore(self.py_func, self.options | {"callback": True})
        callback.compile()
        return callback

    @made_once
    def address(self) -> int:
        """Where the compiled function stands in this process; this object must live on."""
        name = ready.name_of(self.py_func, self.options | {"callback": self.signature}, ())
        use = partial(ready.callback_of, self.py_func)
        found = ready.found(name, use)
        if found is not None:
            address, self._held = found
            return address
        if name is not None:
            from truenorth.core.kernel_store import machine_code_of

            ready.keep(name, machine_code_of(self.compiled._cache.kernel), use)
        return int(self.compiled.address)


def compiled_callback(signature: str) -> Callable[[Callable[..., Any]], Callback]:
    """Compile a function that kernels take as an *argument* or by its address, with a declared signature.

    A dispatcher or closure as an argument would make each kernel be compiled anew for each such function, and miss the
    disk cache; one with a declared signature is a pointer, and all functions of that signature share one kernel.

    Parameters
    ----------
    signature : str
        Of Numba's, such as ``"void(float64[::1], float64[::1], float64[::1])"``.

    Returns
    -------
    decorator
        Of functions.
    """
    return lambda function: Callback(function, signature)
