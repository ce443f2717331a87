"""The Kalman filter: predict, and condition on one measurement row after the other.

Sources: R. E. Kalman, A new approach to linear filtering and prediction problems, J. Basic Eng. 82, 1960;
P. D. Joseph's form of the update in R. S. Bucy, P. D. Joseph, *Filtering for Stochastic Processes with Applications
to Guidance*, 1968; rows one by one and correlated noise: D. Simon, *Optimal State Estimation*, 2006, sections 6.1, 7.1.
"""

from __future__ import annotations

from truenorth.core.compiled import compiled
from truenorth.core.linalg import Size
from truenorth.filters.drive import History, drive
from truenorth.filters.recursion import (
    Histories,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict,
    update,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs


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
                if not conclude(out, run, epoch, failure, nis, log_likelihood):
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
        form takes two thirds of the time of an update. Where P cannot hold what a row tells in either form (rows that mix
        states with a prior some 1e16 times R), the filter stops and says so; :func:`truenorth.filters.square_root` goes on.
    workers : int
        Threads that share the runs; the bits do not depend on it.

    Returns
    -------
    Estimates

    Raises
    ------
    DataError
        The variance of an innovation or of a state is not positive, or there is nothing but rounding left in P, naming run
        and epoch.
    """

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        kalman_runs(size, runs, epochs, joseph, out)

    return drive(kernel, system, state, history=history, innovations=innovations, workers=workers)
