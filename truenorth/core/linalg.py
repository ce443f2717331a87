"""Matrix work of the recursions: small symmetric and square matrices, padded, without BLAS and without allocation.

A matrix of n rows lives in the corner of an N x N array with zeros beyond n; N is the next multiple of 4, beyond 16 of 8.
The zeros change no bit of a result. Each function takes `size`, a tuple of N nothings, first: its length is part of its
*type*, so that Numba compiles every function once for each N with loops of constant length, and one source serves all.
Rows are worked on in vectors by name (:mod:`truenorth.core.vectors`), 8 columns at a time and then 4. Left to LLVM, such
loops are unrolled or become vectors as it likes: the product of a covariance took twice as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing
from truenorth.core.vectors import (
    each4,
    load4,
    load8,
    minus4,
    minus8,
    over4,
    over8,
    plus4,
    plus8,
    spread4,
    spread8,
    store4,
    store8,
    times4,
    times8,
    transposed4,
    zero4,
    zero8,
)

Array = NDArray[np.float64]
Size = tuple[Any, ...]

SMALL = 16  # rows up to which sizes go in steps of 4; beyond, of 8: each size of the closed loop takes 50 s to compile


def padded(n: int) -> Size:
    """Give the `size` of matrices with `n` rows: a tuple as long as the next multiple of 4, beyond 16 rows of 8."""
    step = 4 if n <= SMALL else 8
    return (None,) * (step * -(-n // step))


@borrowing(forceinline=True)
def load(size: Size, source: Array, M: Array) -> None:
    """``M = source``, with `source` (rows, n) in the corner of `M` (at least as many rows, N); the rest stays."""
    copy_corner(source, M, source.shape[0], source.shape[1])


@borrowing(forceinline=True)
def copy_corner(A: Array, B: Array, rows: int, columns: int) -> None:
    """``B = A`` in so many rows and columns; the last vector of a row overlaps the one before it."""
    for i in range(rows):
        j = 0
        while j + 8 <= columns:
            store8(B, (i, j), load8(A, (i, j)))
            j += 8
        if columns >= 8:
            if j < columns:
                store8(B, (i, columns - 8), load8(A, (i, columns - 8)))
        else:
            while j < columns:
                B[i, j] = A[i, j]
                j += 1


@borrowing(forceinline=True)
def transpose(size: Size, A: Array, B: Array) -> None:
    """``B = A'``; `B` is not `A`."""
    for i in range(0, len(size), 4):
        for j in range(0, len(size), 4):
            transpose_block(A, i, j, B)


@borrowing(forceinline=True)
def transpose_block(A: Array, i: int, j: int, B: Array) -> None:
    """The 4 x 4 block of `A` at (i, j) becomes that of ``B = A'`` at (j, i)."""
    rows = load4(A, (i, j)), load4(A, (i + 1, j)), load4(A, (i + 2, j)), load4(A, (i + 3, j))
    a, b, c, d = transposed4(rows[0], rows[1], rows[2], rows[3])
    store4(B, (j, i), a)
    store4(B, (j + 1, i), b)
    store4(B, (j + 2, i), c)
    store4(B, (j + 3, i), d)


@borrowing(forceinline=True)
def dot(size: Size, a: Array, b: Array) -> float:
    """``a' b``."""
    total = 0.0
    for k in range(len(size)):
        total += a[k] * b[k]
    return total


@borrowing(forceinline=True)
def divide(size: Size, a: Array, by: float, b: Array) -> None:
    """``b = a / by``."""
    j = 0
    while j + 8 <= len(size):
        store8(b, (j,), over8(load8(a, (j,)), spread8(by)))
        j += 8
    if j < len(size):
        store4(b, (j,), over4(load4(a, (j,)), spread4(by)))


@borrowing(forceinline=True)
def add_times(size: Size, x: Array, k: Array, times: float) -> None:
    """``x = x + k times``."""
    j = 0
    while j + 8 <= len(size):
        store8(x, (j,), plus8(load8(x, (j,)), times8(times, load8(k, (j,)))))
        j += 8
    if j < len(size):
        store4(x, (j,), plus4(load4(x, (j,)), times4(times, load4(k, (j,)))))


@borrowing(forceinline=True)
def add_difference(size: Size, x: Array, a: Array, b: Array, times: float) -> None:
    """``x = x + (a - b times)``."""
    j = 0
    while j + 8 <= len(size):
        store8(x, (j,), plus8(load8(x, (j,)), minus8(load8(a, (j,)), times8(times, load8(b, (j,))))))
        j += 8
    if j < len(size):
        store4(x, (j,), plus4(load4(x, (j,)), minus4(load4(a, (j,)), times4(times, load4(b, (j,))))))


