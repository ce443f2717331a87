"""The steps that nonlinear filters share: loading an epoch, moving on the manifold, keeping a history."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.linalg import Array, Size, load
from truenorth.filters.linearisation import (
    Points,
    decompose,
    measure_nodes,
    measure_tangent,
    predict_nodes,
    predict_tangent,
)
from truenorth.filters.nonlinear_system import (
    Functions,
    NonlinearRuns,
)
from truenorth.filters.quadrature import QuadratureRule
from truenorth.filters.recursion import (
    NOT_FINITE,
    NOT_POSITIVE,
    SOUND,
    Histories,
    Workspace,
)


@compiled
def begin_point(size: Size, system: NonlinearRuns, run: int, w: Workspace, s: Points) -> None:
    """Load the state before epoch 0."""
    b = run if system.x0.shape[0] > 1 else 0
    for i in range(system.x0.shape[1]):
        s.X[i] = system.x0[b, i]
    load(size, system.P0[run if system.P0.shape[0] > 1 else 0], w.P)
    for i in range(len(size)):
        w.largest[i] = w.P[i, i]


@compiled
def load_epoch(size: Size, system: NonlinearRuns, run: int, epoch: int, w: Workspace, s: Points) -> None:
    """Load parameters and process noise of an epoch."""
    b = run if system.p.shape[0] > 1 else 0
    k = epoch if system.p.shape[1] > 1 else 0
    for i in range(system.p.shape[2]):
        s.p[i] = system.p[b, k, i]
    if epoch == 0 or system.Q.shape[1] > 1:
        load(size, system.Q[run if system.Q.shape[0] > 1 else 0, epoch], w.Q)


@compiled
def load_rows(size: Size, system: NonlinearRuns, run: int, epoch: int, w: Workspace) -> int:
    """Load ``z, R`` of an epoch, anew for each linearisation; the error is zero. Rows that are there."""
    rows = system.z.shape[2]
    b, c = run if system.z.shape[0] > 1 else 0, run if system.R.shape[0] > 1 else 0
    k, e = epoch if system.z.shape[1] > 1 else 0, epoch if system.R.shape[1] > 1 else 0
    present = 0
    for i in range(rows):
        w.z[i] = system.z[b, k, i]
        present += not np.isnan(w.z[i])
        w.v[i] = 0.0
        for j in range(rows):
            w.R[i, j] = system.R[c, e, i, j]
        for j in range(len(size)):
            w.S_t[i, j] = 0.0
    for j in range(len(size)):
        w.x[j] = 0.0
    return present


@compiled
def linear_at(
    size: Size,
    functions: Functions,
    rule: QuadratureRule,
    order: NDArray[np.int64],
    w: Workspace,
    s: Points,
    measured: bool,
) -> int:
    """The prediction of state and covariance without Q, or the linear measurement ``z = H dx + v``; the failure, if any."""
    if len(rule.mean) == 0:
        sound = measure_tangent(size, functions, w, s) if measured else predict_tangent(size, functions, w, s)
        return SOUND if sound else NOT_FINITE
    if not decompose(size, w.P, order, s):
        return NOT_POSITIVE
    if measured:
        sound = measure_nodes(size, functions, rule, order, w, s)
    else:
        sound = predict_nodes(size, functions, rule, order, w, s)
    return SOUND if sound else NOT_FINITE


@compiled(forceinline=True)
def add_noise(size: Size, w: Workspace) -> None:
    """``P = P + Q``."""
    for i in range(len(size)):
        for j in range(len(size)):
            w.P[i, j] += w.Q[i, j]


@compiled(forceinline=True)
def copy(size: Size, source: Array, M: Array) -> None:
    """``M = source``."""
    for i in range(len(size)):
        for j in range(len(size)):
            M[i, j] = source[i, j]


@compiled(forceinline=True)
def are_correlated(R: Array) -> bool:
    """Whether the noise of a row is correlated with that of another."""
    for i in range(len(R)):
        for j in range(i):
            if R[i, j] != 0.0:
                return True
    return False


@compiled(forceinline=True)
def move(functions: Functions, w: Workspace, s: Points, dx: Array) -> None:
    """``X = retract(X, dx)``."""
    for i in range(len(dx)):
        dx[i] = w.x[i]
    functions.retract(s.X, dx, s.y)
    for i in range(len(s.X)):
        s.X[i] = s.y[i]


@compiled(forceinline=True)
def keep_point(out: Histories, run: int, epoch: int, last: int, X: Array, P: Array) -> None:
    """Keep state, sigma and covariance of an epoch in those histories that have room; the last epoch in all."""
    n = out.P.shape[2]
    if out.x.shape[1] > epoch or epoch == last:
        k = epoch if out.x.shape[1] > 1 else 0
        for i in range(len(X)):
            out.x[run, k, i] = X[i]
        for i in range(n):
            out.sigma[run, k, i] = np.sqrt(P[i, i])
    if out.P.shape[1] > epoch or epoch == last:
        k = epoch if out.P.shape[1] > 1 else 0
        for i in range(n):
            for j in range(n):
                out.P[run, k, i, j] = P[i, j]
