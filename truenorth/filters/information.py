"""The information filter: a Kalman filter that may begin knowing nothing, and the smoother from two filters.

It carries the information matrix ``Y = P^-1`` and the vector ``y = Y x``. A measurement adds to them,
``Y += H' R^-1 H``, ``y += H' R^-1 z``, so that "nothing is known" is zero and not a large number. Prediction is the dear
part; with ``Q = B B'`` and ``M = Phi^-T Y Phi^-1`` it is ``L M L' + J J'``, ``J = M B (I + B' M B)^-1``, ``L = I - J B'``, which
stays positive semidefinite and takes a singular Q.

Run backwards, without a prior, the same recursion gives what the *later* measurements know of each epoch and needs no
inverse of Phi; joined with the Kalman filter before, it is the backward-forward smoother.

Sources: D. C. Fraser, J. E. Potter, The optimum linear smoother as a combination of two optimum linear filters, IEEE
Trans. Autom. Control 14, 1969; P. S. Maybeck, *Stochastic Models, Estimation and Control*, vol. 1, 1979, section 5.7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import scaled_cholesky, symmetric, times
from truenorth.filters.kalman import kalman
from truenorth.filters.smoother import Smoothed
from truenorth.filters.stack import Array
from truenorth.filters.system import FilterState, LinearSystem

InformationHistory = Literal["last", "full"]

UNKNOWN = 1e-12  # of the information, each state in units of its own: less is rounding
TOUCHED = 1e-4  # part of an unknown direction in a state, above which the state is not known


class InformationState(NamedTuple):
    """Information to go on from; zeros are no information.

    Attributes
    ----------
    y : (..., n) array
    Y : (..., n, n) array
    """

    y: Array
    Y: Array


@dataclass(frozen=True)
class InformationEstimates:
    """What the information filter found; time axes hold every epoch with ``history="full"``, else the last only.

    Parameters
    ----------
    y : (..., K or 1, n) array
    Y : (..., K or 1, n, n) array
    x : (..., K or 1, n) array
        State; NaN where it is not determined yet.
    sigma : (..., K or 1, n) array
        Infinite there.
    P : (..., K or 1, n, n) array
        Covariance; NaN in rows and columns of what is not determined, infinite on the diagonal.
    state : InformationState
    """

    y: Array
    Y: Array
    x: Array
    sigma: Array
    P: Array
    state: InformationState


def no_information(system: LinearSystem) -> InformationState:
    """The state of knowing nothing of any state of a system."""
    n = system.states
    return InformationState(np.zeros((*system.runs, n)), np.zeros((*system.runs, n, n)))


def information(
    system: LinearSystem, state: InformationState | None = None, *, history: InformationHistory = "last"
) -> InformationEstimates:
    """Information filter.

    NumPy over all runs at once, some 300 us an epoch of 15 states: meant for starts without a prior, not for speed.

    Parameters
    ----------
    system : LinearSystem
        With invertible Phi, positive definite R and without S.
    state : InformationState, optional
        In the place of ``x0, P0``: from an earlier call, or :func:`no_information`.
    history : "last" or "full"

    Raises
    ------
    UsageError
        S is given.
    DataError
        A singular Phi or R, naming the epoch; a singular P0.
    """
    if history not in get_args(InformationHistory):
        raise UsageError(f'history is {history!r}, expected "last" or "full"')
    _check(system)
    if state is None:
        state = _of_prior(system)
    n, shape, epochs = system.states, system.runs, system.epochs
    kept = epochs if history == "full" else 1
    ys, Ys = np.empty((*shape, kept, n)), np.empty((*shape, kept, n, n))
    y, Y = np.broadcast_to(state.y, (*shape, n)), np.broadcast_to(state.Y, (*shape, n, n))
    for k in range(epochs):
        try:
            back = np.linalg.inv(_at(system.Phi, k, 2))
        except np.linalg.LinAlgError:
            raise DataError(f"information filter: Phi is singular at epoch {k}; use the Kalman filter") from None
        forth = np.swapaxes(back, -1, -2)
        M, y = forth @ Y @ back, times(forth, y)
        if system.u is not None:
            y = y + times(M, _at(system.u, k, 1))
        Y, y = _spread(M, y, _root(_at(system.Q, k, 2)))
        dY, dy = _said(system, k)
        Y, y = Y + dY, y + dy
        ys[..., k if kept > 1 else 0, :], Ys[..., k if kept > 1 else 0, :, :] = y, Y
    x, sigma, P = determined(ys, Ys)
    return InformationEstimates(ys, Ys, x, sigma, P, InformationState(ys[..., -1, :], Ys[..., -1, :, :]))


def information_behind(system: LinearSystem) -> InformationState:
    """What all *later* measurements tell of the state at each epoch, without a prior.

    Parameters
    ----------
    system : LinearSystem
        With positive definite R and without S.

    Returns
    -------
    InformationState
        ``y`` (..., K + 1, n) and ``Y`` (..., K + 1, n, n): entry 0 is what all measurements tell of the state before
        epoch 0, entry k + 1 what those after epoch k tell of epoch k; the last is zero.

    Raises
    ------
    UsageError, DataError
        As :func:`information`.
    """
    _check(system)
    n, shape, epochs = system.states, system.runs, system.epochs
    ys, Ys = np.zeros((*shape, epochs + 1, n)), np.zeros((*shape, epochs + 1, n, n))
    for k in range(epochs - 1, -1, -1):
        dY, dy = _said(system, k)
        Y, y = _spread(Ys[..., k + 1, :, :] + dY, ys[..., k + 1, :] + dy, _root(_at(system.Q, k, 2)))
        Phi = _at(system.Phi, k, 2)
        Phi_t = np.swapaxes(Phi, -1, -2)
        if system.u is not None:
            y = y - times(Y, _at(system.u, k, 1))
        ys[..., k, :], Ys[..., k, :, :] = times(Phi_t, y), Phi_t @ Y @ Phi
    return InformationState(ys, Ys)


def two_filter_smoother(system: LinearSystem, state: FilterState | None = None) -> Smoothed:
    """Fixed-interval smoother from a Kalman filter forwards and an information filter backwards.

    The same answer as :func:`truenorth.filters.smoother`, found another way; that one is faster and takes S.

    Parameters
    ----------
    system : LinearSystem
        With positive definite R and without S.
    state : FilterState, optional
        From an earlier call of a filter; replaces ``x0, P0``.

    Raises
    ------
    UsageError, DataError
        As :func:`information` and :func:`truenorth.filters.kalman`.
    """
    behind = information_behind(system)
    forward = kalman(system, state, history="full")
    n, shape = system.states, system.runs
    x0, P0 = (system.x0, system.P0) if state is None else (state.x, state.P)
    x = np.concatenate([np.broadcast_to(x0, (*shape, n))[..., None, :], forward.x], axis=-2)
    P = np.concatenate([np.broadcast_to(P0, (*shape, n, n))[..., None, :, :], forward.P], axis=-3)
    # With B B' = P: P_s = B (I + B' Y B)^-1 B', x_s = x + P_s (y - Y x). Nothing singular is inverted.
    B = _root(P)
    half = np.swapaxes(B, -1, -2)
    C = np.linalg.inv(np.eye(n) + half @ behind.Y @ B)
    P_s = B @ symmetric(C) @ half
    x_s = x + times(P_s, behind.y - times(behind.Y, x))
    sigma = np.sqrt(np.diagonal(P_s, axis1=-2, axis2=-1))
    return Smoothed(x_s[..., 1:, :], sigma[..., 1:, :], P_s[..., 1:, :, :], x_s[..., 0, :], P_s[..., 0, :, :], forward)


def determined(y: Array, Y: Array) -> tuple[Array, Array, Array]:
    """State, sigma and covariance of an information vector and matrix, as far as they determine them.

    Parameters
    ----------
    y : (..., n) array
    Y : (..., n, n) array

    Returns
    -------
    x, sigma : (..., n) arrays
        NaN and infinity where a state is not determined.
    P : (..., n, n) array
    """
    size = np.sqrt(np.diagonal(Y, axis1=-2, axis2=-1))
    size = np.where(size > 0.0, size, 1.0)
    share, V = np.linalg.eigh(Y / (size[..., :, None] * size[..., None, :]))
    known = share > UNKNOWN * np.maximum(share[..., -1:], UNKNOWN)
    inverse = np.where(known, 1.0 / np.where(known, share, 1.0), 0.0)
    V_t = np.swapaxes(V, -1, -2)
    P = (V * inverse[..., None, :]) @ V_t / (size[..., :, None] * size[..., None, :])
    open_part = np.sqrt(np.sum(np.where(known[..., None, :], 0.0, V) ** 2, axis=-1))
    is_open = open_part > TOUCHED
    x = np.where(is_open, np.nan, times(P, y))
    P = np.where(is_open[..., :, None] | is_open[..., None, :], np.nan, P)
    diagonal = np.where(is_open, np.inf, np.diagonal(P, axis1=-2, axis2=-1))
    i = np.arange(P.shape[-1])
    P[..., i, i] = diagonal
    return x, np.sqrt(diagonal), P


def _check(system: LinearSystem) -> None:
    if system.S is not None and system.S.any():
        raise UsageError("S is given: the information form has no place for it; use the Kalman filter and its smoother")


def _of_prior(system: LinearSystem) -> InformationState:
    try:
        size, L = scaled_cholesky(system.P0)
    except np.linalg.LinAlgError:
        raise DataError("information filter: P0 is singular; use the Kalman filter") from None
    back = np.linalg.inv(L) / size[..., None, :]
    Y = np.swapaxes(back, -1, -2) @ back
    return InformationState(times(Y, system.x0), Y)


def _spread(M: Array, y: Array, B: Array) -> tuple[Array, Array]:
    """Information after adding noise ``B w``, w of unit covariance."""
    MB = M @ B
    inside = np.eye(M.shape[-1]) + np.swapaxes(B, -1, -2) @ MB
    J = np.swapaxes(np.linalg.solve(inside, np.swapaxes(MB, -1, -2)), -1, -2)
    L = np.eye(M.shape[-1]) - J @ np.swapaxes(B, -1, -2)
    Y = L @ M @ np.swapaxes(L, -1, -2) + J @ np.swapaxes(J, -1, -2)
    return symmetric(Y), times(L, y)


def _said(system: LinearSystem, k: int) -> tuple[Array, Array]:
    """``H' R^-1 H`` and ``H' R^-1 z`` of the rows present at an epoch."""
    z, H, R = _at(system.z, k, 1), _at(system.H, k, 2), _at(system.R, k, 2)
    absent: NDArray[np.bool_] = np.isnan(z)
    # An absent row becomes one of its own that sees nothing.
    R = np.where(absent[..., :, None] | absent[..., None, :], np.eye(system.rows), R)
    H = np.where(absent[..., :, None], 0.0, H)
    try:
        sigma, L = scaled_cholesky(R)
    except np.linalg.LinAlgError:
        raise DataError(
            f"information filter: R is singular at epoch {k}, its information infinite; use the Kalman filter"
        ) from None
    half = np.linalg.solve(L, H / sigma[..., :, None])
    half_t = np.swapaxes(half, -1, -2)
    white = np.linalg.solve(L, (np.where(absent, 0.0, z) / sigma)[..., None])
    return half_t @ half, (half_t @ white)[..., 0]


def _root(Q: Array) -> Array:
    """B with ``B B' = Q``, for a positive semidefinite Q in whatever units."""
    size = np.sqrt(np.diagonal(Q, axis1=-2, axis2=-1))
    size = np.where(size > 0.0, size, 1.0)
    variance, V = np.linalg.eigh(Q / (size[..., :, None] * size[..., None, :]))
    return np.asarray(size[..., :, None] * V * np.sqrt(np.maximum(variance, 0.0))[..., None, :])


def _at(a: Array, k: int, core: int) -> Array:
    """Epoch k of an array with time before its last `core` axes."""
    time = a.ndim - core - 1
    return np.asarray(np.take(a, k if a.shape[time] > 1 else 0, axis=time))