@borrowing(forceinline=True)
def transposed_times(size: Size, A: Array, x: Array, y: Array) -> None:
    """``y = A' x``: for a symmetric `A` the product itself; the transpose runs along rows."""
    j = 0
    while j + 8 <= len(size):
        total = zero8()
        for k in range(len(size)):
            total = plus8(total, times8(x[k], load8(A, (k, j))))
        store8(y, (j,), total)
        j += 8
    if j < len(size):
        rest = zero4()
        for k in range(len(size)):
            rest = plus4(rest, times4(x[k], load4(A, (k, j))))
        store4(y, (j,), rest)


@borrowing(forceinline=True)
def dot_at(columns: Any, a: Array, b: Array) -> float:
    """``a' b`` of an `a` that is zero but at some places."""
    total = 0.0
    for k in columns:
        total += a[k] * b[k]
    return total


@borrowing(forceinline=True)
def transposed_times_at(size: Size, columns: Any, A: Array, x: Array, y: Array) -> None:
    """``y = A' x`` of an `x` that is zero but at some places: the bits of :func:`transposed_times`."""
    j = 0
    while j + 8 <= len(size):
        total = zero8()
        for k in columns:
            total = plus8(total, times8(x[k], load8(A, (k, j))))
        store8(y, (j,), total)
        j += 8
    if j < len(size):
        rest = zero4()
        for k in columns:
            rest = plus4(rest, times4(x[k], load4(A, (k, j))))
        store4(y, (j,), rest)


@borrowing(forceinline=True)
def multiply(size: Size, A: Array, B: Array, C: Array) -> None:
    """``C = A B``; `C` is neither `A` nor `B`."""
    for i in range(0, len(size), 4):
        four_rows(size, A, B, None, i, len(size), C)


@borrowing(forceinline=True)
def four_rows(size: Size, A: Array, B: Array, Q: Array | None, i: int, columns: int, C: Array) -> None:
    """Rows ``i .. i + 3`` of ``C = A B + Q``, as many columns as asked for, a multiple of 4."""
    four_rows_within(len(size), A, B, Q, i, 0, columns, C)


@borrowing(forceinline=True)
def four_rows_within(inner: int, A: Array, B: Array, Q: Array | None, i: int, first: int, stop: int, C: Array) -> None:
    """Rows ``i .. i + 3`` of ``C = A B + Q``, columns from `first` to before `stop`, multiples of 4; `inner` terms of each sum.

    Four rows by eight columns stand in registers: each row of `B` is read once for four of `C`.
    """
    j = first
    while j + 8 <= stop:
        a, b, c, d = zero8(), zero8(), zero8(), zero8()
        for k in range(inner):
            row = load8(B, (k, j))
            a = plus8(a, times8(A[i, k], row))
            b = plus8(b, times8(A[i + 1, k], row))
            c = plus8(c, times8(A[i + 2, k], row))
            d = plus8(d, times8(A[i + 3, k], row))
        if Q is not None:
            a, b = plus8(a, load8(Q, (i, j))), plus8(b, load8(Q, (i + 1, j)))
            c, d = plus8(c, load8(Q, (i + 2, j))), plus8(d, load8(Q, (i + 3, j)))
        store8(C, (i, j), a)
        store8(C, (i + 1, j), b)
        store8(C, (i + 2, j), c)
        store8(C, (i + 3, j), d)
        j += 8
    if j < stop:
        e, f, g, h = zero4(), zero4(), zero4(), zero4()
        for k in range(inner):
            part = load4(B, (k, j))
            e = plus4(e, times4(A[i, k], part))
            f = plus4(f, times4(A[i + 1, k], part))
            g = plus4(g, times4(A[i + 2, k], part))
            h = plus4(h, times4(A[i + 3, k], part))
        if Q is not None:
            e, f = plus4(e, load4(Q, (i, j))), plus4(f, load4(Q, (i + 1, j)))
            g, h = plus4(g, load4(Q, (i + 2, j))), plus4(h, load4(Q, (i + 3, j)))
        store4(C, (i, j), e)
        store4(C, (i + 1, j), f)
        store4(C, (i + 2, j), g)
        store4(C, (i + 3, j), h)


@borrowing(forceinline=True)
def propagate_covariance(size: Size, Phi: Array, Phi_t: Array, Q: Array, P: Array, work: Array) -> None:
    """``P = Phi P Phi' + Q``, symmetric to the bit; `Phi_t` is the transpose of `Phi`. Of P half is worked out."""
    multiply(size, Phi, P, work)
    for i in range(0, len(size), 4):
        four_rows(size, work, Phi_t, Q, i, i + 4, P)
    mirror(size, P)


