"""The fixed-interval smoother: each epoch's state, given the measurements of all epochs.

The answer is that of Rauch, Tung and Striebel; it is found in the form of Bryson and Frazier, which carries the
gradient ``lam`` and the information ``Lam`` of all later measurements backwards and inverts no covariance, so that
states known exactly, or without process noise, are welcome: ``x_s = x + P lam``, ``P_s = P - P Lam P``.

Sources: H. E. Rauch, F. Tung, C. T. Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3, 1965;
G. J. Bierman, Fixed interval smoothing with discrete measurements, Int. J. Control 18, 1973 (the modified
Bryson-Frazier form), here with noise that is correlated between rows and with the process noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import Array, Size, load, padded, propagate_covariance, transposed_times
from truenorth.filters.drive import in_parts, part
from truenorth.filters.kalman import kalman
from truenorth.filters.recursion import (
    Workspace,
    begin,
    load_measurement,
    load_process,
    predict,
    row_variance,
    update_by_row,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs, runs_of

ROUNDING = 1e-13  # of the filtered variance: a smaller smoothed one is not known


@dataclass(frozen=True)
class Smoothed:
    """What all measurements together say of each epoch.

    Parameters
    ----------
    x : (..., K, n) array
    sigma : (..., K, n) array
    P : (..., K, n, n) array
    x0 : (..., n) array
        The state before epoch 0.
    P0 : (..., n, n) array
    filtered : Estimates
        Of the forward filter, with its whole history.
    """

    x: Array
    sigma: Array
    P: Array
    x0: Array
    P0: Array
    filtered: Estimates


class Passes(NamedTuple):
    """Filtered estimates and room for the smoothed ones, as the kernel takes them: runs in front."""

    x: Array
    P: Array
    x_s: Array
    sigma_s: Array
    P_s: Array
    x0_s: Array
    P0_s: Array


class Behind(NamedTuple):
    """What later measurements say, padded, and what one epoch's rows add to it."""

    lam: Array
    Lam: Array
    M: Array  # an error of the predicted state, after the rows: I - K H
    M_t: Array
    V: Array  # and in the noise that the rows before make us expect, (m, N)
    h: Array
    q: Array
    G: Array
    zero: Array


@borrowing(forceinline=True)
def look_back(size: Size, w: Workspace, b: Behind, correlated: bool) -> None:
    """Carry ``lam, Lam`` from behind an epoch's rows to before them; conditions the predicted state as it goes.

    Row i sees an error e of the predicted state as ``h = M' H_i - V_i``:
    ``lam = M' lam + sum h nu / variance``, ``Lam = M' Lam M + sum h h' / variance``.
    """
    N = len(size)
    for i in range(N):
        b.q[i] = 0.0
        for j in range(N):
            b.M[i, j] = 1.0 * (i == j)
            b.M_t[i, j] = b.M[i, j]
            b.G[i, j] = 0.0
    for row in range(w.z.shape[0]):
        for i in range(N):
            b.V[row, i] = 0.0
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        transposed_times(size, b.M, w.H[row], b.h)
        nu, variance, h_s = row_variance(size, w, row, correlated)
        update_by_row(size, w, row, nu, variance, h_s, correlated, True)
        for i in range(N):
            b.h[i] -= b.V[row, i]
            b.q[i] += b.h[i] * (nu / variance)
        for i in range(N):
            for j in range(N):
                b.M[i, j] -= w.k[i] * b.h[j]
                b.M_t[i, j] -= b.h[i] * w.k[j]
                b.G[i, j] += b.h[i] * b.h[j] / variance
        if correlated:
            for later in range(row + 1, w.z.shape[0]):
                for i in range(N):
                    b.V[later, i] += w.g[later] / variance * b.h[i]
    transposed_times(size, b.M, b.lam, b.h)
    for i in range(N):
        b.lam[i] = b.h[i] + b.q[i]
    propagate_covariance(size, b.M_t, b.M, b.G, b.Lam, w.temporary)


