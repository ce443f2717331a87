"""Likelihood of one measured series under a small model, with what is linear in it taken out: compiled, for fits.

The series is ``y = B beta + h x + v``, with states x that are stationary or begin at zero, white v and unknown, unbounded
coefficients beta. The filter's gains do not depend on the data: y and the columns of B go through the same filter, and the
normal equations of the whitened columns give beta and the likelihood of what is left (restricted: that of the contrasts free
of B).

In a model that does not change with time the covariance changes from step to step by a matrix of low rank,
``P_k+1 - P_k = L_k M_k L_k'``, and the columns of L go through the very filter of the data (as columns that measure zero). So
after a few steps of Riccati's equation, in which the covariance falls steeply and differences would lose digits, gains come
from Chandrasekhar's.

Sources: A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, sec. 3.4 (the GLS transform of
the Kalman filter); D. A. Harville, Bayesian inference for variance components using only error contrasts, Biometrika 61, 1974;
T. Kailath, A. H. Sayed, B. Hassibi, *Linear Estimation*, 2000, sec. 11.1 (the Chandrasekhar recursions).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled

Array = NDArray[np.float64]

RICCATI = 4  # steps for each state


def deviance(Phi: Array, Q: Array, P0: Array, h: Array, r: float, Y: Array, stationary: int) -> float:
    """Minus twice the restricted log-likelihood, but for a constant.

    Parameters
    ----------
    Phi, Q : (n, n) arrays
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
    return float(restricted(Phi, Q, P0.copy(), h, r, np.ascontiguousarray(Y), stationary))


@compiled
def restricted(Phi: Any, Q: Any, P: Any, h: Any, r: float, Y: Any, stationary: int) -> float:
    """:func:`deviance` for kernels; `P` stands at the first epoch on entry, and is work space."""
    gram = np.zeros((Y.shape[1], Y.shape[1]))
    value = products(Phi, Q, P, h, r, Y, stationary, gram) + _left(gram)
    return value if math.isfinite(value) else math.inf


@compiled
def products(Phi: Any, Q: Any, P: Any, h: Any, r: float, Y: Any, stationary: int, gram: Any) -> float:
    """Sum of ``log F``; the products of the whitened columns of `Y` are added to `gram`, its lower half."""
    n, columns = len(h), Y.shape[1]
    rank = n - stationary + 1
    width = columns + rank
    rows, cols = np.nonzero(Phi)
    A, M = np.zeros((n, n)), np.zeros((rank, rank))
    X, Phi_X, e = np.zeros((n, width)), np.zeros((n, width)), np.zeros(width)  # states of the columns, then L
    g, My = np.zeros(n), np.zeros(rank)  # Phi P h; M L' h
    log_F, F = 0.0, 0.0
    for k in range(len(Y)):
        if k < RICCATI * n:
            F = _riccati(Phi, rows, cols, Q, h, r, P, A, g)
        else:
            for c in range(rank):
                F -= e[columns + c] * My[c]
                for i in range(n):
                    g[i] += Phi_X[i, columns + c] * My[c]
        if k == 0:  # P_1 - P_0: the noise of the states that begin at zero, and what the first measurement takes
            M[rank - 1, rank - 1] = -1.0 / F
            for c in range(rank - 1):
                X[stationary + c, columns + c] = 1.0
                for d in range(rank - 1):
                    M[c, d] = Q[stationary + c, stationary + d]
            for i in range(n):
                X[i, width - 1] = g[i]
        else:
            for i in range(rank):
                for j in range(rank):
                    M[i, j] -= My[i] * My[j] / F
        log_F += math.log(F)
        for c in range(width):
            e[c] = Y[k, c] if c < columns else 0.0
        for i in range(n):
            if h[i] != 0.0:
                for c in range(width):
                    e[c] -= h[i] * X[i, c]
        weight = 1.0 / F
        for c in range(columns):
            for d in range(c + 1):
                gram[c, d] += weight * e[c] * e[d]
        for i in range(rank):
            My[i] = 0.0
            for j in range(rank):
                My[i] -= M[i, j] * e[columns + j]
        Phi_X[:] = 0.0
        for m in range(len(rows)):
            i, j, f = rows[m], cols[m], Phi[rows[m], cols[m]]
            for c in range(width):
                Phi_X[i, c] += f * X[j, c]
        for i in range(n):
            gain = weight * g[i]
            for c in range(width):
                X[i, c] = Phi_X[i, c] + gain * e[c]
    return log_F


@compiled
def _riccati(Phi: Any, rows: Any, cols: Any, Q: Any, h: Any, r: float, P: Any, A: Any, g: Any) -> float:
    """F of a step and ``g = Phi P h``; moves P on to the next. `rows`, `cols`: elements of Phi that are not zero; A: work space."""
    n, F = len(h), r
    A[:] = 0.0  # Phi P
    for m in range(len(rows)):
        i, j = rows[m], cols[m]
        for c in range(n):
            A[i, c] += Phi[i, j] * P[j, c]
    for i in range(n):
        g[i] = 0.0
        for j in range(n):
            g[i] += A[i, j] * h[j]
            F += h[i] * P[i, j] * h[j]
    for i in range(n):
        for j in range(n):
            P[i, j] = Q[i, j] - g[i] * g[j] / F
    for m in range(len(rows)):
        i, j = rows[m], cols[m]
        for c in range(n):
            P[c, i] += Phi[i, j] * A[c, j]
    return F


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
