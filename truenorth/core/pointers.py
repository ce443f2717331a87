"""Compiled functions behind addresses: a kernel calls a function that it was not compiled with."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def pointer(signature: Any) -> Any:
    """What makes a function out of the address of a compiled callback of this signature, inside a kernel.

    The kernel stays the same, and on the disk, whatever function stands there. A call costs 17 ns.

    Parameters
    ----------
    signature : numba signature
        Of :func:`truenorth.core.compiled.compiled_callback`; addresses are its functions' ``.address``, which must live on.
    """
    kind = types.FunctionType(signature)

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
