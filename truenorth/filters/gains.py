"""The gains that a Kalman filter used, and how errors pass through them.

The error of the estimate obeys ``e_k = (I - K_k H_k) (Phi_k e_{k-1} - w_k) + K_k v_k``: linear in what caused it, so each
cause can be followed by itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.filters.stack import Array
from truenorth.filters.system import Estimates, LinearSystem

BLOCK = 512  # epochs that are worked on at once: what stands in between takes memory for these alone


class Gains(NamedTuple):
    """Gains of each epoch.

    Attributes
    ----------
    gain : (..., K, n, m) array
        ``K_k``; zero for absent rows.
    step : (..., K, n, n) array
        ``(I - K_k H_k) Phi_k``: how an error goes on.
    H : (..., K, m, n) array
        The system's own; of one epoch where all are the same.
    H_Phi : (..., K, m, n) array
        ``H_k Phi_k``: how an error of the epoch before is measured.
    """

    gain: Array
    step: Array
    H: Array
    H_Phi: Array

    @property
    def keep(self) -> Array:
        """``I - K_k H_k``, (..., K, n, n)."""
        return np.asarray(np.eye(self.gain.shape[-2]) - self.gain @ self.H)


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
    runs, K = estimates.P.shape[:-3], system.epochs
    H_Phi = np.broadcast_to(system.H @ system.Phi, (*runs, K, m, n))
    found = Gains(np.empty((*runs, K, n, m)), np.empty((*runs, K, n, n)), system.H, H_Phi)
    for first in range(0, K, BLOCK):
        epochs = slice(first, min(first + BLOCK, K))
        _fill(found, system, estimates, epochs)
    return found


def _fill(found: Gains, system: LinearSystem, estimates: Estimates, epochs: slice) -> None:
    """Gains of some epochs, and how an error goes on in them."""

    def cut(a: Array) -> Array:
        return a if a.shape[-3] == 1 else a[..., epochs, :, :]

    Phi, H, H_Phi, first = cut(system.Phi), cut(system.H), found.H_Phi[..., epochs, :, :], epochs.start
    P0 = np.broadcast_to(system.P0, (*estimates.P.shape[:-3], system.states, system.states))[..., None, :, :]
    before = estimates.P[..., max(0, first - 1) : epochs.stop - 1, :, :]
    before = before if first else np.concatenate([P0, before], axis=-3)
    # (Phi P Phi' + Q) H' + S, from the right: of m columns, not n.
    cross = Phi @ (before @ np.swapaxes(H_Phi, -1, -2)) + cut(system.Q) @ np.swapaxes(H, -1, -2)
    cross = cross + (0.0 if system.S is None else cut(system.S))
    # An absent row becomes one of its own without information.
    absent = np.isnan(estimates.innovation[..., epochs, :])
    covariance = estimates.innovation_covariance[..., epochs, :, :]
    W = np.where(absent[..., :, None] | absent[..., None, :], np.eye(system.rows), covariance)
    cross = np.where(absent[..., None, :], 0.0, cross)
    gain = np.swapaxes(np.linalg.solve(W, np.swapaxes(cross, -1, -2)), -1, -2)
    found.gain[..., epochs, :, :], found.step[..., epochs, :, :] = gain, Phi - gain @ H_Phi


def initial_part(step: Array, P0: Array, states: slice = slice(None)) -> tuple[Array, Array]:
    """Part of each epoch's covariance that an initial one makes.

    Parameters
    ----------
    step : (K, n, n) array
        Of :func:`filter_gains`.
    P0 : (n, n) array
        Initial covariance, or a part of it.
    states : slice
        The p states of which it is wanted at each epoch.

    Returns
    -------
    part : (K, p, p) array
    last : (n, n) array
        Of all states, at the last epoch.
    """
    whole, size = np.asarray(P0, dtype=np.float64), step.shape[-1]
    known = np.flatnonzero(whole.any(axis=0))  # the others make no part
    inner = whole[np.ix_(known, known)]
    part = np.empty((len(step), *whole[states, states].shape))
    response = np.empty((min(BLOCK, len(step)), size, len(known)))
    before = np.ascontiguousarray(np.eye(size)[:, known])
    for first in range(0, len(step), BLOCK):
        block = response[: min(BLOCK, len(step) - first)]
        _products(np.ascontiguousarray(step[first : first + BLOCK]), before, block)
        wanted = block[:, states]
        part[first : first + BLOCK] = wanted @ inner @ np.swapaxes(wanted, -1, -2)
        before = block[-1].copy()
    return part, np.asarray(before @ inner @ before.T)


def through(gains: Gains, signature: Array) -> tuple[Array, Array]:
    """What a filter makes of signatures in its measurements.

    Parameters
    ----------
    gains : Gains
        Of :func:`filter_gains`.
    signature : (K, m, S) array

    Returns
    -------
    innovation : (K, m, S) array
    x : (n, S) array
        The state at the last epoch.
    """
    innovation, x = np.empty_like(signature), np.zeros((gains.step.shape[-1], signature.shape[2]))
    arrays = (gains.H_Phi, gains.gain, gains.step, signature)
    _through(*(np.ascontiguousarray(a) for a in arrays), innovation, x, np.empty_like(x))
    return innovation, x


@compiled
def _products(step: Any, before: Any, response: Any) -> None:
    """``response[k] = step[k] ... step[1] step[0] before``, (K, n, p)."""
    times(step[0], before, response[0])
    for k in range(1, step.shape[0]):
        times(step[k], response[k - 1], response[k])


@compiled
def _through(H_Phi: Any, gain: Any, step: Any, signature: Any, innovation: Any, x: Any, work: Any) -> None:
    for k in range(signature.shape[0]):
        times(H_Phi[k], x, innovation[k])
        for i in range(signature.shape[1]):
            for s in range(signature.shape[2]):
                innovation[k, i, s] = signature[k, i, s] - innovation[k, i, s]
        times(step[k], x, work)
        times(gain[k], signature[k], x)
        for i in range(x.shape[0]):
            for s in range(x.shape[1]):
                x[i, s] += work[i, s]


@compiled
def times(A: Any, B: Any, C: Any) -> None:
    """``C = A B`` of any shapes; `C` is neither."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            C[i, j] = 0.0
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                C[i, j] += A[i, k] * B[k, j]
