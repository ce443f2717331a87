"""The posterior Cramer-Rao bound: a covariance that no estimator's errors fall below, on average over the scenario.

The information about the state runs as ``J_k = D22 - D21 (J_{k-1} + D11)^-1 D12`` with, for additive Gaussian noise,
``D11 = E F' Q^-1 F``, ``D12 = -E F' Q^-1``, ``D22 = Q^-1 + E H' R^-1 H``: expectations over true trajectories of Jacobians taken
*at the truth*. A nonlinear system so enters as its linearisation about trajectories that were drawn, one run each.

Source: P. Tichavsky, C. H. Muravchik, A. Nehorai, Posterior Cramer-Rao bounds for discrete-time nonlinear filtering, IEEE
Trans. Signal Processing 46, 1998, eqs. 21 and 34-36.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import Callback
from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import scaled_cholesky, symmetric
from truenorth.filters import LinearSystem, NonlinearSystem
from truenorth.filters.nonlinear_system import require_jacobians, require_vector_space

Array = NDArray[np.float64]

SAME = 1e-12  # of an element of Phi: runs that differ by less have one Phi


@dataclass(frozen=True)
class CramerRao:
    """Bound after each epoch.

    Attributes
    ----------
    P : (K, n, n) array
        Covariance of the error, at least.
    sigma : (K, n) array
    """

    P: Array
    sigma: Array


def cramer_rao(system: LinearSystem) -> CramerRao:
    """Posterior Cramer-Rao bound of a scenario.

    For a linear system of one run it is the covariance of the Kalman filter. An expectation over few trajectories is itself
    uncertain: about as much as the mean over runs of what varies in ``H' R^-1 H`` and Phi.

    Parameters
    ----------
    system : LinearSystem
        Jacobians at the truth, the run axes being drawn trajectories; `x0` and `u` do not matter, of `z` only which rows are
        present. Without S.

    Raises
    ------
    UsageError
        S, or a P0 or Q that differs from run to run.
    DataError
        P0 is singular; R is singular; or Phi differs from run to run while Q is singular (then the bound degenerates:
        give every state some noise, or take the trajectories one by one).
    """
    _check(system)
    n, epochs = system.states, system.epochs
    P = _common("P0", system.P0, 2)
    Q = _common("Q", system.Q, 3)
    J = _inverse(P, "P0 is singular; leave out states known exactly")
    out = np.empty((epochs, n, n))
    for k in range(epochs):
        Phi, Q_k = _epoch(system.Phi, k, 2), Q[k if len(Q) > 1 else 0]
        said = np.mean(_said(system, k), axis=0)
        mean = Phi.mean(axis=0)
        if np.all(np.abs(Phi - mean) <= SAME * np.abs(mean).max()):
            J = _inverse(mean @ _inverse(J, _LOST) @ mean.T + Q_k, f"Phi P Phi' + Q is singular at epoch {k}") + said
        else:
            noise = _inverse(
                Q_k, f"Q is singular at epoch {k} while Phi differs from run to run: the bound degenerates"
            )
            D11 = np.mean(np.swapaxes(Phi, -1, -2) @ noise @ Phi, axis=0)
            D12 = -mean.T @ noise
            J = noise - D12.T @ np.linalg.solve(J + D11, D12) + said
        J = symmetric(J)
        out[k] = _inverse(J, _LOST)
    return CramerRao(out, np.sqrt(np.diagonal(out, axis1=-2, axis2=-1)))


def linearised_at(system: NonlinearSystem, truth: Array) -> LinearSystem:
    """The tangent of a nonlinear system along true trajectories: what :func:`cramer_rao` takes.

    Parameters
    ----------
    system : NonlinearSystem
        With both Jacobians and without retraction; of `z` only which rows are present matters.
    truth : (L, K + 1, n) array
        States of L drawn trajectories, the one before epoch 0 first. Draw them from the prior and the process noise.

    Returns
    -------
    LinearSystem
        With L runs.

    Raises
    ------
    UsageError
        A Jacobian is missing, the system has a retraction or runs of its own, or `truth` has another shape.
    """
    require_jacobians(system, "the Cramer-Rao bound")
    F, H = cast(Callback, system.transition_jacobian), cast(Callback, system.measurement_jacobian)
    require_vector_space(system, "the Cramer-Rao bound")
    truth = np.ascontiguousarray(truth, dtype=np.float64)
    n, m, K = system.states, system.rows, system.epochs
    if truth.ndim != 3 or truth.shape[1:] != (K + 1, n):
        raise UsageError(f"linearised_at: truth has shape {truth.shape}, expected (L, K + 1, n) = (L, {K + 1}, {n})")
    p = np.zeros((1, 0)) if system.p is None else system.p
    if p.ndim > 2 or system.z.ndim > 2:
        raise UsageError("linearised_at: p or z has run axes, expected one scenario for all trajectories")
    Phi, rows = np.zeros((len(truth), K, n, n)), np.zeros((len(truth), K, m, n))
    for run in range(len(truth)):
        for k in range(K):
            at = p[k if len(p) > 1 else 0]
            F(truth[run, k], at, Phi[run, k])
            H(truth[run, k + 1], at, rows[run, k])
    return LinearSystem(
        Phi, system.Q, rows, system.R, np.where(np.isnan(system.z), np.nan, 0.0), np.zeros(n), system.P0
    )


_LOST = "the information is lost in rounding; bring the states to like sizes, or P0 nearer to what is known"


def _check(system: LinearSystem) -> None:
    if system.S is not None and system.S.any():
        raise UsageError("cramer_rao: S is given; the bound is for noise that is independent of the process noise")


def _common(name: str, a: Array, core: int) -> Array:
    """What all runs must share, without their axes."""
    flat = a.reshape(-1, *a.shape[a.ndim - core :])
    if np.any(flat != flat[0]):
        raise UsageError(f"cramer_rao: {name} differs from run to run, expected one for all trajectories")
    return flat[0]


def _epoch(a: Array, k: int, core: int) -> Array:
    """(runs or 1, ...) of an epoch."""
    flat = a.reshape(-1, *a.shape[a.ndim - core - 1 :])
    return flat[:, k if flat.shape[1] > 1 else 0]


def _said(system: LinearSystem, k: int) -> Array:
    """(runs or 1, n, n) ``H' R^-1 H`` of the rows present."""
    absent = np.isnan(_epoch(system.z, k, 1))
    R = np.where(absent[..., :, None] | absent[..., None, :], np.eye(system.rows), _epoch(system.R, k, 2))
    H = np.where(absent[..., :, None], 0.0, _epoch(system.H, k, 2))
    return np.asarray(np.swapaxes(H, -1, -2) @ _inverse(R, f"R is singular at epoch {k}") @ H)


def _inverse(A: Array, trouble: str) -> Array:
    """Of positive definite matrices in whatever units."""
    try:
        size, root = scaled_cholesky(A)
    except np.linalg.LinAlgError:
        raise DataError(f"cramer_rao: {trouble}") from None
    L = np.linalg.inv(root) / size[..., None, :]
    return np.asarray(np.swapaxes(L, -1, -2) @ L)
