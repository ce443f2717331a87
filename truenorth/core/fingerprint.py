"""What the machine code of a compiled function depends on, as one digest.

Numba freezes into a kernel its own bytecode, the constants and the module-level values it names, and the code of every
compiled function it calls. The digest covers exactly these, through all calls: it changes where the machine code may
change, and stays where only a comment, a docstring, a line number, another function or the folder changes. Equal
sources thus share kernels across checkouts, and an edit compiles its dependents only.

A second digest names the code that is called without Numba (:mod:`~truenorth.core.ready`): of the same sources, and of the
arguments themselves in place of Numba's types of them. Neither loads Numba.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Callable, Iterable
from enum import Enum
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from truenorth.core.kernel_source import STEPS, KernelSource
from truenorth.core.pointers import Pointer
from truenorth.core.vectors import VectorStep

Remembered = type(cache(len))
FOREIGN = ("numpy", "numba", "math", "cmath", "builtins", "operator")  # of one version, and named by it
STARS = inspect.CO_VARARGS | inspect.CO_VARKEYWORDS  # the other flags change under a profiler

# Of the code of functions that were met, and their docstrings: names, in order too, and its text, as it stands in that of the
# function. It names no values, and stays the same.
_described: dict[tuple[CodeType, str | None], tuple[set[str], list[str], str]] = {}


class UnknownValueError(Exception):
    """A kernel names a value of a kind that the digest does not cover."""


def fingerprint(function: Callable[..., Any], options: dict[str, Any], signature: Any) -> str:
    """Digest of all that the machine code of a function for one signature is made from, the processor apart.

    Parameters
    ----------
    function : callable
        The Python function.
    options : dict
        What it is compiled with.
    signature : numba signature, or tuple of numba types
        Of its arguments.

    Raises
    ------
    UnknownValueError
        The function, or one that it calls, names a value of a kind that is not covered.
    """
    sources = _Sources(by_numba=True)
    sources.see(function)
    text = [_tools(), _of_options(options), _of_types(signature, sources)]
    text += sources.walk()
    return hashlib.sha256("\n".join(text).encode()).hexdigest()


def fingerprints_of_call(
    function: Callable[..., Any], options: dict[str, Any], arguments: tuple[Any, ...], processors: Iterable[str]
) -> list[str]:
    """Digests of all that the machine code for a call with such arguments is made from, Numba's version included.

    Parameters
    ----------
    function, options
        As of :func:`fingerprint`.
    arguments : tuple
        Numbers, arrays of numbers, and tuples of these; their kinds count, not their values.
    processors : iterable of str
        What the code is made for: a digest for each.

    Raises
    ------
    UnknownValueError
        As of :func:`fingerprint`; also an argument of another kind.
    """
    sources = _Sources(by_numba=False)
    sources.see(function)
    text = [_surroundings(), _of_options(options), *(_of_argument(argument, sources) for argument in arguments)]
    text += sources.walk()
    common = hashlib.sha256("\n".join(text).encode())
    digests = []
    for processor in processors:
        digest = common.copy()
        digest.update(processor.encode())
        digests.append(digest.hexdigest())
    return digests


@cache
def _tools() -> str:
    """Versions and settings that Numba's code depends on."""
    import llvmlite
    import numba

    config: Any = numba.config
    return repr((
        *(sys.implementation.name, sys.version_info[:2], numba.__version__, llvmlite.__version__, np.__version__),
        *(config.OPT, config.BOUNDSCHECK, config.LOOP_VECTORIZE, config.SLP_VECTORIZE, config.USING_SVML),
    ))  # fmt: skip


@cache
def _surroundings() -> str:
    """Versions, as they are found without loading Numba; its settings have their defaults."""
    versions = []
    for name in ("numba", "llvmlite"):
        found = find_spec(name)
        if found is None or found.origin is None:
            raise UnknownValueError(f"{name} is not installed")
        versions.append(Path(found.origin).with_name("_version.py").read_text(encoding="utf-8"))
    return repr((sys.implementation.name, sys.version_info[:2], np.__version__, versions))