@borrowing(forceinline=True)
def smooth(size: Size, w: Workspace, b: Behind, n: int, x: Array, P: Array) -> None:
    """``x = x + P lam``, ``P = P - P Lam P``, the filtered ones in `w`."""
    transposed_times(size, w.P, b.lam, w.a)
    for i in range(len(size)):
        for j in range(len(size)):
            b.G[i, j] = b.Lam[i, j]
    propagate_covariance(size, w.P, w.P, b.zero, b.G, w.temporary)
    for i in range(n):
        x[i] = w.x[i] + w.a[i]
        for j in range(n):
            P[i, j] = w.P[i, j] - b.G[i, j]
        P[i, i] = max(P[i, i], ROUNDING * w.P[i, i])


@borrowing(forceinline=True)
def filtered(size: Size, system: Runs, both: Passes, run: int, epoch: int, w: Workspace) -> None:
    """Load what the filter had after an epoch; the start for epoch -1."""
    if epoch < 0:
        begin(size, system, run, w)
        return
    for i in range(both.x.shape[2]):
        w.x[i] = both.x[run, epoch, i]
    load(size, both.P[run, epoch], w.P)


@compiled
def smooth_runs(size: Size, system: Runs, epochs: int, both: Passes) -> None:
    """Backward pass of each run."""
    N, rows, n = len(size), system.z.shape[2], both.x.shape[2]
    w = workspace(size, rows)
    b = Behind(
        np.zeros(N),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros((rows, N)),
        np.zeros(N),
        np.zeros(N),
        np.zeros((N, N)),
        np.zeros((N, N)),
    )
    for run in range(both.x.shape[0]):
        load_process(size, system, run, 0, w)
        load_measurement(size, system, run, 0, w)
        for i in range(N):
            b.lam[i] = 0.0
            for j in range(N):
                b.Lam[i, j] = 0.0
        for epoch in range(epochs - 1, -1, -1):
            filtered(size, system, both, run, epoch, w)
            smooth(size, w, b, n, both.x_s[run, epoch], both.P_s[run, epoch])
            for i in range(n):
                both.sigma_s[run, epoch, i] = np.sqrt(both.P_s[run, epoch, i, i])
            filtered(size, system, both, run, epoch - 1, w)
            load_process(size, system, run, epoch, w)
            predict(size, w)
            _, correlated = load_measurement(size, system, run, epoch, w)
            look_back(size, w, b, correlated)
            transposed_times(size, w.Phi, b.lam, b.h)
            for i in range(N):
                b.lam[i] = b.h[i]
            propagate_covariance(size, w.Phi_t, w.Phi, b.zero, b.Lam, w.temporary)
        filtered(size, system, both, run, -1, w)
        smooth(size, w, b, n, both.x0_s[run], both.P0_s[run])


def smoother(system: LinearSystem, state: FilterState | None = None, *, workers: int = 1) -> Smoothed:
    """Fixed-interval smoother (Rauch-Tung-Striebel, in the form of Bryson and Frazier).

    Runs :func:`truenorth.filters.kalman` forwards, then backwards. ``P_s`` is found as a difference from the filtered
    ``P``, so what lies below ``1e-13 P`` is rounding: a variance is never reported smaller than that.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call of a filter; replaces ``x0, P0``.
    workers : int
        Threads that share the runs; the bits do not depend on it.

    Raises
    ------
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    forward = kalman(system, state, history="full", workers=workers)
    if state is not None:
        system = replace(system, x0=state.x, P0=state.P)
    shape, epochs, n = system.runs, system.epochs, system.states
    count = int(np.prod(shape, dtype=int))
    both = Passes(
        x=forward.x.reshape(count, epochs, n),
        P=forward.P.reshape(count, epochs, n, n),
        x_s=np.empty((count, epochs, n)),
        sigma_s=np.empty((count, epochs, n)),
        P_s=np.empty((count, epochs, n, n)),
        x0_s=np.empty((count, n)),
        P0_s=np.empty((count, n, n)),
    )
    runs, size = runs_of(system, shape), padded(n)
    in_parts(count, workers, lambda i, j: smooth_runs(size, part(runs, i, j), epochs, part(both, i, j)))
    x, sigma, P, x0, P0 = (a.reshape(shape + a.shape[1:]) for a in both[2:])
    return Smoothed(x, sigma, P, x0, P0, forward)
