"""The steps that linear filters share: loading an epoch, predicting, updating by one row, keeping a history."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import (
    Array,
    Size,
    add_difference,
    add_times,
    copy_corner,
    divide,
    dot,
    dot_at,
    load,
    propagate_covariance,
    take_off,
    take_off_and_see,
    take_off_pair,
    transpose,
    transposed_times,
    transposed_times_at,
)
from truenorth.filters.system import Runs

LOG_2PI = float(np.log(2.0 * np.pi))
ROUNDING = 1e-13  # of a variance
PLAIN_RANGE = 1e13  # of an innovation's variance over its noise: beyond it the plain form leaves rounding in P
JOSEPH_RANGE = 1e12  # of the same: beyond it Joseph's form is checked, as P may not hold what the row showed

SOUND, NO_INNOVATION_VARIANCE, NOT_POSITIVE, NO_FILTER, NOT_FINITE = range(5)


class Workspace(NamedTuple):
    """One epoch of one run, padded: matrices (N, N), vectors (N,); rows of `H`, `S_t` and `CH` are (m, N)."""

    x: Array
    P: Array
    Phi: Array
    Phi_t: Array
    Q: Array
    u: Array
    H: Array
    R: Array
    S_t: Array  # covariance of each row's noise with the state
    z: Array
    v: Array  # estimate of each row's noise, from the rows before it
    g: Array
    a: Array
    k: Array
    t: Array
    largest: Array  # variance of each state so far
    temporary: Array
    tied: NDArray[np.bool_]  # (1,): whether the noise of a row is correlated, with another's or with the process noise


class Histories(NamedTuple):
    """What is kept of each run; a time axis of length 0 keeps nothing."""

    x: Array
    sigma: Array
    P: Array
    innovation: Array
    innovation_covariance: Array
    nis: Array
    log_likelihood: Array
    adaptation: Array
    memory: Array
    failure: NDArray[np.int64]  # (runs, 2): reason and epoch


@compiled
def workspace(size: Size, rows: int) -> Workspace:
    """Zeros throughout: padding stays zero for good."""
    N = len(size)
    return Workspace(
        np.zeros(N),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros(N),
        np.zeros((rows, N)),
        np.zeros((rows, rows)),
        np.zeros((rows, N)),
        np.zeros(rows),
        np.zeros(rows),
        np.zeros(rows),
        np.zeros(N),
        np.zeros(N),
        np.zeros(N),
        np.zeros(N),
        np.zeros((N, N)),
        np.zeros(1, dtype=np.bool_),
    )


@borrowing(forceinline=True)
def begin(size: Size, system: Runs, run: int, w: Workspace) -> None:
    """Load the state before epoch 0."""
    b = run if system.x0.shape[0] > 1 else 0
    c = run if system.P0.shape[0] > 1 else 0
    for i in range(system.x0.shape[1]):
        w.x[i] = system.x0[b, i]
    load(size, system.P0[c], w.P)
    for i in range(len(size)):
        w.largest[i] = w.P[i, i]


@borrowing(forceinline=True)
def load_process(size: Size, system: Runs, run: int, epoch: int, w: Workspace) -> None:
    """Load ``Phi, Q, u`` of an epoch; what is constant in time was loaded at epoch 0."""
    if epoch == 0 or system.Phi.shape[1] > 1:
        b = run if system.Phi.shape[0] > 1 else 0
        load(size, system.Phi[b, epoch], w.Phi)
        transpose(size, w.Phi, w.Phi_t)
    if epoch == 0 or system.Q.shape[1] > 1:
        b = run if system.Q.shape[0] > 1 else 0
        load(size, system.Q[b, epoch], w.Q)
    if epoch == 0 or system.u.shape[1] > 1:
        b = run if system.u.shape[0] > 1 else 0
        for i in range(system.u.shape[2]):
            w.u[i] = system.u[b, epoch, i]


@borrowing(forceinline=True)
def load_measurement(size: Size, system: Runs, run: int, epoch: int, w: Workspace) -> tuple[int, bool]:
    """Load ``z, H, R, S`` of an epoch.

    Returns
    -------
    present : int
        Rows that are there.
    correlated : bool
        Whether the noise of a row is correlated with that of another, or with the process noise.
    """
    b = run if system.z.shape[0] > 1 else 0
    k = epoch if system.z.shape[1] > 1 else 0
    rows = system.z.shape[2]
    present = 0
    for i in range(rows):
        w.z[i] = system.z[b, k, i]
        present += not np.isnan(w.z[i])
    if epoch == 0 or system.H.shape[1] > 1:
        b = run if system.H.shape[0] > 1 else 0
        load(size, system.H[b, epoch], w.H)
    b = run if system.R.shape[0] > 1 else 0
    k = epoch if system.R.shape[1] > 1 else 0
    correlated = False
    for i in range(rows):
        w.v[i] = 0.0
        for j in range(rows):
            w.R[i, j] = system.R[b, k, i, j]
            correlated |= i != j and w.R[i, j] != 0.0
    # Updates by rows that are tied change S; else it is zero, and stays.
    if epoch == 0 or system.S.shape[1] > 1 or w.tied[0]:
        b = run if system.S.shape[0] > 1 else 0
        k = epoch if system.S.shape[1] > 1 else 0
        for i in range(system.S.shape[2]):
            for j in range(rows):
                w.S_t[j, i] = system.S[b, k, i, j]
                correlated |= w.S_t[j, i] != 0.0
    w.tied[0] = correlated
    return present, correlated


@borrowing(forceinline=True)
def predict_state(size: Size, w: Workspace) -> None:
    """``x = Phi x + u``."""
    transposed_times(size, w.Phi_t, w.x, w.a)
    for i in range(len(size)):
        w.x[i] = w.a[i] + w.u[i]


@borrowing(forceinline=True)
def predict(size: Size, w: Workspace) -> None:
    """``x = Phi x + u``, ``P = Phi P Phi' + Q``."""
    predict_state(size, w)
    propagate_covariance(size, w.Phi, w.Phi_t, w.Q, w.P, w.temporary)