class _Sources:
    """Functions in the order in which they were met, each described once.

    Parameters
    ----------
    by_numba : bool
        Whether steps with vectors are described as Numba has them, else as they are made: that loads no Numba.
    """

    def __init__(self, by_numba: bool) -> None:
        self.by_numba = by_numba
        self.order: list[Any] = []
        self.place: dict[int, int] = {}

    def see(self, function: Any) -> int:
        """The place of a function in the order; calls in a circle therefore end."""
        if id(function) not in self.place:
            self.place[id(function)] = len(self.order)
            self.order.append(function)
        return self.place[id(function)]

    def walk(self) -> list[str]:
        """Describe all functions; those met on the way are described too."""
        text = []
        for function in self.order:  # grows while it is walked
            text.append(self.of_function(function))
        return text

    def of_function(self, function: Any) -> str:
        code = function.__code__
        seen = code, function.__doc__
        if seen not in _described:  # kernels call the same functions
            names = _names(code)
            _described[seen] = names, sorted(names), repr(self.of_code(code, function.__doc__, names))
        names, in_order, text = _described[seen]
        scope = function.__globals__
        named = {name: self.of(scope[name], names) for name in in_order if name in scope}
        cells = [self.of(cell.cell_contents, names) for cell in function.__closure__ or ()]
        defaults = self.of(function.__defaults__, names)
        home = f"{function.__module__}.{code.co_qualname}"
        return f"({home!r}, {text}, {named!r}, {cells!r}, {defaults!r})"

    def of_code(self, code: CodeType, doc: str | None, names: set[str]) -> str:
        skip = 1 if code.co_consts and isinstance(doc, str) and code.co_consts[0] == doc else 0
        constants = [self.of(value, names) for value in code.co_consts[skip:]]
        variables = (code.co_varnames, code.co_freevars, code.co_cellvars, code.co_names)
        counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags & STARS)
        return repr((code.co_code, constants, variables, counts, code.co_exceptiontable))

    def of(self, value: Any, names: set[str]) -> str:
        """A value that a function names; `names` are those that it may ask a module for."""
        if isinstance(value, KernelSource):  # most of them
            return f"compiled({self.see(value.py_func)}, {_of_options(value.options)})"
        if isinstance(value, Enum):
            return f"{self._of_class(type(value), names)}.{value.name}"
        if value is None or isinstance(value, (bool, int, float, complex, str, bytes)):
            return f"{type(value).__name__} {value!r}"
        if isinstance(value, (tuple, list)):
            return f"{_name(type(value))}({', '.join(self.of(v, names) for v in value)})"
        if isinstance(value, (set, frozenset)):
            return f"set({', '.join(sorted(self.of(v, names) for v in value))})"
        if isinstance(value, (np.ndarray, np.generic)):
            array = np.asarray(value)
            return f"array({array.dtype!r}, {array.shape}, {array.flags.c_contiguous}, {array.tobytes()!r})"
        if isinstance(value, (Pointer, VectorStep)):
            return self.of(value.intrinsic, names) if self.by_numba else self._of_step(value)
        if isinstance(value, CodeType):
            return self.of_code(value, None, names)
        if isinstance(value, type):
            return self._of_class(value, names)
        if isinstance(value, Remembered):
            return self.of(value.__wrapped__, names)
        if isinstance(value, FunctionType) and value.__module__.split(".")[0] not in FOREIGN:
            return f"function({self.see(value)})"
        if isinstance(value, ModuleType):
            return self._of_module(value, names)
        if isinstance(value, np.dtype):
            return repr(value)
        if isinstance(value, (FunctionType, BuiltinFunctionType, np.ufunc)) or type(value).__module__ == "numpy":
            return f"{type(value).__name__} {getattr(value, '__module__', '')}.{value.__name__}"
        if "numba" in sys.modules:
            return self._of_numba(value)
        raise UnknownValueError(f"a kernel names {value!r}, of {type(value)}")

    def _of_numba(self, value: Any) -> str:
        from numba.core import types
        from numba.core.ccallback import CFunc
        from numba.core.dispatcher import Dispatcher
        from numba.core.extending import _Intrinsic

        if isinstance(value, Dispatcher):  # a user's own, by numba.jit
            return f"jit({self.see(value.py_func)}, {_of_options(value.targetoptions)})"
        if isinstance(value, CFunc):  # a user's own, by numba.cfunc
            return f"callback({self.see(value.__wrapped__)})"
        if isinstance(value, _Intrinsic):
            return f"intrinsic({self.see(value._defn)})"
        if isinstance(value, types.Type):
            return repr(value)
        raise UnknownValueError(f"a kernel names {value!r}, of {type(value)}")

    def _of_step(self, value: Pointer | VectorStep) -> str:
        if isinstance(value, Pointer):
            return f"pointer({value.signature}, {self.see(vars(Pointer)['intrinsic'].func)})"
        return f"vector({self.see(value.make)}, {value.width})"

    def _of_class(self, kind: type, names: set[str]) -> str:
        if issubclass(kind, Enum):
            return f"{_name(kind)}({', '.join(f'{m.name}={self.of(m.value, names)}' for m in kind)})"
        steps = getattr(kind, STEPS, {})
        chosen = [f"{name}={self.of(steps[name], names)}" for name in sorted(steps)]
        return f"{_name(kind)}{getattr(kind, '_fields', '')}{chosen or ''}"

    def _of_module(self, module: ModuleType, names: set[str]) -> str:
        if module.__name__.split(".")[0] in FOREIGN:
            return module.__name__
        held = {name: self.of(getattr(module, name), names) for name in sorted(names) if hasattr(module, name)}
        return f"{module.__name__} {held!r}"


