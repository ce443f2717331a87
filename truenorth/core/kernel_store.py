"""Compiled kernels on the disk: one file for each function and signature, named by what its code depends on.

A file never changes what it means, so that any number of processes and checkouts read and write one folder at once: a
file is written aside and renamed, and two processes that compile the same kernel write the same file. Numba's own
cache keeps an index and numbered files instead; two processes that compile two signatures at once can leave each other's
code under the wrong number.
"""

from __future__ import annotations

import hashlib
import io
import logging
import pickle
import re
import sys
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

from numba.core.compiler import CompileResult
from numba.core.environment import Environment, _rebuild_env, lookup_environment
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from truenorth.core.fingerprint import UnknownValueError, fingerprint
from truenorth.core.inner_library import KIND, InnerLibrary, ReadyLibrary
from truenorth.core.kernel_folder import folders, prune_once, read, write, write_folder
from truenorth.core.kernel_lock import KernelLock

LOG = logging.getLogger(__name__)  # one line of level INFO for each kernel that has to be compiled


class KernelStore:
    """What Numba asks for a kernel of one function, and hands each that it compiled (its interface of caches).

    Parameters
    ----------
    function, options
        As of :func:`truenorth.core.fingerprint.fingerprint`.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self.function = function
        self.options = options
        self.files: dict[Any, str | None] = {}  # the name of the file of a signature, as it was when first asked for
        self.locks: dict[Any, KernelLock | None] = {}  # of the signatures that are asked for now
        self.kernel: Any = None  # the last that was found or compiled

    @property
    def cache_path(self) -> str:
        """The folder that is written to; empty where there is none."""
        return str(write_folder() or "")

    def load_overload(self, signature: Any, target: Any) -> Any:
        """The kernel of a signature, or None.

        Code from the disk needs Numba's runtime only; what it knows of NumPy for compiling takes .3 s to load.
        """
        rtsys.initialize(target)
        name = self._file(signature, target.codegen())
        kernel = self._found(name, target)
        if kernel is None and name and signature in self.locks and (folder := write_folder()) is not None:
            self.locks[signature] = lock = KernelLock(folder / name)
            lock.take()
            kernel = self._found(name, target)  # another process has compiled it meanwhile
        if kernel is not None:
            self.kernel = kernel
            return kernel
        if name and "<locals>" in self.function.__code__.co_qualname:
            # The linker takes what has one name for one function, and a function made anew has the name of the last.
            self.function.__qualname__ = f"{self.function.__code__.co_qualname}.{Path(name).stem[-16:]}"
        LOG.info("compiling %s", self.function.__qualname__)
        return None

    def _found(self, name: str | None, target: Any) -> Any:
        for folder in folders() if name else ():
            payload = _read(folder / str(name))
            if payload is not None:
                return _rebuilt(target, "callback" in self.options, *payload)
        return None

    def guarded(self, compile: Callable[..., Any]) -> Callable[..., Any]:
        """Numba's call that finds or compiles a kernel and keeps it; no other process compiles the same one meanwhile."""

        @wraps(compile)
        def alone(signature: Any) -> Any:
            self.locks[signature] = None
            try:
                return compile(signature)
            finally:
                lock = self.locks.pop(signature, None)
                if lock is not None:
                    lock.release()

        return alone

    def is_there(self, signature: Any, codegen: Any) -> bool:
        """Whether the kernel of a signature is on the disk."""
        name = self._file(signature, codegen)
        return name is not None and any((folder / name).exists() for folder in folders())

    def is_under_way(self, signature: Any, codegen: Any) -> bool:
        """Whether another process compiles it now."""
        name = self._file(signature, codegen)
        return name is not None and any(KernelLock(folder / name).taken() for folder in folders())

    def save_overload(self, signature: Any, kernel: Any) -> None:
        """Keep a kernel; one that holds an address of this process is not kept."""
        self.kernel = kernel
        kernel.library._ensure_finalized()
        if not isinstance(kernel.library, InnerLibrary):
            for environment in kernel._find_referenced_environments():  # of the kernels that it took up
                kernel.codegen.set_env(environment.env_name, environment)
        folder = write_folder()
        name = self._file(signature, kernel.codegen)
        if folder is None or name is None or kernel.library.has_dynamic_globals or kernel.lifted:
            return
        try:
            write(folder / name, dumps(kernel._reduce()))
        except OSError:  # a full disk costs the next process a compilation, not this one its answer
            return
        prune_once(folder)

    def flush(self) -> None:
        """Forget what is known of the sources, as Numba asks before it compiles anew."""
        self.files.clear()

    enable = disable = flush

    def _file(self, signature: Any, codegen: Any) -> str | None:
        if signature not in self.files:
            try:
                text = f"{fingerprint(self.function, self.options, signature)} {codegen.magic_tuple()}"
            except UnknownValueError:
                self.files[signature] = None
            else:
                readable = re.sub(r"[^\w.]", "", f"{self.function.__module__}.{self.function.__code__.co_qualname}")
                self.files[signature] = f"{readable[-100:]}-{hashlib.sha256(text.encode()).hexdigest()[:32]}.kernel"
        return self.files[signature]


