"""The one recursion of all nonlinear filters that carry a single normal distribution.

Predict, linearise the measurement (by tangents or by nodes, see :mod:`truenorth.filters.linearisation`), and update as
the Kalman filter does, row after row in Joseph's form. The update is that of the error: zero before it, and carried to
the estimate by the system's retraction after it. On the way the predicted covariance may be faded (strong tracking),
rows may be gated (before fading, and what the gate rejects makes no factor), and the linearisation may be repeated at
the new estimate.
"""

from __future__ import annotations

from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.linalg import Array, Size
from truenorth.filters.drive import Running, drive
from truenorth.filters.fading import SINGLE, fade, remember
from truenorth.filters.linearisation import (
    points,
)
from truenorth.filters.nonlinear_steps import (
    add_noise,
    are_correlated,
    begin_point,
    copy,
    keep_point,
    linear_at,
    load_epoch,
    load_rows,
    move,
)
from truenorth.filters.nonlinear_system import (
    Functions,
    NonlinearRuns,
    NonlinearSystem,
    functions_of,
    nonlinear_runs_of,
)
from truenorth.filters.quadrature import QuadratureRule
from truenorth.filters.recursion import (
    SOUND,
    Histories,
    Workspace,
    conclude,
    innovate,
    update,
    workspace,
)
from truenorth.filters.robust import GATE_EPOCHS, Gate, judge_and_update, squared
from truenorth.filters.strong_tracking import StrongTracking
from truenorth.filters.system import Estimates, FilterState

NO_GATE = -1


class Guarded(Running, total=False):
    """How a nonlinear filter is run.

    With these, `adaptation` of the :class:`Estimates` holds the factor of strong tracking, then each row's weight (1 taken, 0
    rejected, NaN absent); with a gate, `nis` is of all rows present and `log_likelihood` of those taken.

    Attributes
    ----------
    tracking : StrongTracking or None
        Fade the predicted covariance where innovations are larger than expected (with the noise of a regression among what
        is expected); nodes are then drawn from the faded one.
    gate : Gate or None
        Leave out measurements whose innovation is not to be believed.
    history, innovations, workers
        See :class:`Running`.
    """

    tracking: StrongTracking | None
    gate: Gate | None


class Options(NamedTuple):
    """What a filter does besides the plain recursion."""

    tracking: bool
    softening: float
    rho: float
    cap: float
    gate: int
    k0: float
    patience: int
    largest_nis: Array
    iterations: int
    tolerance: float


@compiled
def judge_epoch(nu: Array, W: Array, present: int, options: Options, rejected: Array, weights: Array) -> float:
    """Weights of all rows by the NIS of the epoch where the gate judges epochs, else NaN: to be judged; and the NIS."""
    nis, _ = squared(nu, W)
    for i in range(len(weights)):
        weights[i] = np.nan
    if options.gate == GATE_EPOCHS:
        taken = nis <= options.largest_nis[present] or rejected[0] >= options.patience
        rejected[0] = 0.0 if taken else rejected[0] + 1.0
        for i in range(len(weights)):
            weights[i] = 1.0 if taken else 0.0
    return nis


@compiled
def judge_before_fading(nu: Array, W: Array, present: int, options: Options, rejected: Array, weights: Array) -> None:
    """Weights of all rows by what the filter expects of them without a fading factor, each given the rows taken before it.

    A factor makes room for just what a gate is there to keep out: judged after it, little is ever rejected.
    """
    if options.gate == GATE_EPOCHS:
        judge_epoch(nu, W, present, options, rejected, weights)
        return
    for j in range(len(nu)):
        weights[j] = 1.0
        if np.isnan(nu[j]):
            continue
        if abs(nu[j]) > options.k0 * np.sqrt(W[j, j]) and rejected[j] < options.patience:
            weights[j] = 0.0
            rejected[j] += 1.0
            continue
        rejected[j] = 0.0
        for i in range(j + 1, len(nu)):
            part = W[i, j] / W[j, j]
            nu[i] -= part * nu[j]
            for k in range(j + 1, len(nu)):
                W[i, k] -= part * W[j, k]


@compiled
def correct(
    size: Size,
    w: Workspace,
    nu: Array,
    W: Array,
    present: int,
    options: Options,
    rejected: Array,
    weights: Array,
) -> tuple[int, float, float]:
    """Update by all rows, or by those that the gate lets pass; the failure if any, NIS and log-likelihood."""
    correlated = are_correlated(w.R)
    if options.gate == NO_GATE:
        return update(size, w, correlated, True)
    nis = squared(nu, W)[0] if options.tracking else judge_epoch(nu, W, present, options, rejected, weights)
    failure, log_likelihood = judge_and_update(
        size, w, correlated, options.gate, options.k0, options.k0, options.patience, rejected, weights
    )
    return failure, nis, log_likelihood


@compiled
def correct_again(size: Size, w: Workspace) -> int:
    """Update by all rows that are left; the failure, if any."""
    return update(size, w, are_correlated(w.R), True)[0]


