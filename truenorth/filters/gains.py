"""The gains that a Kalman filter used, and how errors pass through them.

The error of the estimate obeys ``e_k = (I - K_k H_k) (Phi_k e_{k-1} - w_k) + K_k v_k``: linear in what caused it, so each
cause can be followed by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.filters.stack import Array
from truenorth.filters.system import Estimates, LinearSystem


class Gains(NamedTuple):
    """Gains of each epoch.

    Attributes
    ----------
    gain : (..., K, n, m) array
        ``K_k``; zero for absent rows.
    keep : (..., K, n, n) array
        ``I - K_k H_k``.
    step : (..., K, n, n) array
        ``(I - K_k H_k) Phi_k``: how an error goes on.
    """

    gain: Array
    keep: Array
    step: Array


def filter_gains(system: LinearSystem, estimates: Estimates) -> Gains:
    """Gains of a run of :func:`truenorth.filters.kalman`.

    Parameters
    ----------
    system : LinearSystem
    estimates : Estimates
        Of this system, with ``history="full"``.

    Raises
    ------
    UsageError
        The estimates lack their history.
    """
    n, m = system.states, system.rows
    if estimates.P.shape[-3] != system.epochs or estimates.innovation.shape[-2] != system.epochs:
        raise UsageError(
            f"the estimates hold P of {estimates.P.shape[-3]} and innovations of {estimates.innovation.shape[-2]} "
            f"epochs, expected all {system.epochs}: filter with history='full'"
        )
    Phi, H = system.Phi, system.H
    P0 = np.broadcast_to(system.P0, (*estimates.P.shape[:-3], n, n))
    before = np.concatenate([P0[..., None, :, :], estimates.P[..., :-1, :, :]], axis=-3)
    P_predicted = Phi @ before @ np.swapaxes(Phi, -1, -2) + system.Q
    cross = P_predicted @ np.swapaxes(H, -1, -2) + (0.0 if system.S is None else system.S)
    # An absent row becomes one of its own that tells nothing.
    absent = np.isnan(estimates.innovation)
    W = np.where(absent[..., :, None] | absent[..., None, :], np.eye(m), estimates.innovation_covariance)
    cross = np.where(absent[..., None, :], 0.0, cross)
    gain = np.swapaxes(np.linalg.solve(W, np.swapaxes(cross, -1, -2)), -1, -2)
    keep = np.eye(n) - gain @ H
    return Gains(gain, keep, keep @ Phi)


def initial_part(step: Array, P0: Array) -> Array:
    """Part of each epoch's covariance that an initial one makes, (K, n, n).

    Parameters
    ----------
    step : (K, n, n) array
        Of :func:`filter_gains`.
    P0 : (n, n) array
        Initial covariance, or a part of it.
    """
    response = np.empty(step.shape)
    e = np.eye(len(P0))
    for k, step_k in enumerate(step):
        e = step_k @ e
        response[k] = e
    return response @ P0 @ np.swapaxes(response, -1, -2)
