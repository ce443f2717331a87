"""Matrix work of the recursions: small symmetric and square matrices, padded, without BLAS and without allocation.

A matrix of n rows lives in the corner of an N x N array with zeros beyond n; N is the next multiple of 4, beyond 16 of 8.
The zeros change no bit of a result. Each function takes `size`, a tuple of N nothings, first: its length is part of its
*type*, so that Numba compiles every function once for each N with loops of constant length, and one source serves all.
With the innermost loop of constant length summing into a scalar, LLVM unrolls it and turns the loop around it into
vector instructions. That one has the length of an array, as long but not known when it is compiled: one of constant length up to 12
LLVM unrolls as well, and has no loop left for vectors (a product of 12 rows took .44 us, and takes .14).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing

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
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            M[i, j] = source[i, j]


@borrowing(forceinline=True)
def load_transposed(size: Size, source: Array, M: Array) -> None:
    """``M = source'``; as :func:`load`."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            M[j, i] = source[i, j]


@borrowing(forceinline=True)
def dot(size: Size, a: Array, b: Array) -> float:
    """``a' b``."""
    total = 0.0
    for k in range(len(size)):
        total += a[k] * b[k]
    return total


@borrowing(forceinline=True)
def transposed_times(size: Size, A: Array, x: Array, y: Array) -> None:
    """``y = A' x``: for a symmetric `A` the product itself; the transpose runs along rows."""
    for j in range(A.shape[1]):
        total = 0.0
        for k in range(len(size)):
            total += A[k, j] * x[k]
        y[j] = total


@borrowing(forceinline=True)
def multiply(size: Size, A: Array, B: Array, C: Array) -> None:
    """``C = A B``; `C` is neither `A` nor `B`."""
    for i in range(len(size)):
        for j in range(C.shape[1]):
            total = 0.0
            for k in range(len(size)):
                total += A[i, k] * B[k, j]
            C[i, j] = total


@borrowing(forceinline=True)
def propagate_covariance(size: Size, Phi: Array, Phi_t: Array, Q: Array, P: Array, work: Array) -> None:
    """``P = Phi P Phi' + Q``, symmetric to the bit; `Phi_t` is the transpose of `Phi`."""
    multiply(size, Phi, P, work)
    for i in range(len(size)):
        for j in range(P.shape[1]):
            total = 0.0
            for k in range(len(size)):
                total += work[i, k] * Phi_t[k, j]
            P[i, j] = total + Q[i, j]
    mirror(size, P)


@borrowing(forceinline=True)
def mirror(size: Size, P: Array) -> None:
    """Make `P` symmetric: the upper triangle becomes the lower one."""
    for i in range(len(size)):
        for j in range(i):
            P[j, i] = P[i, j]


@borrowing(forceinline=True)
def take_off(size: Size, P: Array, a: Array, scale: float) -> None:
    """``P = P - scale a a'``, symmetric to the bit."""
    for i in range(len(size)):
        for j in range(P.shape[1]):
            P[i, j] -= scale * (a[i] * a[j])


@borrowing(forceinline=True)
def take_off_pair(size: Size, P: Array, a: Array, b: Array) -> None:
    """``P = P - (a b' + b a') / 2``, symmetric to the bit."""
    for i in range(len(size)):
        for j in range(P.shape[1]):
            P[i, j] -= 0.5 * (a[i] * b[j] + b[i] * a[j])


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
