"""The square-root Kalman filter: for long runs, and for precision beyond what a covariance holds.

The filter carries a factor of the covariance, ``P = L L'``, and never subtracts: one orthogonal triangularisation an
epoch turns what is known before into what is known after::

    [ H Phi L   H A + B   C ]          [ W^1/2     0   ]
    [  Phi L       A      0 ]   --->   [ K W^1/2   L_k ]

with ``[[A, 0], [B, C]]`` the factor of ``[[Q, S], [S', R]]`` and W the innovations' covariance. P cannot lose its
positiveness, and numbers from 1e-16 to 1 in P are those from 1e-8 to 1 in L.

Source: T. Kailath, A. H. Sayed, B. Hassibi, *Linear Estimation*, 2000, sections 12.3 and 12.4 (array algorithms).
"""

from __future__ import annotations

from typing import NamedTuple, Unpack

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.core.linalg import Array, Size, dot, multiply
from truenorth.filters.drive import Running, drive
from truenorth.filters.recursion import (
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    SOUND,
    Histories,
    Workspace,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict_state,
    propagate_covariance,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs

SEMIDEFINITE = 1e-14  # of a variance: what is left of it after the states before is rounding


class Factors(NamedTuple):
    """Factors, transposed: rows of `L_t` are columns of L; `array` is the array above, transposed."""

    L_t: Array
    joint: Array  # of [[Q, S], [S', R]], lower triangle
    array: Array
    e: Array
    t: Array


@compiled
def factorise(A: Array) -> None:
    """Cholesky factor of a positive semidefinite matrix in its lower triangle, in place; zeros above."""
    n = len(A)
    for j in range(n):
        whole = A[j, j]
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        pivot = np.sqrt(A[j, j]) if A[j, j] > SEMIDEFINITE * whole else 0.0
        A[j, j] = pivot
        for i in range(j + 1, n):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] = A[i, j] / pivot if pivot > 0.0 else 0.0
            A[j, i] = 0.0


@compiled
def triangularise(A: Array, columns: int, t: Array) -> None:
    """Upper triangle of the QR decomposition by reflections, in place; no negative diagonal. `t` is room for a row."""
    rows = len(A)
    for c in range(columns):
        norm = 0.0
        for r in range(c, rows):
            norm += A[r, c] * A[r, c]
        norm = np.sqrt(norm)
        if norm == 0.0:
            continue
        # Reflect column c onto -sign(A[c, c]) * norm, then turn the row's sign round if need be.
        target = -norm if A[c, c] > 0.0 else norm
        scale = 1.0 / (norm * (norm + abs(A[c, c])))
        A[c, c] -= target
        # Rows are contiguous, so each reflection goes along them: t = v' A, then A -= v t.
        for j in range(c + 1, columns):
            t[j] = 0.0
        for r in range(c, rows):
            v = A[r, c]
            if v != 0.0:
                for j in range(c + 1, columns):
                    t[j] += v * A[r, j]
        for r in range(c, rows):
            v = scale * A[r, c]
            if v != 0.0:
                for j in range(c + 1, columns):
                    A[r, j] -= v * t[j]
        A[c, c] = target
        for r in range(c + 1, rows):
            A[r, c] = 0.0
        if target < 0.0:
            for j in range(c, columns):
                A[c, j] = -A[c, j]


@compiled(forceinline=True)
def start(size: Size, w: Workspace, f: Factors, n: int, memory: Array) -> None:
    """Take the factor from the memory, or that of P0 where there is none."""
    if np.isnan(memory[0]):
        for i in range(n):
            for j in range(n):
                f.joint[i, j] = w.P[i, j]
        factorise(f.joint[:n, :n])
        for i in range(n):
            for j in range(n):
                f.L_t[j, i] = f.joint[i, j]
    else:
        for i in range(n):
            for j in range(n):
                f.L_t[i, j] = memory[i * n + j]


