"""Likelihood of one measured series under small models, with what is linear in it taken out: compiled, for fits.

The series is ``y = B beta + h x + v``, with states x that are stationary or begin at zero, white v and unknown, unbounded
coefficients beta. The filter's gains do not depend on the data: y and the columns of B go through the same filter, and the
normal equations of the whitened columns give beta and the likelihood of what is left (restricted: that of the contrasts free
of B).

In a model that does not change with time the covariance changes from step to step by a matrix of low rank,
``P_k+1 - P_k = L_k M_k L_k'``, and the columns of L go through the very filter of the data (as columns that measure zero). So
after a few steps of Riccati's equation, in which the covariance falls steeply and differences would lose digits, gains come
from Chandrasekhar's.

A fit asks for eight models at once, a point and those next to it: each stands in a lane of the registers. States come in pairs,
such as place and velocity of an oscillator: a pair is driven by itself, noise, and the pair before it.

Sources: A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, sec. 3.4 (the GLS transform of
the Kalman filter); D. A. Harville, Bayesian inference for variance components using only error contrasts, Biometrika 61, 1974;
T. Kailath, A. H. Sayed, B. Hassibi, *Linear Estimation*, 2000, sec. 11.1 (the Chandrasekhar recursions).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.vectors import load8, minus8, over8, plus8, product8, spread8, store8, times8, zero8

Array = NDArray[np.float64]

LANES = 8
RICCATI = 4  # steps for each state
LOGARITHM = 8  # steps of which the variances of innovations are multiplied before their logarithm is taken


def in_lanes(x: Array) -> Array:
    """The same (...) in every lane, (..., 8)."""
    return np.ascontiguousarray(np.broadcast_to(np.asarray(x)[..., None], (*np.shape(x), LANES)))


def deviance(Phi: Array, Q: Array, P0: Array, h: Array, r: float, Y: Array, stationary: int) -> float:
    """Minus twice the restricted log-likelihood of one model, but for a constant.

    Parameters
    ----------
    Phi, Q : (n, n) arrays
        Of `Phi` the blocks of two by two on the diagonal and those before them; all else is zero.
    P0 : (n, n) array
        At the first epoch: of the first states such that ``Phi P0 Phi' + Q = P0``, zero beyond.
    h : (n,) array
    Y : (K, 1 + p) array
        The series, and the columns of B.
    stationary : int
        Number of the first states; nothing connects them with the others.

    Returns
    -------
    float
        Infinite where the model is degenerate.
    """
    found, n = np.empty(LANES), len(h)
    blocks = np.asarray(Phi).reshape(n // 2, 2, n // 2, 2).swapaxes(1, 2).reshape(n // 2, n // 2, 4)
    own, behind = blocks[np.arange(n // 2), np.arange(n // 2)], np.zeros((n // 2, 4))
    behind[1:] = blocks[np.arange(1, n // 2), np.arange(n // 2 - 1)]
    lanes = [in_lanes(x) for x in (own, behind)]
    restricted(
        *lanes,
        behind.any(axis=1),
        in_lanes(Q),
        in_lanes(P0),
        np.array(h),
        in_lanes(np.asarray(r)),
        in_lanes(Y),
        stationary,
        found,
    )
    return float(found[0])


@compiled
def restricted(
    own: Any, behind: Any, driven: Any, Q: Any, P: Any, h: Any, r: Any, Y: Any, stationary: int, found: Any
) -> None:
    """:func:`deviance` of eight models, for kernels; arguments as of :func:`products`, `found` (8,)."""
    p = Y.shape[1]
    gram, of_one = np.zeros((p, p, LANES)), np.empty((p, p))
    products(own, behind, driven, Q, P, h, r, Y, stationary, gram, found)
    for lane in range(LANES):
        for i in range(p):
            for j in range(i + 1):
                of_one[i, j] = gram[i, j, lane]
        value = found[lane] + _left(of_one)
        found[lane] = value if math.isfinite(value) else math.inf


@compiled
def products(
    own: Any, behind: Any, driven: Any, Q: Any, P: Any, h: Any, r: Any, Y: Any, stationary: int, gram: Any, log_F: Any
) -> None:
    """Sums of ``log F`` (8,), not a number of a degenerate model; the products of the whitened columns are added to `gram`.

    Parameters
    ----------
    own, behind : (n / 2, 4, 8) arrays
        Of each pair of states its own block of `Phi`, by rows, and that of the pair before it.
    driven : (n / 2,) bool array
        Whether the latter is there.
    Q : (n, n, 8) array
    P : (n, n, 8) array
        At the first epoch on entry; work space.
    h : (n,) array
        Of all models.
    r : (8,) array
        Variance of v.
    Y : (K, columns, 8) array
    stationary : int
    gram : (columns, columns, 8) array
        Its lower half.
    log_F : (8,) array
    """
    n, columns = len(h), Y.shape[1]
    rank = n - stationary + 1
    width = columns + rank
    A, M, My = np.zeros((n, n, LANES)), np.zeros((rank, rank, LANES)), np.zeros((rank, LANES))  # My: M L' h
    X, after = np.zeros((n, width, LANES)), np.zeros((n, width, LANES))  # states of the columns, and L
    e, g = np.zeros((width, LANES)), np.zeros((n, LANES))  # innovations of the columns; Phi P h
    F, weight, product = np.zeros(LANES), np.zeros(LANES), np.ones(LANES)
    for lane in range(LANES):
        log_F[lane] = 0.0
    for k in range(len(Y)):
        if k < RICCATI * n:
            _riccati(own, behind, driven, Q, h, r, P, A, F, g)
        store8(weight, (0,), over8(spread8(1.0), load8(F, (0,))))
        if k == 0:  # P_1 - P_0: the noise of the states that begin at zero, and what the first measurement takes
            _begin(Q, stationary, weight, g, M, X)
            _innovations(X, Y, 0, h, columns, e)
        else:
            for i in range(rank):
                part = product8(load8(weight, (0,)), load8(My, (i, 0)))
                for j in range(rank):
                    store8(M, (i, j, 0), minus8(load8(M, (i, j, 0)), product8(part, load8(My, (j, 0)))))
        for lane in range(LANES):
            product[lane] *= F[lane] if F[lane] > 0.0 else math.nan
        if (k + 1) % LOGARITHM == 0 or k + 1 == len(Y):
            for lane in range(LANES):
                log_F[lane] += math.log(product[lane])
                product[lane] = 1.0
        for c in range(columns):
            part = product8(load8(weight, (0,)), load8(e, (c, 0)))
            for d in range(c + 1):
                store8(gram, (c, d, 0), plus8(load8(gram, (c, d, 0)), product8(part, load8(e, (d, 0)))))
        now = load8(F, (0,))
        for i in range(rank):
            total = zero8()
            for j in range(rank):
                total = minus8(total, product8(load8(M, (i, j, 0)), load8(e, (columns + j, 0))))
            store8(My, (i, 0), total)
            now = minus8(now, product8(load8(e, (columns + i, 0)), total))
        store8(F, (0,), now)
        _go_on(own, behind, driven, X, columns, e, My, weight, g, after)
        _innovations(after, Y, min(k + 1, len(Y) - 1), h, columns, e)
        X, after = after, X


@borrowing(forceinline=True)
def _begin(Q: Any, stationary: int, weight: Any, g: Any, M: Any, L: Any) -> None:
    """The first ``P_1 - P_0 = L M L'``; L is the last columns."""
    rank = len(M)
    columns = L.shape[1] - rank
    for lane in range(LANES):
        M[rank - 1, rank - 1, lane] = -weight[lane]
        for c in range(rank - 1):
            L[stationary + c, columns + c, lane] = 1.0
            for d in range(rank - 1):
                M[c, d, lane] = Q[stationary + c, stationary + d, lane]
        for i in range(len(g)):
            L[i, columns + rank - 1, lane] = g[i, lane]


