"""Code of kernels that other kernels take up: neither optimised to the end nor made into machine code by itself.

Numba makes finished code of every function, also of one that only other functions call, and they take it up, optimise it
again, and make machine code of it again: a quarter of the time that the closed loop took to compile. Here an inner kernel
stays as it is after inlining; the kernel that Python calls is optimised with all that it took up.
"""

from __future__ import annotations

import gc
from typing import Any, ClassVar

from llvmlite import binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

KIND = "inner"  # of code without addresses, on the disk


class _Codegen:
    """Numba's generator of code, for a library without addresses: there is no place to note an environment at."""

    def __init__(self, codegen: Any) -> None:
        self.codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self.codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing: the kernel that takes the code up notes it."""


class InnerLibrary(JITCodeLibrary):
    """What a kernel hands to those that call it."""

    @property
    def codegen(self) -> Any:
        """Numba's, which notes no environment."""
        return _Codegen(self._codegen)

    def _optimize_final_module(self) -> None:
        """Inline; the rest is done where it is taken up."""
        manager, builder = self._codegen._module_pass_manager(
            loop_vectorize=False, slp_vectorize=False, opt=self._codegen._opt_level, cost="cheap"
        )
        manager.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """None: 0."""
        self._ensure_finalized()
        return 0

    def serialize_using_object_code(self) -> Any:
        """Name, kind and code, as Numba keeps a library."""
        self._ensure_finalized()
        return (self.name, KIND, self._get_module_for_linking().as_bitcode())

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, _, code = state
        self = cls(codegen, name)
        self._final_module = self._shared_module = llvm.parse_bitcode(code)
        self._finalize_final_module()
        return self


class ReadyLibrary(JITCodeLibrary):
    """Machine code from the disk, of a kernel that Python calls: other kernels take up their own (`InnerLibrary`).

    Numba's own library reads the code that others would take up as well, and lists the names in it: half of the time that a
    kernel takes to load.
    """

    machine_code: bytes  # an object file

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, _, (machine_code, _) = state
        self = cls(codegen, name)
        self.machine_code = machine_code  # Numba lets go of it
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()
        return self

    def get_pointer_to_function(self, name: str) -> int:
        """Where a function of this library begins."""
        self._ensure_finalized()
        return int(self._codegen._engine.get_function_address(name))


class SteadyCompiler(Compiler):
    """Numba's compiler, without the search for garbage: among a million small objects it takes a tenth of the time."""

    kept_as: ClassVar[dict[str, str]] = {}  # what tells its kernels from others on the disk

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        if not gc.isenabled():  # by a kernel that calls this one, or by the user
            return super().compile_extra(func)
        gc.disable()
        try:
            return super().compile_extra(func)
        finally:
            gc.enable()


class InnerCompiler(SteadyCompiler):
    """The same, of a function into an :class:`InnerLibrary`."""

    kept_as: ClassVar[dict[str, str]] = {"library": KIND}

    def compile_extra(self, func: Any) -> Any:
        """Compile a Python function."""
        self.state.library = InnerLibrary(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)
