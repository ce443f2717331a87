"""Vectors of several doubles inside kernels: what a register of the processor holds, named instead of hoped for.

LLVM makes vector instructions of loops as it sees fit, and not always where they pay: the product of a covariance took twice the
time of its arithmetic. A kernel that names vectors gets them; on a processor with shorter registers LLVM splits each into parts.
Every lane does what a loop over scalars would do, in the same order, and nothing is contracted: the bits are the same.

Of each step there are two, for 8 doubles (512 bits) and for 4 (256 bits): `load8(A, (i, j))` is ``A[i, j], .., A[i, j + 7]``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, cached_property
from typing import Any


class VectorStep:
    """One step with vectors, which kernels call; Numba is loaded where a kernel that names it is compiled.

    Parameters
    ----------
    make : callable
        Of the width: the function that :func:`numba.extending.intrinsic` takes.
    width : int
        Doubles in a vector.
    """

    def __init__(self, make: Callable[[int], Callable[..., Any]], width: int) -> None:
        self.make, self.width = make, width

    def __call__(self, *arguments: Any) -> Any:
        """For type checkers: it is called inside kernels only."""
        raise NotImplementedError("vectors live inside compiled functions only")

    @cached_property
    def intrinsic(self) -> Any:
        """Numba's own."""
        from numba.extending import intrinsic

        return intrinsic(self.make(self.width))

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes it for where a kernel names it."""
        from numba.core.registry import cpu_target

        found, context = self.intrinsic, cpu_target.typing_context
        context.refresh()  # it was made after Numba had read its registers
        return context.resolve_value_type(found)


@cache
def _vector(width: int) -> Any:
    """Numba's type of a vector."""
    from llvmlite import ir
    from numba.core import types
    from numba.extending import models, register_model

    class Vector(types.Type):
        """So many doubles in one register."""

        def __reduce__(self) -> Any:
            """A kernel from the disk that is given vectors, or gives one, has the type of this process."""
            return _vector, (width,)

    class VectorModel(models.PrimitiveModel):
        """As LLVM has it."""

        def __init__(self, manager: Any, kind: Any) -> None:
            super().__init__(manager, kind, ir.VectorType(ir.DoubleType(), width))

    register_model(Vector)(VectorModel)
    return Vector(name=f"vector of {width} doubles")


def _place(context: Any, builder: Any, signature: Any, args: Any, width: int) -> Any:
    """Where the vector stands that begins at an element, of an array and a tuple of indices."""
    from llvmlite import ir
    from numba.core import cgutils, types
    from numba.core.errors import TypingError

    kind, index = signature.args[0], cgutils.unpack_tuple(builder, args[1])
    if kind.layout != "C":
        raise TypingError(f"vectors stand in arrays that are contiguous, not in {kind}")
    index = [context.cast(builder, i, t, types.intp) for i, t in zip(index, signature.args[1], strict=True)]
    array = context.make_array(kind)(context, builder, args[0])
    first = cgutils.get_item_pointer(context, builder, kind, array, index, wraparound=False, boundscheck=False)
    return builder.bitcast(first, ir.VectorType(ir.DoubleType(), width).as_pointer())


def _make_zero(width: int) -> Callable[..., Any]:
    vector = _vector(width)

    def zero(typing: Any) -> Any:
        return vector(), lambda context, builder, signature, args: context.get_constant_null(vector)

    return zero


