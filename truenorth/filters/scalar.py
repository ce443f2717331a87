"""Likelihood of one measured series under a small model, with what is linear in it taken out: compiled, for fits.

The series is ``y = B beta + h x + v``, with a stationary state x, white v and unknown, unbounded coefficients beta. The
filter's gains do not depend on the data: y and the columns of B go through the same filter, and the normal equations of the
whitened columns give beta and the likelihood of what is left (restricted: that of the contrasts free of B).

Source: A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, sec. 3.4 (the GLS transform of
the Kalman filter); D. A. Harville, Bayesian inference for variance components using only error contrasts, Biometrika 61, 1974.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.compiled import compiled

Array = NDArray[np.float64]


def deviance(Phi: Array, Q: Array, P0: Array, h: Array, r: float, Y: Array) -> float:
    """Minus twice the restricted log-likelihood, but for a constant.

    Parameters
    ----------
    Phi, Q, P0 : (n, n) arrays
        `P0` stands at the first epoch.
    h : (n,) array
    r : float
    Y : (K, 1 + p) array
        The series, and the columns of B.

    Returns
    -------
    float
        Infinite where the model is degenerate.
    """
    return float(restricted(Phi, Q, P0.copy(), h, r, np.ascontiguousarray(Y)))


@compiled
def restricted(Phi: Any, Q: Any, P: Any, h: Any, r: float, Y: Any) -> float:
    """:func:`deviance` for kernels; `P` stands at the first epoch on entry, and is work space."""
    gram = np.zeros((Y.shape[1], Y.shape[1]))
    value = _whiten(Phi, Q, P, h, r, Y, gram) + _left(gram)
    return value if math.isfinite(value) else math.inf


@compiled
def _whiten(Phi: Any, Q: Any, P: Any, h: Any, r: float, Y: Any, gram: Any) -> float:
    """Sum of ``log F``; `gram` gets the products of the whitened columns of `Y`."""
    n, columns = len(h), Y.shape[1]
    rows, cols = np.nonzero(Phi)
    A, X, X_next = np.zeros((n, n)), np.zeros((n, columns)), np.zeros((n, columns))
    a, e = np.zeros(n), np.zeros(columns)
    log_F = 0.0
    for k in range(len(Y)):
        if k > 0:
            # P = Phi P Phi' + Q and X = Phi X by the elements of Phi that are not zero; of P the upper half.
            A[:] = 0.0
            X_next[:] = 0.0
            for m in range(len(rows)):
                i, j = rows[m], cols[m]
                f = Phi[i, j]
                for c in range(n):
                    A[i, c] += f * P[j, c]
                for c in range(columns):
                    X_next[i, c] += f * X[j, c]
            P[:] = Q
            for m in range(len(rows)):
                i, j = rows[m], cols[m]
                f = Phi[i, j]
                for c in range(i + 1):
                    P[c, i] += f * A[c, j]
            for i in range(n):
                for j in range(i):
                    P[i, j] = P[j, i]
            X, X_next = X_next, X
        F = r
        for i in range(n):
            a[i] = 0.0
        for j in range(n):
            if h[j] != 0.0:
                for i in range(n):
                    a[i] += h[j] * P[j, i]
        for i in range(n):
            F += h[i] * a[i]
        log_F += math.log(F)
        for c in range(columns):
            e[c] = Y[k, c]
        for i in range(n):
            if h[i] != 0.0:
                for c in range(columns):
                    e[c] -= h[i] * X[i, c]
        for i in range(n):
            gain = a[i] / F
            for c in range(columns):
                X[i, c] += gain * e[c]
            for j in range(n):
                P[i, j] -= gain * a[j]
        for c in range(columns):
            scaled = e[c] / F
            for d in range(columns):
                gram[c, d] += scaled * e[d]
    return log_F


@compiled
def _left(gram: Any) -> float:
    """``log|N|``, N the normal matrix of all columns but the first, and the square that they leave of the first."""
    p = len(gram) - 1
    L = np.zeros((p + 1, p + 1))  # Cholesky of N, and the first column as the last row
    log_N, left = 0.0, gram[0, 0]
    for i in range(p + 1):
        for j in range(min(i + 1, p)):
            value = gram[1 + i if i < p else 0, 1 + j]
            for m in range(j):
                value -= L[i, m] * L[j, m]
            L[i, j] = math.sqrt(value) if i == j else value / L[j, j]
        if i < p:
            log_N += 2.0 * math.log(L[i, i])
    for j in range(p):
        left -= L[p, j] ** 2
    return log_N + left