@borrowing(forceinline=True)
def _block(T: Any, p: int) -> Any:
    """A block of two by two, by rows."""
    return load8(T, (p, 0, 0)), load8(T, (p, 1, 0)), load8(T, (p, 2, 0)), load8(T, (p, 3, 0))


@borrowing(forceinline=True)
def _sum_of_two(a: Any, x: Any, b: Any, y: Any) -> Any:
    return plus8(product8(a, x), product8(b, y))


@borrowing(forceinline=True)
def _go_on(
    own: Any, behind: Any, driven: Any, X: Any, columns: int, e: Any, My: Any, weight: Any, g: Any, after: Any
) -> None:
    """``after = Phi X + g e' / F``, and ``g = Phi P h`` of the next step by ``Phi L``, whose columns are the last ones."""
    for p in range(len(own)):
        i, j = 2 * p, 2 * p + 1
        first, second = load8(g, (i, 0)), load8(g, (j, 0))
        gain, other = product8(load8(weight, (0,)), first), product8(load8(weight, (0,)), second)
        ii, ij, ji, jj = _block(own, p)
        for c in range(len(e)):
            x, y, seen = load8(X, (i, c, 0)), load8(X, (j, c, 0)), load8(e, (c, 0))
            store8(after, (i, c, 0), plus8(_sum_of_two(ii, x, ij, y), product8(gain, seen)))
            store8(after, (j, c, 0), plus8(_sum_of_two(ji, x, jj, y), product8(other, seen)))
        for c in range(columns, len(e)):
            part, x, y = load8(My, (c - columns, 0)), load8(X, (i, c, 0)), load8(X, (j, c, 0))
            first = plus8(first, product8(part, _sum_of_two(ii, x, ij, y)))
            second = plus8(second, product8(part, _sum_of_two(ji, x, jj, y)))
        if driven[p]:
            ii, ij, ji, jj = _block(behind, p)
            for c in range(len(e)):
                x, y = load8(X, (i - 2, c, 0)), load8(X, (j - 2, c, 0))
                u, v = _sum_of_two(ii, x, ij, y), _sum_of_two(ji, x, jj, y)
                store8(after, (i, c, 0), plus8(load8(after, (i, c, 0)), u))
                store8(after, (j, c, 0), plus8(load8(after, (j, c, 0)), v))
            for c in range(columns, len(e)):
                part, x, y = load8(My, (c - columns, 0)), load8(X, (i - 2, c, 0)), load8(X, (j - 2, c, 0))
                first = plus8(first, product8(part, _sum_of_two(ii, x, ij, y)))
                second = plus8(second, product8(part, _sum_of_two(ji, x, jj, y)))
        store8(g, (i, 0), first)
        store8(g, (j, 0), second)