@compiled(forceinline=True)
def fill(size: Size, w: Workspace, f: Factors, n: int) -> int:
    """Set up the array, rows present first; their number."""
    N, rows = len(size), w.z.shape[0]
    multiply(size, f.L_t, w.Phi_t, w.temporary)
    f.array[:] = 0.0
    present = 0
    for row in range(rows):
        if np.isnan(w.z[row]):
            continue
        for i in range(n):
            f.array[i, present] = dot(size, w.temporary[i], w.H[row])
            noise = f.joint[n + row, i]
            for k in range(i, n):
                noise += f.joint[k, i] * w.H[row, k]
            f.array[N + i, present] = noise
        for i in range(row + 1):
            f.array[2 * N + i, present] = f.joint[n + row, n + i]
        f.e[present] = w.z[row] - dot(size, w.H[row], w.x)
        present += 1
    for i in range(n):
        for j in range(n):
            f.array[i, present + j] = w.temporary[i, j]
        for j in range(i, n):
            f.array[N + i, present + j] = f.joint[j, i]
    return present


@compiled(forceinline=True)
def square_root_update(w: Workspace, f: Factors, n: int, present: int) -> tuple[int, float, float]:
    """Predict and condition on the rows present, in one; the failure if any, NIS and log-likelihood."""
    triangularise(f.array, present + n, f.t)
    nis, log_likelihood = 0.0, 0.0
    for j in range(present):
        for i in range(j):
            f.e[j] -= f.array[i, j] * f.e[i]
        if not f.array[j, j] > 0.0:
            return NO_INNOVATION_VARIANCE, nis, log_likelihood
        f.e[j] /= f.array[j, j]
        nis += f.e[j] * f.e[j]
        log_likelihood -= 0.5 * (f.e[j] * f.e[j] + LOG_2PI) + np.log(f.array[j, j])
        for i in range(n):
            w.x[i] += f.array[j, present + i] * f.e[j]
    for i in range(n):
        for j in range(n):
            f.L_t[i, j] = f.array[present + i, present + j]
    return SOUND, nis, log_likelihood


@compiled(forceinline=True)
def covariance(size: Size, w: Workspace, f: Factors) -> None:
    """``P = L L'``."""
    for i in range(len(size)):
        for j in range(i + 1):
            total = 0.0
            for k in range(len(size)):
                total += f.L_t[k, i] * f.L_t[k, j]
            w.P[i, j] = total
            w.P[j, i] = total


@compiled
def square_root_runs(size: Size, system: Runs, epochs: int, out: Histories) -> None:
    """Square-root filter of each run."""
    N, n, rows = len(size), out.x.shape[2], system.z.shape[2]
    w = workspace(size, rows)
    f = Factors(
        np.zeros((N, N)),
        np.zeros((n + rows, n + rows)),
        np.zeros((2 * N + rows, rows + n)),
        np.zeros(max(rows, 1)),
        np.zeros(rows + n),
    )
    varying = system.Q.shape[1] > 1 or system.R.shape[1] > 1 or system.S.shape[1] > 1
    every = out.x.shape[1] > 1 or out.innovation.shape[1] > 0
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        start(size, w, f, n, out.memory[run])
        covariance(size, w, f)
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict_state(size, w)
            load_measurement(size, system, run, epoch, w)
            if epoch == 0 or varying:
                for i in range(n):
                    for j in range(n):
                        f.joint[i, j] = w.Q[i, j]
                for row in range(rows):
                    for i in range(n):
                        f.joint[n + row, i] = w.S_t[row, i]
                    for j in range(rows):
                        f.joint[n + row, n + j] = w.R[row, j]
                factorise(f.joint)
            if out.innovation.shape[1] > 0:
                propagate_covariance(size, w.Phi, w.Phi_t, w.Q, w.P, w.temporary)
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
            present = fill(size, w, f, n)
            failure, nis, log_likelihood = square_root_update(w, f, n, present)
            if not conclude(out, run, epoch, failure, nis, log_likelihood):
                break
            if every or epoch == epochs - 1:
                covariance(size, w, f)
                keep(out, run, epoch, epochs - 1, w)
        for i in range(n):
            for j in range(n):
                out.memory[run, i * n + j] = f.L_t[i, j]


def square_root(
    system: LinearSystem,
    state: FilterState | None = None,
    **running: Unpack[Running],
) -> Estimates:
    """Square-root Kalman filter; called as :func:`truenorth.filters.kalman`, and exact for any ``R`` and ``S`` like it.

    The `memory` of its state is the factor. A DataError says where the variance of an innovation is zero.
    """
    return drive(square_root_runs, system, state, memory=np.full(system.states**2, np.nan), **running)
