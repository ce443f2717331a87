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
from truenorth.filters.system import Estimates, LinearSystem, runs_of

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
    shape, K = estimates.P.shape[:-3], system.epochs
    runs = runs_of(system, shape)
    found = Gains(np.empty((*shape, K, n, m)), np.empty((*shape, K, n, n)), system.H, np.empty((*shape, K, m, n)))
    given = (estimates.P, estimates.innovation, estimates.innovation_covariance, found.gain, found.step, found.H_Phi)
    _fill(runs, *(np.ascontiguousarray(a).reshape(-1, K, *a.shape[len(shape) + 1 :]) for a in given))
    return found


@compiled
def _fill(runs: Any, P: Any, innovation: Any, covariance: Any, gain: Any, step: Any, H_Phi: Any) -> None:
    """Gains of each run and epoch, and how an error goes on in it."""
    n, m = gain.shape[2], gain.shape[3]
    seen, cross, W = np.zeros((m, n)), np.zeros((m, n)), np.zeros((m, m))
    for b in range(gain.shape[0]):
        for k in range(gain.shape[1]):
            Phi = runs.Phi[min(b, runs.Phi.shape[0] - 1), min(k, runs.Phi.shape[1] - 1)]
            Q = runs.Q[min(b, runs.Q.shape[0] - 1), min(k, runs.Q.shape[1] - 1)]
            H = runs.H[min(b, runs.H.shape[0] - 1), min(k, runs.H.shape[1] - 1)]
            S = runs.S[min(b, runs.S.shape[0] - 1), min(k, runs.S.shape[1] - 1)]
            times(H, Phi, H_Phi[b, k])
            # H (Phi P Phi' + Q) + S', of m rows, not n: covariances are symmetric.
            if k == 0:
                times(H_Phi[b, k], runs.P0[min(b, runs.P0.shape[0] - 1)], seen)
            else:
                times(H_Phi[b, k], P[b, k - 1], seen)
            times(H, Q, cross)
            for a in range(m):
                for i in range(n):
                    for j in range(n):
                        cross[a, i] += seen[a, j] * Phi[i, j]
                    cross[a, i] += S[i, a]
            # An absent row becomes one of its own without information.
            for a in range(m):
                absent = np.isnan(innovation[b, k, a])
                for c in range(m):
                    apart = absent or np.isnan(innovation[b, k, c])
                    W[a, c] = (1.0 if a == c else 0.0) if apart else covariance[b, k, a, c]
                for i in range(n):
                    cross[a, i] = 0.0 if absent else cross[a, i]
            _solve(W, cross)
            for i in range(n):
                for a in range(m):
                    gain[b, k, i, a] = cross[a, i]
                for j in range(n):
                    step[b, k, i, j] = Phi[i, j]
                for a in range(m):
                    for j in range(n):
                        step[b, k, i, j] -= cross[a, i] * H_Phi[b, k, a, j]


@compiled
def _solve(W: Any, X: Any) -> None:
    """``X = W^-1 X`` of a positive definite `W`, by elimination in place: it needs no pivots."""
    m = len(W)
    for a in range(m):
        for c in range(a + 1, m):
            share = W[c, a] / W[a, a]
            for d in range(a + 1, m):
                W[c, d] -= share * W[a, d]
            for i in range(X.shape[1]):
                X[c, i] -= share * X[a, i]
    for a in range(m - 1, -1, -1):
        for c in range(a + 1, m):
            for i in range(X.shape[1]):
                X[a, i] -= W[a, c] * X[c, i]
        for i in range(X.shape[1]):
            X[a, i] /= W[a, a]


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