@compiled
def nonlinear_runs(
    size: Size,
    functions: Functions,
    system: NonlinearRuns,
    epochs: int,
    rule: QuadratureRule,
    order: NDArray[np.int64],
    options: Options,
    out: Histories,
) -> None:
    """Nonlinear filter of each run."""
    N, rows, n = len(size), system.z.shape[2], system.P0.shape[1]
    w, s = workspace(size, rows), points(size, system, rule)
    P, X, dx = np.zeros((N, N)), np.zeros(system.x0.shape[1]), np.zeros(n)
    nu, W, weights, z = np.zeros(rows), np.zeros((rows, rows)), np.ones(rows), np.zeros(rows)
    lam, Lam, before = np.ones(max(rows, 1)), np.ones(N), np.zeros(N)
    first = 1 if options.tracking else 0
    for run in range(out.x.shape[0]):
        begin_point(size, system, run, w, s)
        V = out.memory[run, : rows * first]
        rejected = out.memory[run, rows * first :]
        for epoch in range(epochs):
            load_epoch(size, system, run, epoch, w, s)
            failure = linear_at(size, functions, rule, order, w, s, False)
            if failure != SOUND:
                conclude(out, run, epoch, failure, 0.0, 0.0)
                break
            if options.tracking:
                copy(size, w.P, P)
            add_noise(size, w)
            present = load_rows(size, system, run, epoch, w)
            if present > 0 or out.innovation.shape[1] > 0:
                failure = linear_at(size, functions, rule, order, w, s, True)
                if options.tracking and failure == SOUND:
                    if options.gate != NO_GATE:
                        innovate(size, w, nu, W)
                        judge_before_fading(nu, W, present, options, rejected, weights)
                    for i in range(rows):
                        z[i] = w.z[i]
                        if weights[i] == 0.0:  # what is not believed makes no factor
                            w.z[i] = np.nan
                    remember(size, w, options.rho, V)
                    copy(size, P, w.P)
                    fade(size, w, SINGLE, options.softening, options.cap, V, lam, Lam)
                    for i in range(rows):
                        w.z[i] = z[i]
                    if lam[0] > 1.0 and len(rule.mean) > 0:  # the nodes lie further out
                        load_rows(size, system, run, epoch, w)
                        failure = linear_at(size, functions, rule, order, w, s, True)
                if failure != SOUND:
                    conclude(out, run, epoch, failure, 0.0, 0.0)
                    break
                innovate(size, w, nu, W)
            if out.innovation.shape[1] > 0:
                for i in range(rows):
                    out.innovation[run, epoch, i] = nu[i]
                    for j in range(rows):
                        out.innovation_covariance[run, epoch, i, j] = W[i, j]
            if present > 0:
                if options.iterations > 1:
                    copy(size, w.P, P)
                    for i in range(len(X)):
                        X[i] = s.X[i]
                failure, nis, log_likelihood = correct(size, w, nu, W, present, options, rejected, weights)
                if not conclude(out, run, epoch, failure, nis, log_likelihood):
                    break
                move(functions, w, s, dx)
                for _ in range(1, options.iterations):
                    # Linearise at the last estimate, update from the prediction: z - h(X_i) + H (X_i - X).
                    load_rows(size, system, run, epoch, w)
                    failure = linear_at(size, functions, rule, order, w, s, True)
                    for i in range(n):
                        before[i] = dx[i]
                    for i in range(rows):
                        for j in range(n):
                            w.z[i] += w.H[i, j] * dx[j]
                        if weights[i] == 0.0:
                            w.z[i] = np.nan
                    copy(size, P, w.P)
                    for i in range(len(X)):
                        s.X[i] = X[i]
                    if failure == SOUND:
                        failure = correct_again(size, w)
                    if failure != SOUND:
                        break
                    move(functions, w, s, dx)
                    change = 0.0
                    for i in range(n):
                        change = max(change, abs(dx[i] - before[i]) - options.tolerance * np.sqrt(w.P[i, i]))
                    if change <= 0.0:
                        break
                if failure != SOUND:
                    conclude(out, run, epoch, failure, 0.0, 0.0)
                    break
            if out.innovation.shape[1] > 0:
                if options.tracking:
                    out.adaptation[run, epoch, 0] = lam[0]
                if options.gate != NO_GATE:
                    for i in range(rows):
                        here = np.isfinite(out.innovation[run, epoch, i])
                        out.adaptation[run, epoch, first + i] = weights[i] if here else np.nan
            keep_point(out, run, epoch, epochs - 1, s.X, w.P)


def run_nonlinear(
    system: NonlinearSystem,
    state: FilterState | None,
    rule: QuadratureRule,
    order: NDArray[np.int64],
    *,
    tracking: StrongTracking | None = None,
    gate: Gate | None = None,
    iterations: int = 1,
    tolerance: float = 0.0,
    **running: Unpack[Running],
) -> Estimates:
    """Run the kernel with its options; memory and adaptation are those of tracking, then of the gate."""
    functions, rows = functions_of(system), system.rows
    fading = tracking or StrongTracking()
    number, k0, patience, largest = gate.limits(rows) if gate else (NO_GATE, 0.0, 0, np.zeros(1))
    options = Options(
        tracking is not None,
        float(fading.softening),
        float(fading.rho),
        float(fading.cap),
        number,
        k0,
        patience,
        largest,
        iterations,
        float(tolerance),
    )

    def kernel(size: Size, runs: NonlinearRuns, epochs: int, out: Histories) -> None:
        nonlinear_runs(size, functions, runs, epochs, rule, order, options, out)

    remembered = [np.full(rows, np.nan)] if tracking else []
    if gate:
        remembered.append(np.zeros(max(rows, 1)))
    return drive(
        kernel,
        system,
        state,
        memory=np.concatenate(remembered) if remembered else None,
        adaptation=(1 if tracking else 0) + (rows if gate else 0),
        flatten=nonlinear_runs_of,
        **running,
    )