@borrowing(forceinline=True)
def mirror(size: Size, P: Array) -> None:
    """Make `P` symmetric: the lower triangle is that of both."""
    for i in range(0, len(size), 4):
        for j in range(0, i, 4):
            transpose_block(P, i, j, P)
        for r in range(i + 1, i + 4):
            for c in range(i, r):
                P[c, r] = P[r, c]


@borrowing(forceinline=True)
def mirror_upper(rows: int, P: Array) -> None:
    """Make the first rows and columns of `P`, a multiple of 4, symmetric: the upper triangle is that of both."""
    for i in range(0, rows, 4):
        for j in range(i + 4, rows, 4):
            transpose_block(P, i, j, P)
        for r in range(i + 1, i + 4):
            for c in range(i, r):
                P[r, c] = P[c, r]


@borrowing(forceinline=True)
def scale_row(A: Array, i: int, first: int, stop: int, factor: float, B: Array) -> None:
    """Row i of ``B = factor A``, columns from `first` to before `stop`, multiples of 4."""
    for j in range(first, stop, 4):
        store4(B, (i, j), times4(factor, load4(A, (i, j))))


@borrowing(forceinline=True)
def scale_columns(A: Array, i: int, first: int, stop: int, factors: Array, Q: Array, B: Array) -> None:
    """Row i of ``B = A diag(factors) + Q``, columns from `first` to before `stop`, multiples of 4."""
    for j in range(first, stop, 4):
        store4(B, (i, j), plus4(each4(load4(A, (i, j)), load4(factors, (j,))), load4(Q, (i, j))))


@borrowing(forceinline=True)
def take_off(size: Size, P: Array, a: Array, scale: float) -> None:
    """``P = P - scale a a'``, symmetric to the bit."""
    j = 0
    while j + 8 <= len(size):
        own = load8(a, (j,))
        for i in range(len(size)):
            store8(P, (i, j), minus8(load8(P, (i, j)), times8(scale, times8(a[i], own))))
        j += 8
    if j < len(size):
        rest = load4(a, (j,))
        for i in range(len(size)):
            store4(P, (i, j), minus4(load4(P, (i, j)), times4(scale, times4(a[i], rest))))


@borrowing(forceinline=True)
def take_off_and_see(size: Size, P: Array, a: Array, scale: float, h: Array, y: Array) -> None:
    """``P = P - scale a a'`` and, of the `P` that is left, ``y = P h``, in one pass."""
    j = 0
    while j + 8 <= len(size):
        own, seen = load8(a, (j,)), zero8()
        for i in range(len(size)):
            left = minus8(load8(P, (i, j)), times8(scale, times8(a[i], own)))
            store8(P, (i, j), left)
            seen = plus8(seen, times8(h[i], left))
        store8(y, (j,), seen)
        j += 8
    if j < len(size):
        rest, total = load4(a, (j,)), zero4()
        for i in range(len(size)):
            few = minus4(load4(P, (i, j)), times4(scale, times4(a[i], rest)))
            store4(P, (i, j), few)
            total = plus4(total, times4(h[i], few))
        store4(y, (j,), total)


@borrowing(forceinline=True)
def take_off_pair(size: Size, P: Array, a: Array, b: Array) -> None:
    """``P = P - (a b' + b a') / 2``, symmetric to the bit."""
    j = 0
    while j + 8 <= len(size):
        c, d = load8(a, (j,)), load8(b, (j,))
        for i in range(len(size)):
            both = times8(0.5, plus8(times8(a[i], d), times8(b[i], c)))
            store8(P, (i, j), minus8(load8(P, (i, j)), both))
        j += 8
    if j < len(size):
        e, f = load4(a, (j,)), load4(b, (j,))
        for i in range(len(size)):
            pair = times4(0.5, plus4(times4(a[i], f), times4(b[i], e)))
            store4(P, (i, j), minus4(load4(P, (i, j)), pair))


def symmetric(P: Any) -> Array:
    """The symmetric part of (..., n, n) matrices."""
    return np.asarray(0.5 * (P + np.swapaxes(P, -1, -2)))


def times(A: Any, x: Any) -> Array:
    """``A x`` of (..., m, n) matrices and (..., n) vectors."""
    return np.asarray((A @ x[..., None])[..., 0])


def scaled_cholesky(A: Array) -> tuple[Array, Array]:
    """``(size, L)`` with ``A = D L L' D``, ``D = diag(size)``, of positive definite (..., n, n) matrices in whatever units.

    Raises
    ------
    numpy.linalg.LinAlgError
        One that is not positive definite.
    """
    size = np.sqrt(np.maximum(np.diagonal(A, axis1=-2, axis2=-1), 0.0))
    if not np.all(size > 0.0):
        raise np.linalg.LinAlgError
    return size, np.linalg.cholesky(A / (size[..., :, None] * size[..., None, :]))