def _rebuilt(target: Any, callback: bool, code: Any, fndesc: Any, environment: Any, *rest: Any) -> Any:
    """A kernel from what it was reduced to: with the code that it is used for, Numba's own rebuilds all of it."""
    if callback:
        kernel: Any = CompileResult._rebuild(target, code, fndesc, environment, *rest)
        kernel.library.machine_code = code[2][0]
        return kernel._replace(referenced_envs=rest[-1])
    signature, objectmode, lifted, annotation, initial, environments = rest
    for begin in initial:
        begin()
    kind: Any = InnerLibrary if code[1] == KIND else ReadyLibrary
    library = kind._unserialize(target.codegen(), code)
    result: Any = CompileResult
    kernel = result(
        typing_context=target.typing_context,
        target_context=target,
        library=library,
        environment=environment,
        entry_point=target.get_executable(library, fndesc, environment),
        fndesc=fndesc,
        type_annotation=annotation,
        signature=signature,
        objectmode=objectmode,
        lifted=lifted,
        typing_error=None,
        call_helper=None,
        metadata=None,
        reload_init=initial,
        referenced_envs=environments,
    )
    if kind is ReadyLibrary:
        for other in environments:  # of the kernels that it took up
            library.codegen.set_env(other.env_name, other)
    return kernel


class _Unpickler(pickle.Unpickler):
    """Reads a kernel without the modules of Numba that parts of its code come from.

    Code of ours that makes an array has taken up Numba's own, whose environment Numba ties to its module: what that knows of NumPy
    for compiling takes .03 s to load. Compiled code asks its environment for constants only, never for names of the module.
    """

    def find_class(self, module: str, name: str, /) -> Any:
        """What a name stands for."""
        if (module, name) == ("numba.core.environment", "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


def _environment(module: str, constants: Any, name: str) -> Any:
    """An environment; one of Numba's own code has nothing of its module but the name, where that is not loaded."""
    if module in sys.modules or not module.startswith("numba."):
        return _rebuild_env(module, constants, name)
    found = lookup_environment(name)
    if found is None:
        found = Environment({"__name__": module})
        found.consts[:] = constants
        found.env_name = name
        Environment._memo[name] = found
    return found


def _read(path: Path) -> Any:
    """What a file holds; None where it is missing or torn."""
    content = read(path)
    try:
        return None if content is None else _Unpickler(io.BytesIO(content)).load()
    except ImportError:  # of a module that was run from a file without a name to import it by
        return None


def machine_code_of(kernel: Any) -> bytes | None:
    """The object file of a kernel, where its code needs no object of Python's and no address of this process."""
    library = kernel.library
    from_disk = hasattr(library, "machine_code")
    others = kernel.referenced_envs if from_disk else kernel._find_referenced_environments()
    if any(environment.consts for environment in (kernel.environment, *others)):
        return None
    if kernel.lifted or library.has_dynamic_globals:
        return None
    try:
        return bytes(library.machine_code if from_disk else library._get_compiled_object())
    except (ValueError, RuntimeError):  # Numba has none
        return None