@borrowing(forceinline=True)
def _innovations(X: Any, Y: Any, k: int, h: Any, columns: int, e: Any) -> None:
    """Of all columns; those of L measure zero."""
    for c in range(columns):
        store8(e, (c, 0), load8(Y, (k, c, 0)))
    for c in range(columns, len(e)):
        store8(e, (c, 0), zero8())
    for i in range(len(h)):
        if h[i] != 0.0:
            for c in range(len(e)):
                store8(e, (c, 0), minus8(load8(e, (c, 0)), times8(h[i], load8(X, (i, c, 0)))))


@borrowing(forceinline=True)
def _riccati(own: Any, behind: Any, driven: Any, Q: Any, h: Any, r: Any, P: Any, A: Any, F: Any, g: Any) -> None:
    """F of a step and ``g = Phi P h``; moves P on to the next. A: work space."""
    n = len(h)
    for p in range(len(own)):  # A = Phi P
        i, j = 2 * p, 2 * p + 1
        ii, ij, ji, jj = _block(own, p)
        for c in range(n):
            x, y = load8(P, (i, c, 0)), load8(P, (j, c, 0))
            store8(A, (i, c, 0), _sum_of_two(ii, x, ij, y))
            store8(A, (j, c, 0), _sum_of_two(ji, x, jj, y))
        if driven[p]:
            ii, ij, ji, jj = _block(behind, p)
            for c in range(n):
                x, y = load8(P, (i - 2, c, 0)), load8(P, (j - 2, c, 0))
                store8(A, (i, c, 0), plus8(load8(A, (i, c, 0)), _sum_of_two(ii, x, ij, y)))
                store8(A, (j, c, 0), plus8(load8(A, (j, c, 0)), _sum_of_two(ji, x, jj, y)))
    now = load8(r, (0,))
    for i in range(n):
        store8(g, (i, 0), zero8())
    for c in range(n):
        if h[c] != 0.0:
            for i in range(n):
                store8(g, (i, 0), plus8(load8(g, (i, 0)), times8(h[c], load8(A, (i, c, 0)))))
                now = plus8(now, times8(h[i] * h[c], load8(P, (i, c, 0))))
    store8(F, (0,), now)
    weight = over8(spread8(1.0), now)
    for p in range(len(own)):
        i, j = 2 * p, 2 * p + 1
        first, second = product8(weight, load8(g, (i, 0))), product8(weight, load8(g, (j, 0)))
        ii, ij, ji, jj = _block(own, p)
        for c in range(n):
            x, y, seen = load8(A, (c, i, 0)), load8(A, (c, j, 0)), load8(g, (c, 0))
            u, v = _sum_of_two(ii, x, ij, y), _sum_of_two(ji, x, jj, y)
            store8(P, (c, i, 0), plus8(minus8(load8(Q, (c, i, 0)), product8(first, seen)), u))
            store8(P, (c, j, 0), plus8(minus8(load8(Q, (c, j, 0)), product8(second, seen)), v))
        if driven[p]:
            ii, ij, ji, jj = _block(behind, p)
            for c in range(n):
                x, y = load8(A, (c, i - 2, 0)), load8(A, (c, j - 2, 0))
                store8(P, (c, i, 0), plus8(load8(P, (c, i, 0)), _sum_of_two(ii, x, ij, y)))
                store8(P, (c, j, 0), plus8(load8(P, (c, j, 0)), _sum_of_two(ji, x, jj, y)))


@compiled
def _left(gram: Any) -> float:
    """``log|N|``, N the normal matrix of all columns but the first, and the square that they leave of the first."""
    p = len(gram) - 1
    L = np.zeros((p + 1, p + 1))  # Cholesky of N, and the first column as the last row
    log_N, left = 0.0, gram[0, 0]
    for i in range(p + 1):
        for j in range(min(i + 1, p)):
            value = gram[1 + i, 1 + j] if i < p else gram[1 + j, 0]
            for m in range(j):
                value -= L[i, m] * L[j, m]
            L[i, j] = math.sqrt(value) if i == j else value / L[j, j]
        if i < p:
            log_N += 2.0 * math.log(L[i, i])
    for j in range(p):
        left -= L[p, j] ** 2
    return log_N + left
