"""The Sage-Husa filter: the variance of each measurement row is estimated from the innovations as they come.

Of an innovation nu with the predicted covariance P, ``E nu^2 = h P h' + r``, so that with fading weights
``r = (1 - d) r + d (nu^2 - h P h')``, ``d = (1 - b) / (1 - b^(k+1))`` at the row's k-th measurement: the plain mean at
first, a memory of ``1 / (1 - b)`` measurements later. A single difference may well be negative; the estimate is held
within limits about the given R. Estimating Q and R at once from the same innovations is not observable in general and
is known to diverge: only R is estimated.

Source: A. P. Sage, G. W. Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control Conf., 1969;
R. K. Mehra, Approaches to adaptive filtering, IEEE Trans. Autom. Control 17, 1972 (what can be observed).
"""

from __future__ import annotations

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, transposed_times
from truenorth.filters.drive import History, drive
from truenorth.filters.recursion import (
    Histories,
    Workspace,
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


@compiled(forceinline=True)
def estimate_noise(size: Size, w: Workspace, b: float, smallest: float, largest: float, r: Array, fade: Array) -> None:
    """Bring `r` of each row present up to date and put it into R; `fade` holds ``b^k``."""
    for row in range(w.z.shape[0]):
        given = w.R[row, row]
        if np.isnan(r[row]):
            r[row] = given
        if not np.isnan(w.z[row]):
            nu = w.z[row] - dot(size, w.H[row], w.x)
            transposed_times(size, w.P, w.H[row], w.a)
            fade[row] *= b
            d = (1.0 - b) / (1.0 - fade[row])
            r[row] = (1.0 - d) * r[row] + d * (nu * nu - dot(size, w.a, w.H[row]))
            r[row] = min(max(r[row], smallest * given), largest * given)
        w.R[row, row] = r[row]


@compiled
def sage_husa_runs(
    size: Size, system: Runs, epochs: int, b: float, smallest: float, largest: float, out: Histories
) -> None:
    """Sage-Husa filter of each run."""
    rows = system.z.shape[2]
    w = workspace(size, rows)
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        r, fade = out.memory[run, :rows], out.memory[run, rows:]
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict(size, w)
            present, correlated = load_measurement(size, system, run, epoch, w)
            estimate_noise(size, w, b, smallest, largest, r, fade)
            if out.innovation.shape[1] > 0:
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
                for row in range(rows):
                    out.adaptation[run, epoch, row] = r[row]
            if present > 0:
                failure, nis, log_likelihood = update(size, w, correlated, True)
                if not conclude(out, run, epoch, failure, nis, log_likelihood):
                    break
            keep(out, run, epoch, epochs - 1, w)


def sage_husa(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    b: float = 0.99,
    smallest: float = 1e-2,
    largest: float = 1e4,
    history: History = "last",
    innovations: bool | None = None,
    workers: int = 1,
) -> Estimates:
    """Kalman filter that estimates the measurement noise (Sage and Husa).

    Parameters
    ----------
    system : LinearSystem
        With a diagonal R, which is what each row begins with, and without S.
    state : FilterState, optional
        From an earlier call, to go on from.
    b : float
        Forgetting factor; the memory is ``1 / (1 - b)`` measurements.
    smallest, largest : float
        Limits of the estimated variance, in units of the given one.
    history, innovations, workers
        As in :func:`truenorth.filters.kalman`.

    Returns
    -------
    Estimates
        `adaptation` holds each row's estimated variance.

    Raises
    ------
    UsageError
        An option out of range, R not diagonal, or S given.
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    if not 0.0 < b < 1.0:
        raise UsageError(f"b is {b}, expected a number between 0 and 1")
    if not 0.0 < smallest <= 1.0 <= largest:
        raise UsageError(f"smallest is {smallest} and largest {largest}, expected 0 < smallest <= 1 <= largest")
    check_independent_rows(system)

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        sage_husa_runs(size, runs, epochs, float(b), float(smallest), float(largest), out)

    return drive(
        kernel,
        system,
        state,
        history=history,
        innovations=innovations,
        workers=workers,
        memory=np.concatenate([np.full(system.rows, np.nan), np.ones(system.rows)]),
        adaptation=system.rows,
    )


def check_independent_rows(system: LinearSystem) -> None:
    """The noise of each row stands alone: R is diagonal and there is no S."""
    off = system.R * (1.0 - np.eye(system.rows))
    if off.any():
        raise UsageError("R is not diagonal: to estimate variances row by row, decorrelate the measurements first")
    if system.S is not None and system.S.any():
        raise UsageError("S is given: variances estimated row by row need noise uncorrelated with the process noise")