def _of_options(options: dict[str, Any]) -> str:
    return repr(sorted(options.items()))


def _names(code: CodeType) -> set[str]:
    """What a function and the functions inside it look up by name."""
    inner = (value for value in code.co_consts if isinstance(value, CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _name(kind: type) -> str:
    return f"{kind.__module__}.{kind.__qualname__}"


def _of_argument(value: Any, sources: _Sources) -> str:
    """The kind of an argument, all of it that Numba makes a type of."""
    kind = type(value)
    if kind is np.ndarray and value.dtype.kind in "biufc":
        flags = value.flags
        layout = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return f"array({value.dtype.str}, {value.ndim}, {layout}, {flags.aligned}, {flags.writeable})"
    if isinstance(value, tuple):
        return f"{sources.of(kind, set())}({', '.join(_of_argument(v, sources) for v in value)})"
    if kind in (bool, float, complex, type(None)) or (kind is int and -(2**63) <= value < 2**63):
        return kind.__name__
    if isinstance(value, np.generic) and value.dtype.kind in "biufc":
        return f"number({value.dtype.str})"
    raise UnknownValueError(f"an argument {value!r}, of {kind}")


def _of_types(signature: Any, sources: _Sources) -> str:
    """The types of the arguments. Their own text does not tell two classes of one name apart, nor two functions."""
    from numba.core import types

    if isinstance(signature, tuple):
        return f"({', '.join(_of_types(t, sources) for t in signature)})"
    if not isinstance(signature, types.Type):
        return f"{_of_types(signature.args, sources)} -> {signature.return_type}"
    if isinstance(signature, types.Dispatcher):
        return sources.of(signature.dispatcher, set())
    if isinstance(signature, types.BaseTuple):
        kind, parts = getattr(signature, "instance_class", tuple), getattr(signature, "types", ())
        return f"{sources.of(kind, set())}{_of_types(tuple(parts), sources)}"
    return str(signature)
