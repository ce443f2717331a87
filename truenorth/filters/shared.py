"""Runs that share all but their measurements: one covariance and one gain for all, the states side by side.

The covariance does not depend on what was measured. Where runs have the same system and the same rows present, it is worked out
once for a block of them, and the states of a block stand in the lanes of registers: eight runs to an instruction. Each run does
the operations of :mod:`truenorth.filters.recursion` in their order: the bits are those of a run by itself.
"""

from __future__ import annotations

import numpy as np

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import Array, Size, copy_corner, four_rows, propagate_covariance
from truenorth.filters.recursion import (
    LOG_2PI,
    NOT_POSITIVE,
    SOUND,
    Histories,
    Workspace,
    begin,
    fault_after,
    fault_before,
    innovate,
    load_measurement,
    load_process,
    remember_largest,
    row_variance,
    still_positive,
    update_by_row,
    workspace,
)
from truenorth.filters.system import Runs

BLOCK = 256  # runs whose states stay in the cache
WORTH = 100_000  # epochs of all runs, below which it saves less than the kernel takes to load or compile


def shares(runs: Runs, count: int, epochs: int) -> bool:
    """Whether many runs share all but measurements and initial states, with the same rows present.

    Noise of a row that is correlated with another's is not: what a row shows of the next one's noise is each run's own.
    """
    own = (runs.Phi, runs.Q, runs.H, runs.R, runs.u, runs.S)
    if count < 2 or count * epochs < WORTH or any(len(a) > 1 for a in own) or len(runs.z) < count or runs.S.any():
        return False
    if runs.R[..., ~np.eye(runs.R.shape[-1], dtype=np.bool_)].any() or (runs.P0[0] != runs.P0).any():
        return False
    absent = np.isnan(runs.z)
    return bool(np.all(absent == absent[0]))


def run_shared(size: Size, runs: Runs, epochs: int, joseph: bool, out: Histories) -> None:
    """Filter all runs, a block after the other."""
    for start in range(0, len(out.x), BLOCK):
        stop = min(start + BLOCK, len(out.x))
        wide = 8 * -(-(stop - start) // 8)
        x, x_next, of_runs = np.zeros((len(size), wide)), np.zeros((len(size), wide)), np.zeros((3, wide))
        shared_runs(size, runs, epochs, joseph, start, stop - start, x, x_next, of_runs, out)


@compiled
def shared_runs(
    size: Size,
    system: Runs,
    epochs: int,
    joseph: bool,
    start: int,
    count: int,
    x: Array,
    x_next: Array,
    of_runs: Array,
    out: Histories,
) -> None:
    """Filter runs from `start` on; `x` and `x_next` (N, W) and `of_runs` (3, W) are worked in, W a multiple of 8."""
    n, rows = system.x0.shape[1], system.z.shape[2]
    w, nu, covariance = workspace(size, rows), np.zeros(rows), np.zeros((rows, rows))
    begin(size, system, 0, w)
    for run in range(count):
        for i in range(n):
            x[i, run] = system.x0[start + run if system.x0.shape[0] > 1 else 0, i]
    for epoch in range(epochs):
        load_process(size, system, 0, epoch, w)
        propagate_covariance(size, w.Phi, w.Phi_t, w.Q, w.P, w.temporary)
        for i in range(0, len(size), 4):
            four_rows(size, w.Phi, x, None, i, x.shape[1], x_next)
        for i in range(n):
            for run in range(x.shape[1]):
                x[i, run] = x_next[i, run] + w.u[i]
        present, _ = load_measurement(size, system, 0, epoch, w)
        if out.innovation.shape[1] > 0:
            innovate(size, w, nu, covariance)
            for row in range(rows):
                _innovations(system, epoch, start, count, w.H[row], row, x, of_runs[0])
                for run in range(count):
                    out.innovation[start + run, epoch, row] = of_runs[0, run]
                    for other in range(rows):
                        out.innovation_covariance[start + run, epoch, row, other] = covariance[row, other]
        failure = SOUND
        for run in range(x.shape[1]):
            of_runs[1, run], of_runs[2, run] = 0.0, 0.0
        if present > 0:
            failure = _condition(size, system, epoch, start, count, joseph, w, x, of_runs)
        for run in range(count):
            out.log_likelihood[start + run] += of_runs[2, run]
            if out.nis.shape[1] > 0:
                out.nis[start + run, epoch] = of_runs[1, run]
            if failure != SOUND:
                out.failure[start + run, 0] = failure
                out.failure[start + run, 1] = epoch
        if failure != SOUND:
            break
        _keep(out, start, count, epoch, epochs - 1, w, x)


@borrowing
def _innovations(system: Runs, epoch: int, start: int, count: int, h: Array, row: int, x: Array, nu: Array) -> None:
    """``z - h x`` of each run (W,)."""
    for run in range(x.shape[1]):
        nu[run] = 0.0
    for i in range(x.shape[0]):
        for run in range(x.shape[1]):
            nu[run] += h[i] * x[i, run]
    for run in range(count):
        nu[run] = system.z[start + run, epoch if system.z.shape[1] > 1 else 0, row] - nu[run]


@borrowing
def _condition(
    size: Size,
    system: Runs,
    epoch: int,
    start: int,
    count: int,
    joseph: bool,
    w: Workspace,
    x: Array,
    of_runs: Array,
) -> int:
    """Condition on the rows present; innovations, NIS and log-likelihood of each run stand in `of_runs`. The fault, if any."""
    remember_largest(size, w)
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        _, variance, h_s = row_variance(size, w, row, False)
        noise = w.R[row, row]
        fault = fault_before(variance, noise, False, joseph)
        if fault != SOUND:
            return fault
        _innovations(system, epoch, start, count, w.H[row], row, x, of_runs[0])
        size_of_row = np.log(variance)
        for run in range(count):
            square = of_runs[0, run] * of_runs[0, run] / variance
            of_runs[1, run] += square
            of_runs[2, run] -= 0.5 * (square + size_of_row + LOG_2PI)
        update_by_row(size, w, row, 0.0, variance, h_s, False, joseph)
        for i in range(len(size)):
            for run in range(count):
                x[i, run] += w.k[i] * of_runs[0, run]
        fault = fault_after(size, w, row, variance, noise, False)
        if fault != SOUND:
            return fault
    return SOUND if still_positive(size, w) else NOT_POSITIVE


@borrowing
def _keep(out: Histories, start: int, count: int, epoch: int, last: int, w: Workspace, x: Array) -> None:
    """State, sigma and covariance of an epoch in those histories that have room; the last epoch in all."""
    n = out.x.shape[2]
    if out.x.shape[1] > epoch or epoch == last:
        k = epoch if out.x.shape[1] > 1 else 0
        for i in range(n):
            sigma = np.sqrt(w.P[i, i])
            for run in range(count):
                out.x[start + run, k, i] = x[i, run]
                out.sigma[start + run, k, i] = sigma
    if out.P.shape[1] > epoch or epoch == last:
        for run in range(count):
            copy_corner(w.P, out.P[start + run, epoch if out.P.shape[1] > 1 else 0], n, n)