@borrowing(forceinline=True)
def innovate(size: Size, w: Workspace, innovation: Array, covariance: Array) -> None:
    """``nu = z - H x`` and ``H P H' + H S + S' H' + R`` of the predicted state."""
    for i in range(w.z.shape[0]):
        innovation[i] = w.z[i] - dot(size, w.H[i], w.x)
        transposed_times(size, w.P, w.H[i], w.a)
        for j in range(i + 1):
            total = dot(size, w.a, w.H[j])
            if w.tied[0]:
                total = total + dot(size, w.H[i], w.S_t[j]) + dot(size, w.S_t[i], w.H[j])
            covariance[i, j] = total + w.R[i, j]
            covariance[j, i] = covariance[i, j]


@borrowing(forceinline=True)
def row_variance(
    size: Size, w: Workspace, row: int, correlated: bool, columns: Any = None
) -> tuple[float, float, float]:
    """Innovation of one row, its variance, and ``h' s``; leaves its covariance with x, ``a = P h + s``, in ``w.a``.

    `columns` are those of ``H`` that are not zero, where that is known, and no noise is correlated: the bits are the same.
    """
    if columns is not None:
        transposed_times_at(size, columns, w.P, w.H[row], w.a)
        variance = dot_at(columns, w.H[row], w.a) + w.R[row, row]
        return w.z[row] - dot_at(columns, w.H[row], w.x), variance, 0.0
    transposed_times(size, w.P, w.H[row], w.a)
    h_s = 0.0
    if correlated:
        h_s = dot(size, w.H[row], w.S_t[row])
        for i in range(len(size)):
            w.a[i] += w.S_t[row, i]
    variance = dot(size, w.H[row], w.a) + h_s + w.R[row, row]
    return w.z[row] - dot(size, w.H[row], w.x) - w.v[row], variance, h_s


@borrowing(forceinline=True)
def update_by_row(
    size: Size, w: Workspace, row: int, nu: float, variance: float, h_s: float, correlated: bool, joseph: bool
) -> None:
    """Condition state and the noise of later rows on one row: exact for any ``R`` and ``S``, row by row.

    ``k = a / variance``; ``x += k nu``; ``P -= k a'``, and for Joseph's form ``(I - k h') P (I - k h')' + ...`` the
    same factor once more from the right: ``t = P h + s - k (h' s + r)``, zero but for rounding, ``P -= t k'``.
    """
    divide(size, w.a, variance, w.k)
    add_times(size, w.x, w.k, nu)
    if not joseph:
        take_off(size, w.P, w.a, 1.0 / variance)
    else:
        take_off_and_see(size, w.P, w.a, 1.0 / variance, w.H[row], w.t)
        add_difference(size, w.t, w.S_t[row], w.k, h_s + w.R[row, row])
        take_off_pair(size, w.P, w.t, w.k)
    if correlated:
        rows = w.z.shape[0]
        for i in range(row + 1, rows):
            w.g[i] = dot(size, w.H[row], w.S_t[i]) + w.R[row, i]
        for i in range(row + 1, rows):
            w.v[i] += w.g[i] / variance * nu
            for j in range(len(size)):
                w.S_t[i, j] -= w.k[j] * w.g[i]
            for j in range(row + 1, rows):
                w.R[i, j] -= w.g[i] * w.g[j] / variance