def _make_load(width: int) -> Callable[..., Any]:
    vector = _vector(width)

    def load(typing: Any, array: Any, index: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.load(_place(context, builder, signature, args, width), align=8)

        return vector(array, index), code

    return load


def _make_load3(width: int) -> Callable[..., Any]:
    """Of a row of three: two numbers and one, so that none behind the row is touched."""
    vector = _vector(width)

    def load(typing: Any, array: Any, index: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            from llvmlite import ir

            two = _place(context, builder, signature, args, 2)
            first = builder.bitcast(two, ir.DoubleType().as_pointer())
            third = builder.load(builder.gep(first, [ir.Constant(ir.IntType(64), 2)]), align=8)
            none = ir.Constant(ir.VectorType(ir.DoubleType(), 2), [0.0, 0.0])
            rest = builder.insert_element(none, third, ir.Constant(ir.IntType(32), 0))
            return _mixed(builder, builder.load(two, align=8), rest, (0, 1, 2, 3))

        return vector(array, index), code

    return load


def _make_store(width: int) -> Callable[..., Any]:
    from numba.core import types

    vector = _vector(width)

    def store(typing: Any, array: Any, index: Any, values: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            builder.store(args[2], _place(context, builder, signature, args, width), align=8)
            return context.get_dummy_value()

        return types.void(array, index, vector), code

    return store


def _make_store3(width: int) -> Callable[..., Any]:
    """Into a row of three: the fourth number goes nowhere."""
    from numba.core import types

    vector = _vector(width)

    def store(typing: Any, array: Any, index: Any, values: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            from llvmlite import ir

            two = _place(context, builder, signature, args, 2)
            builder.store(_mixed(builder, args[2], args[2], (0, 1)), two, align=8)
            third = builder.gep(builder.bitcast(two, ir.DoubleType().as_pointer()), [ir.Constant(ir.IntType(64), 2)])
            builder.store(builder.extract_element(args[2], ir.Constant(ir.IntType(32), 2)), third, align=8)
            return context.get_dummy_value()

        return types.void(array, index, vector), code

    return store


def _make_times(width: int) -> Callable[..., Any]:
    from numba.core import types

    vector = _vector(width)

    def times(typing: Any, factor: Any, values: Any) -> Any:
        return vector(types.float64, vector), lambda context, builder, signature, args: builder.fmul(
            _spread(builder, args[0], width), args[1]
        )

    return times


def _make_spread(width: int) -> Callable[..., Any]:
    from numba.core import types

    vector = _vector(width)

    def spread(typing: Any, value: Any) -> Any:
        return vector(types.float64), lambda context, builder, signature, args: _spread(builder, args[0], width)

    return spread


def _spread(builder: Any, value: Any, width: int) -> Any:
    """A number in every lane."""
    from llvmlite import ir

    none = ir.Constant(ir.VectorType(ir.DoubleType(), width), ir.Undefined)
    one = builder.insert_element(none, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(one, none, ir.Constant(ir.VectorType(ir.IntType(32), width), [0] * width))


def _make_of_two(operation: str) -> Callable[[int], Callable[..., Any]]:
    """A step that does one of LLVM's operations in each lane of two vectors."""

    def make(width: int) -> Callable[..., Any]:
        vector = _vector(width)

        def step(typing: Any, a: Any, b: Any) -> Any:
            return vector(vector, vector), lambda context, builder, signature, args: getattr(builder, operation)(*args)

        return step

    return make


def _make_turn(width: int) -> Callable[..., Any]:
    """Of 4 vectors of 4: by pairs of halves, and then by pairs of numbers."""
    from numba.core import types

    vector = _vector(width)
    four = types.UniTuple(vector, 4)
    halves = ((0, 1, 4, 5), (2, 3, 6, 7))
    pairs = ((0, 4, 2, 6), (1, 5, 3, 7))

    def turn(typing: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            a, b, c, d = args
            found = []
            for half in halves:
                ac, bd = _mixed(builder, a, c, half), _mixed(builder, b, d, half)
                found += [_mixed(builder, ac, bd, pair) for pair in pairs]
            return context.make_tuple(builder, four, found)

        return four(vector, vector, vector, vector), code

    return turn


def _mixed(builder: Any, a: Any, b: Any, places: tuple[int, ...]) -> Any:
    """Numbers of two vectors, those of the second counted on from the first."""
    from llvmlite import ir

    return builder.shuffle_vector(a, b, ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places)))


zero4, zero8 = VectorStep(_make_zero, 4), VectorStep(_make_zero, 8)
load4, load8 = VectorStep(_make_load, 4), VectorStep(_make_load, 8)
load3, store3 = VectorStep(_make_load3, 4), VectorStep(_make_store3, 4)  # a row of three; in the register also a zero
store4, store8 = VectorStep(_make_store, 4), VectorStep(_make_store, 8)
spread4, spread8 = VectorStep(_make_spread, 4), VectorStep(_make_spread, 8)  # a number in every lane
times4, times8 = VectorStep(_make_times, 4), VectorStep(_make_times, 8)  # of a number and a vector
product8 = VectorStep(_make_of_two("fmul"), 8)  # of two vectors, lane by lane
plus4, plus8 = VectorStep(_make_of_two("fadd"), 4), VectorStep(_make_of_two("fadd"), 8)
minus4, minus8 = VectorStep(_make_of_two("fsub"), 4), VectorStep(_make_of_two("fsub"), 8)
each4 = VectorStep(_make_of_two("fmul"), 4)  # product lane by lane
over4, over8 = VectorStep(_make_of_two("fdiv"), 4), VectorStep(_make_of_two("fdiv"), 8)
transposed4 = VectorStep(_make_turn, 4)  # rows of a 4 x 4 matrix from its columns
