"""The Kalman filter: predict, and condition on one measurement row after the other.

Sources: R. E. Kalman, A new approach to linear filtering and prediction problems, J. Basic Eng. 82, 1960;
P. D. Joseph's form of the update in R. S. Bucy, P. D. Joseph, *Filtering for Stochastic Processes with Applications
to Guidance*, 1968; rows one by one and correlated noise: D. Simon, *Optimal State Estimation*, 2006, sections 6.1, 7.1.
"""

from __future__ import annotations

import numpy as np

from truenorth.compiled import compiled
from truenorth.filters.drive import History, drive
from truenorth.filters.recursion import (
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    NOT_POSITIVE,
    SOUND,
    Histories,
    Workspace,
    begin,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict,
    row_variance,
    update_by_row,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs
from truenorth.linalg import Size

ROUNDING = 1e-13  # of a variance
PLAIN_RANGE = 1e13  # of an innovation's variance over its noise: beyond it the plain form leaves rounding in P


@compiled(forceinline=True)
def settle(size: Size, w: Workspace) -> None:
    """After a row without noise: a variance that is zero but for rounding is zero, and so are its covariances."""
    for i in range(len(size)):
        if abs(w.P[i, i]) < ROUNDING * abs(w.a[i] * w.k[i]):
            for j in range(len(size)):
                w.P[i, j] = 0.0
                w.P[j, i] = 0.0


@compiled(forceinline=True)
def still_positive(size: Size, w: Workspace) -> bool:
    """Whether no variance is below zero by more than rounding of the largest it ever was; rounding becomes zero."""
    for i in range(len(size)):
        if w.P[i, i] < 0.0:
            if w.P[i, i] < -ROUNDING * w.largest[i]:
                return False
            w.P[i, i] = 0.0
    return True


@compiled(forceinline=True)
def update(size: Size, w: Workspace, correlated: bool, joseph: bool) -> tuple[int, float, float]:
    """Condition on all rows present; the failure if any, NIS and log-likelihood."""
    nis = 0.0
    log_likelihood = 0.0
    for i in range(len(size)):
        w.largest[i] = max(w.largest[i], w.P[i, i])
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        nu, variance, h_s = row_variance(size, w, row, correlated)
        noise = w.R[row, row]
        if not variance > 0.0:
            return NO_INNOVATION_VARIANCE, nis, log_likelihood
        if not correlated and (
            variance < (1.0 - ROUNDING) * noise or (not joseph and variance > PLAIN_RANGE * noise > 0)
        ):
            return NOT_POSITIVE, nis, log_likelihood
        nis += nu * nu / variance
        log_likelihood -= 0.5 * (nu * nu / variance + np.log(variance) + LOG_2PI)
        update_by_row(size, w, row, nu, variance, h_s, correlated, joseph)
        if noise == 0.0:
            settle(size, w)
    if not still_positive(size, w):
        return NOT_POSITIVE, nis, log_likelihood
    return SOUND, nis, log_likelihood


@compiled
def kalman_runs(size: Size, system: Runs, epochs: int, joseph: bool, out: Histories) -> None:
    """Kalman filter of each run."""
    w = workspace(size, system.z.shape[2])
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict(size, w)
            present, correlated = load_measurement(size, system, run, epoch, w)
            if out.innovation.shape[1] > 0:
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
            if present > 0:
                failure, nis, log_likelihood = update(size, w, correlated, joseph)
                out.log_likelihood[run] += log_likelihood
                if out.nis.shape[1] > 0:
                    out.nis[run, epoch] = nis
                if failure != SOUND:
                    out.failure[run, 0] = failure
                    out.failure[run, 1] = epoch
                    break
            keep(out, run, epoch, epochs - 1, w)


def kalman(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    history: History = "last",
    innovations: bool | None = None,
    joseph: bool = True,
    workers: int = 1,
) -> Estimates:
    """Kalman filter.

    Exact for any ``R`` (diagonal or not) and ``S``; absent rows (NaN) are left out.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call, to go on from; replaces ``x0, P0``. Chunks give the bits of one batch.
    history : "last", "sigma" or "full"
        Keep the last epoch only, also x and sigma of every epoch, or also P of every epoch.
    innovations : bool, optional
        Keep innovations, their covariances and NIS of every epoch; as a rule where a history is kept.
    joseph : bool
        Update the covariance in Joseph's form, which survives precise measurements of what was unknown; the plain
        form takes two thirds of the time of an update.
    workers : int
        Threads that share the runs; the bits do not depend on it.

    Returns
    -------
    Estimates

    Raises
    ------
    DataError
        The variance of an innovation or of a state is not positive, or the plain form would leave nothing but rounding
        in P, naming run and epoch.
    """

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        kalman_runs(size, runs, epochs, joseph, out)

    return drive(kernel, system, state, history=history, innovations=innovations, workers=workers)
