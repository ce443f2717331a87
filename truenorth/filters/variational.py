"""The variational Bayes filter: state and measurement noise are estimated together.

The variance r of each row is unknown and drifts: an inverse gamma distribution ``IG(alpha, beta)``, widened at each
epoch, ``alpha = rho alpha, beta = rho beta``. State and variances are taken as independent after the measurement, and
each is found from the other's mean, in turns: with ``r = beta / alpha`` the Kalman update; with its x and P
``alpha = alpha + 1/2``, ``beta = beta + (z - h x)^2 / 2 + h P h' / 2``. Unlike Sage and Husa's, this estimate is
positive by itself.

Source: S. Sarkka, A. Nummenmaa, Recursive noise adaptive Kalman filtering by variational Bayesian approximations,
IEEE Trans. Autom. Control 54, 2009.
"""

from __future__ import annotations

from typing import NamedTuple, Unpack

import numpy as np

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, load, transposed_times
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import SOUND, Workspace, update
from truenorth.filters.sage_husa import check_independent_rows
from truenorth.filters.system import Estimates, FilterState, LinearSystem


class Variational(NamedTuple):
    """Options of :func:`variational`."""

    rho: float
    worth: float
    iterations: int


class Predicted(NamedTuple):
    """The predicted state, from which each turn of an epoch begins, and `beta` before the epoch's rows."""

    x: Array
    P: Array
    beta: Array


@borrowing(forceinline=True)
def set_noise(w: Workspace, alpha: Array, beta: Array) -> None:
    """``R = beta / alpha``."""
    for row in range(w.z.shape[0]):
        w.R[row, row] = beta[row] / alpha[row]


@borrowing(forceinline=True)
def blame(size: Size, w: Workspace, before: Array, beta: Array) -> None:
    """``beta = before + (z - h x)^2 / 2 + h P h' / 2`` of each row present."""
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        transposed_times(size, w.P, w.H[row], w.a)
        residual = w.z[row] - dot(size, w.H[row], w.x)
        beta[row] = before[row] + 0.5 * residual * residual + 0.5 * dot(size, w.a, w.H[row])


def room(size: Size, rows: int, options: Variational) -> Predicted:
    """For the predicted state."""
    return Predicted(np.zeros(len(size)), np.zeros((len(size), len(size))), np.zeros(rows))


def adapt(size: Size, w: Workspace, options: Variational, own: Predicted, memory: Array) -> None:
    """Forget; the memory holds alpha, then beta."""
    rows = w.z.shape[0]
    alpha, beta = memory[:rows], memory[rows:]
    for row in range(rows):
        if np.isnan(alpha[row]):
            alpha[row], beta[row] = 0.5 * options.worth, 0.5 * options.worth * w.R[row, row]
        alpha[row], beta[row] = options.rho * alpha[row], options.rho * beta[row]
        own.beta[row] = beta[row]
        if not np.isnan(w.z[row]):
            alpha[row] += 0.5
    set_noise(w, alpha, beta)
    own.x[:] = w.x
    load(size, w.P, own.P)


def condition(
    size: Size, w: Workspace, options: Variational, own: Predicted, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """State and noise by turns; NIS and log-likelihood are of the first."""
    rows = w.z.shape[0]
    alpha, beta = memory[:rows], memory[rows:]
    failure, nis, log_likelihood = SOUND, 0.0, 0.0
    for turn in range(options.iterations):
        if present == 0 or failure != SOUND:
            break
        w.x[:] = own.x
        load(size, own.P, w.P)
        set_noise(w, alpha, beta)
        failure, turn_nis, turn_log_likelihood = update(size, w, False, True)
        if turn == 0:
            nis, log_likelihood = turn_nis, turn_log_likelihood
        blame(size, w, own.beta, beta)
    return failure, nis, log_likelihood


def report(size: Size, w: Workspace, options: Variational, own: Predicted, memory: Array, figures: Array) -> None:
    """The variances."""
    for row in range(len(figures)):
        figures[row] = memory[len(figures) + row] / memory[row]


variant(Variational, room=room, adapt=adapt, condition=condition, report=report)


def variational(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    rho: float = 0.99,
    worth: float = 10.0,
    iterations: int = 3,
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter that estimates the measurement noise by variational Bayes.

    `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    system
        As of :func:`truenorth.filters.sage_husa`; R is the prior guess of the variances.
    rho : float
        Forgetting factor; the memory is ``1 / (1 - rho)`` epochs.
    worth : float
        How many measurements the given R is worth.
    iterations : int
        Turns an epoch.

    Returns
    -------
    Estimates
        `adaptation` holds each row's variance, ``beta / alpha``, after the epoch. Innovation covariances, `nis` and
        `log_likelihood` are of the first turn, which knows this epoch's measurement not yet.

    Raises
    ------
    UsageError
        An option out of range, R not diagonal or with a zero, or S given.
    """
    if not 0.0 < rho <= 1.0:
        raise UsageError(f"rho is {rho}, expected more than 0 and at most 1")
    if not worth > 0.0 or not np.isfinite(worth):
        raise UsageError(f"worth is {worth}, expected a positive number")
    if iterations < 1:
        raise UsageError(f"iterations is {iterations}, expected at least 1")
    check_independent_rows(system)
    if (np.diagonal(system.R, axis1=-2, axis2=-1) == 0.0).any():
        raise UsageError("R has a zero on its diagonal: expected a guess of each row's variance")

    options = Variational(float(rho), float(worth), iterations)
    memory = np.full(2 * system.rows, np.nan)
    return run_linear(options, system, state, memory=memory, adaptation=system.rows, **running)