@borrowing(forceinline=True)
def settle(size: Size, w: Workspace) -> None:
    """After a row without noise: a variance that is zero but for rounding is zero, and so are its covariances."""
    for i in range(len(size)):
        if abs(w.P[i, i]) < ROUNDING * abs(w.a[i] * w.k[i]):
            for j in range(len(size)):
                w.P[i, j] = 0.0
                w.P[j, i] = 0.0


@borrowing(forceinline=True)
def holds(size: Size, w: Workspace, row: int, variance: float, noise: float) -> bool:
    """Whether P holds what a row showed: ``h P h'`` after it is ``noise (1 - noise / variance)``, to a half.

    A row that reads off one state of a huge variance leaves a small number in P; one that reads the sum of two such
    states leaves huge ones, whose rounding may be larger than the noise.
    """
    transposed_times(size, w.P, w.H[row], w.t)
    expected = noise * (1.0 - noise / variance)
    return abs(dot(size, w.H[row], w.t) - expected) < 0.5 * expected


@borrowing(forceinline=True)
def still_positive(size: Size, w: Workspace) -> bool:
    """Whether no variance is below zero by more than rounding of the largest it ever was; rounding becomes zero."""
    for i in range(len(size)):
        if w.P[i, i] < 0.0:
            if w.P[i, i] < -ROUNDING * w.largest[i]:
                return False
            w.P[i, i] = 0.0
    return True


@borrowing(forceinline=True)
def fault_before(variance: float, noise: float, correlated: bool, joseph: bool) -> int:
    """What is wrong with the variance of a row's innovation."""
    if not variance > 0.0:
        return NO_INNOVATION_VARIANCE
    small = variance < (1.0 - ROUNDING) * noise
    if not correlated and (small or (not joseph and variance > PLAIN_RANGE * noise > 0)):
        return NOT_POSITIVE
    return SOUND


@borrowing(forceinline=True)
def fault_after(size: Size, w: Workspace, row: int, variance: float, noise: float, correlated: bool) -> int:
    """What is wrong with P after a row; what a row without noise shows is zero there."""
    if noise == 0.0:
        settle(size, w)
    elif not correlated and variance > JOSEPH_RANGE * noise and not holds(size, w, row, variance, noise):
        return NOT_POSITIVE
    return SOUND


@borrowing(forceinline=True)
def remember_largest(size: Size, w: Workspace) -> None:
    """The largest variance that each state has had: the measure of what rounding may take from it."""
    for i in range(len(size)):
        w.largest[i] = max(w.largest[i], w.P[i, i])


@borrowing(forceinline=True)
def update(size: Size, w: Workspace, correlated: bool, joseph: bool, columns: Any = None) -> tuple[int, float, float]:
    """Condition on all rows present; the failure if any, NIS and log-likelihood. For `columns` see :func:`row_variance`."""
    nis = 0.0
    log_likelihood = 0.0
    remember_largest(size, w)
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        nu, variance, h_s = row_variance(size, w, row, correlated, columns)
        noise = w.R[row, row]
        fault = fault_before(variance, noise, correlated, joseph)
        if fault != SOUND:
            return fault, nis, log_likelihood
        nis += nu * nu / variance
        log_likelihood -= 0.5 * (nu * nu / variance + np.log(variance) + LOG_2PI)
        update_by_row(size, w, row, nu, variance, h_s, correlated, joseph)
        fault = fault_after(size, w, row, variance, noise, correlated)
        if fault != SOUND:
            return fault, nis, log_likelihood
    if not still_positive(size, w):
        return NOT_POSITIVE, nis, log_likelihood
    return SOUND, nis, log_likelihood


@borrowing(forceinline=True)
def keep(out: Histories, run: int, epoch: int, last: int, w: Workspace) -> None:
    """Keep state, sigma and covariance of an epoch in those histories that have room; the last epoch in all."""
    n = out.x.shape[2]
    if out.x.shape[1] > epoch or epoch == last:
        k = epoch if out.x.shape[1] > 1 else 0
        for i in range(n):
            out.x[run, k, i] = w.x[i]
            out.sigma[run, k, i] = np.sqrt(w.P[i, i])
    if out.P.shape[1] > epoch or epoch == last:
        copy_corner(w.P, out.P[run, epoch if out.P.shape[1] > 1 else 0], n, n)


@borrowing(forceinline=True)
def conclude(out: Histories, run: int, epoch: int, failure: int, nis: float, log_likelihood: float) -> bool:
    """Note what an update did; whether the run can go on."""
    out.log_likelihood[run] += log_likelihood
    if out.nis.shape[1] > 0:
        out.nis[run, epoch] = nis
    if failure != SOUND:
        out.failure[run, 0] = failure
        out.failure[run, 1] = epoch
    return failure == SOUND
