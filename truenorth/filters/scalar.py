"""Likelihood of one measured series under a small model, with what is linear in it taken out: compiled, for fits.

The series is ``y = B beta + h x + v``, with a stationary state x, white v and unknown, unbounded coefficients beta. The
filter's gains do not depend on the data: y and the columns of B go through the same filter, and the normal equations of the
whitened columns give beta and the likelihood of what is left (restricted: that of the contrasts free of B).

Source: A. C. Harvey, *Forecasting, Structural Time Series Models and the Kalman Filter*, 1989, sec. 3.4 (the GLS transform of
the Kalman filter); D. A. Harville, Bayesian inference for variance components using only error contrasts, Biometrika 61, 1974.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.compiled import compiled

Array = NDArray[np.float64]


@compiled
def _whiten(
    Phi: Any, rows: Any, cols: Any, Q: Any, h: Any, r: float, P: Any, Y: Any, X: Any, A: Any, gram: Any
) -> float:
    """Sum of ``log F``; `gram` gets the products of the whitened columns of `Y`; `P`, `X`, `A` are work space."""
    n, columns = len(h), Y.shape[1]
    a, e = np.zeros(n), np.zeros(columns)
    log_F = 0.0
    for k in range(len(Y)):
        if k > 0:
            # P = Phi P Phi' + Q and X = Phi X by the elements of Phi that are not zero.
            for i in range(n):
                for j in range(n):
                    A[i, j] = 0.0
            for m in range(len(rows)):
                i, j = rows[m], cols[m]
                f = Phi[i, j]
                for c in range(n):
                    A[i, c] += f * P[j, c]
            for i in range(n):
                for j in range(n):
                    P[i, j] = Q[i, j]
            for m in range(len(rows)):
                i, j = rows[m], cols[m]
                f = Phi[i, j]
                for c in range(n):
                    P[i, c] += f * A[c, j]
            for c in range(columns):
                for i in range(n):
                    a[i] = 0.0
                for m in range(len(rows)):
                    a[rows[m]] += Phi[rows[m], cols[m]] * X[c, cols[m]]
                for i in range(n):
                    X[c, i] = a[i]
        F = r
        for i in range(n):
            a[i] = 0.0
            for j in range(n):
                a[i] += P[i, j] * h[j]
            F += h[i] * a[i]
        log_F += np.log(F)
        for c in range(columns):
            e[c] = Y[k, c]
            for i in range(n):
                e[c] -= h[i] * X[c, i]
            for i in range(n):
                X[c, i] += a[i] / F * e[c]
            for d in range(c + 1):
                gram[c, d] += e[c] * e[d] / F
        for i in range(n):
            for j in range(n):
                P[i, j] -= a[i] * a[j] / F
    return log_F


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
    rows, cols = np.nonzero(Phi)
    columns, n = Y.shape[1], len(h)
    gram = np.zeros((columns, columns))
    log_F = _whiten(Phi, rows, cols, Q, h, r, P0.copy(), Y, np.zeros((columns, n)), np.zeros((n, n)), gram)
    normal, cross = gram[1:, 1:], gram[1:, 0]
    normal = normal + np.tril(normal, -1).T
    sign, log_normal = np.linalg.slogdet(normal)
    if not (np.isfinite(log_F) and sign > 0):
        return float("inf")
    return float(log_F + log_normal + gram[0, 0] - cross @ np.linalg.solve(normal, cross))
