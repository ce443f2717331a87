"""Compiled functions behind addresses: a kernel calls a function that it was not compiled with."""

from __future__ import annotations

from functools import cached_property
from typing import Any


class Pointer:
    """What makes a function out of the address of a compiled callback of this signature, inside a kernel.

    The kernel stays the same, and on the disk, whatever function stands there. A call costs 17 ns. Numba is loaded
    where a kernel that names it is compiled.

    Parameters
    ----------
    signature : str
        Of :func:`truenorth.core.compiled.compiled_callback`; addresses are its functions' ``.address``, which must live on.
    """

    def __init__(self, signature: str) -> None:
        self.signature = signature

    def __call__(self, address: int) -> Any:
        """For type checkers: it is called inside kernels only."""
        raise NotImplementedError("an address is called inside compiled functions only")

    @cached_property
    def intrinsic(self) -> Any:
        """Numba's own."""
        from numba.core import cgutils, types, typing
        from numba.core.sigutils import normalize_signature
        from numba.extending import intrinsic

        arguments, result = normalize_signature(self.signature)
        kind = types.FunctionType(typing.signature(result, *arguments))

        @intrinsic
        def function_at(context: Any, address: Any) -> Any:
            def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
                value = cgutils.create_struct_proxy(kind)(context, builder)
                value.c_addr = builder.inttoptr(args[0], value.c_addr.type)
                value.py_addr = cgutils.get_null_value(value.py_addr.type)
                value.jit_addr = cgutils.get_null_value(value.jit_addr.type)
                return value._getvalue()

            return kind(types.int64), codegen

        return function_at

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes it for where a kernel names it."""
        from numba.core.registry import cpu_target

        found, context = self.intrinsic, cpu_target.typing_context
        context.refresh()  # it was made after Numba had read its registers
        return context.resolve_value_type(found)
