"""Estimates of one state by several filters, made into one; how they are correlated is stated, never assumed away.

Filters of the same process share its noise and its prior, so that their errors are correlated even where their
sensors are not. Known, the correlation is used (:func:`fuse`); unknown, it is allowed for
(:func:`covariance_intersection`); or it is made to vanish beforehand by handing each filter a share of the information
(:func:`federated`).

Sources: Y. Bar-Shalom, L. Campo, The effect of the common process noise on the two-sensor fused-track covariance, IEEE
Trans. Aerospace and Electronic Systems 22, 1986; S. J. Julier, J. K. Uhlmann, A non-divergent estimation algorithm in
the presence of unknown correlations, Proc. American Control Conf., 1997; N. A. Carlson, Federated square root filter
for decentralized parallel processes, IEEE Trans. Aerospace and Electronic Systems 26, 1990.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import scaled_cholesky, symmetric, times
from truenorth.filters.gains import filter_gains
from truenorth.filters.kalman import kalman
from truenorth.filters.stack import Array
from truenorth.filters.system import Estimates, FilterState, LinearSystem

Weights = Literal["variances", "optimal"]
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
SECTIONS = 60  # of the search for a weight: to 1e-12


class Fused(NamedTuple):
    """One estimate from several.

    Attributes
    ----------
    x : (..., n) array
    P : (..., n, n) array
    weight : (..., n, n) or (...) array
        Of the first estimate.
    """

    x: Array
    P: Array
    weight: Array


def fuse(x1: ArrayLike, P1: ArrayLike, x2: ArrayLike, P2: ArrayLike, P12: ArrayLike) -> Fused:
    """Best linear fusion of two estimates whose cross-covariance is known (Bar-Shalom and Campo).

    Parameters
    ----------
    x1, x2 : (..., n) arrays
    P1, P2 : (..., n, n) arrays
    P12 : (..., n, n) array
        Covariance of the first's error with the second's, of :func:`cross_covariance`; zeros for independent ones.

    Raises
    ------
    UsageError
        Shapes that do not fit.
    DataError
        The difference of the two has a singular covariance: in some direction they are the same estimate.
    """
    a, A, b, B, C = _checked(x1, P1, x2, P2, P12)
    Ct = np.swapaxes(C, -1, -2)
    G = _solved(A + B - C - Ct, np.swapaxes(A - C, -1, -2))  # G' = (P1 + P2 - P12 - P21)^-1 (P1 - P12)'
    G = np.swapaxes(G, -1, -2)
    x = a + times(G, b - a)
    P = A - G @ np.swapaxes(A - C, -1, -2)
    return Fused(x, symmetric(P), np.eye(a.shape[-1]) - G)


def diagonal_weighted(
    x1: ArrayLike, P1: ArrayLike, x2: ArrayLike, P2: ArrayLike, P12: ArrayLike, weights: Weights = "variances"
) -> Fused:
    """Fusion state by state, each with a weight from the diagonals of the covariances.

    The weights look at variances only; the covariance of the result does not, and holds for any weights.

    Parameters
    ----------
    x1, P1, x2, P2, P12
        As in :func:`fuse`.
    weights : "variances" or "optimal"
        ``P2_ii / (P1_ii + P2_ii)`` for the first, as for independent estimates; or ``(P2_ii - P12_ii) / (P1_ii + P2_ii -
        2 P12_ii)``, which leaves each state the least variance that a weight of its own can.

    Returns
    -------
    Fused
        `weight` is diagonal.
    """
    if weights not in get_args(Weights):
        raise UsageError(f'weights is {weights!r}, expected "variances" or "optimal"')
    a, A, b, B, C = _checked(x1, P1, x2, P2, P12)
    p1, p2, p12 = (np.diagonal(M, axis1=-2, axis2=-1) for M in (A, B, C))
    tie = p12 if weights == "optimal" else np.zeros_like(p12)
    total = p1 + p2 - 2.0 * tie
    w = np.divide(p2 - tie, total, out=np.full(total.shape, 0.5), where=total > 0.0)
    x = w * a + (1.0 - w) * b
    W1, W2 = w[..., :, None], (1.0 - w)[..., :, None]
    across = W1 * C * np.swapaxes(W2, -1, -2)
    P = W1 * A * np.swapaxes(W1, -1, -2) + W2 * B * np.swapaxes(W2, -1, -2) + across + np.swapaxes(across, -1, -2)
    return Fused(x, symmetric(P), w[..., :, None] * np.eye(a.shape[-1]))


def covariance_intersection(x1: ArrayLike, P1: ArrayLike, x2: ArrayLike, P2: ArrayLike) -> Fused:
    """Fusion of two estimates that may be correlated in whatever way: its P is never too small.

    ``P^-1 = w P1^-1 + (1 - w) P2^-1`` with the w of least determinant, which units do not change.

    Parameters
    ----------
    x1, P1, x2, P2
        As in :func:`fuse`; covariances positive definite.

    Returns
    -------
    Fused
        `weight` is w.
    """
    a, A, b, B, _ = _checked(x1, P1, x2, P2, np.zeros_like(np.asarray(P1, dtype=np.float64)))
    Y1, Y2 = _inverse(A), _inverse(B)
    # In the axes in which P1 is unity and P2 diagonal, log det of the information is a sum: concave in w.
    L = np.linalg.cholesky(symmetric(A))
    half = np.linalg.solve(L, B)
    ratio = np.linalg.eigvalsh(symmetric(np.linalg.solve(L, np.swapaxes(half, -1, -2))))
    low, high = np.zeros(ratio.shape[:-1]), np.ones(ratio.shape[:-1])

    def gathered(w: Array) -> Array:
        with np.errstate(divide="ignore"):
            return np.sum(np.log(w[..., None] + (1.0 - w[..., None]) / ratio), axis=-1)

    for _ in range(SECTIONS):
        left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        better = gathered(left) > gathered(right)
        low, high = np.where(better, low, left), np.where(better, right, high)
    w = np.asarray(0.5 * (low + high))
    # At an end one estimate alone is best: no rest of the other.
    w = np.where(w < 1e-9, 0.0, np.where(w > 1.0 - 1e-9, 1.0, w))[..., None, None]
    P = _inverse(w * Y1 + (1.0 - w) * Y2)
    x = times(P, times(w * Y1, a) + times((1.0 - w) * Y2, b))
    return Fused(x, P, w[..., 0, 0])


def cross_covariance(
    first: LinearSystem,
    second: LinearSystem,
    *,
    P0: ArrayLike | None = None,
    Q: ArrayLike | None = None,
    R: ArrayLike | None = None,
) -> Array:
    """Cross-covariance of the errors of two Kalman filters of one process.

    ``P12 = (I - K1 H1) (Phi1 P12 Phi2' + Q) (I - K2 H2)' + K1 R K2'``.

    Parameters
    ----------
    first, second : LinearSystem
        Of the same states and epochs, without S and run axes.
    P0 : (n, n) array, optional
        Covariance of their initial errors; the first's P0, since as a rule both begin from one estimate.
    Q : (K or 1, n, n) array, optional
        Covariance of their process noises; the first's Q, since as a rule it is one process.
    R : (K or 1, m1, m2) array, optional
        Covariance of their measurement noises; zero for different sensors.

    Returns
    -------
    (K, n, n) array
        After each epoch.

    Raises
    ------
    UsageError
        S or runs are given, or the systems do not fit.
    """
    for name, system in (("first", first), ("second", second)):
        if system.runs != () or (system.S is not None and system.S.any()):
            raise UsageError(f"cross_covariance: {name} has run axes or S, expected one run without S")
    if first.states != second.states or first.epochs != second.epochs:
        raise UsageError(
            f"cross_covariance: first has {first.states} states and {first.epochs} epochs, second {second.states} and "
            f"{second.epochs}; expected the same"
        )
    one = filter_gains(first, kalman(first, history="full"))
    two = filter_gains(second, kalman(second, history="full"))
    P = np.asarray(first.P0 if P0 is None else P0, dtype=np.float64)
    common = np.asarray(first.Q if Q is None else Q, dtype=np.float64)
    noise = one.keep @ common @ np.swapaxes(two.keep, -1, -2)
    if R is not None:
        noise = noise + one.gain @ np.asarray(R, dtype=np.float64) @ np.swapaxes(two.gain, -1, -2)
    out = np.empty(noise.shape)
    for k in range(first.epochs):
        P = one.step[k] @ P @ two.step[k].T + noise[k]
        out[k] = P
    return out


@dataclass(frozen=True)
class Federated:
    """What a federated filter found at its fusions.

    Parameters
    ----------
    epochs : (F,) int array
        After which the local filters were fused.
    x : (..., F, n) array
    sigma : (..., F, n) array
    P : (..., F, n, n) array
    local : tuple of Estimates
        Of each local filter after its last measurement.
    """

    epochs: NDArray[np.int64]
    x: Array
    sigma: Array
    P: Array
    local: tuple[Estimates, ...]


def federated(
    systems: Sequence[LinearSystem],
    *,
    shares: Sequence[float] | None = None,
    every: int = 1,
    reset: bool = True,
    workers: int = 1,
) -> Federated:
    """Federated filter (Carlson): local filters, each with a share of the common information, and a master.

    Filter i has ``P0 / share_i`` and ``Q / share_i``: what is common to all is counted by no one twice, and the fusion adds
    information as if they were independent. With a reset after every epoch the result is that of one central filter;
    resets that are rarer, or none, cost precision, and the P given is an upper bound.

    Parameters
    ----------
    systems : sequence of LinearSystem
        One for each local filter: the same states, process and prior, a sensor each; without S.
    shares : sequence of float, optional
        Positive, with the sum 1; equal as a rule.
    every : int
        Epochs from fusion to fusion; the last epoch is always fused.
    reset : bool
        Whether the fusion goes back to the local filters.
    workers : int
        Threads that share the runs.

    Raises
    ------
    UsageError
        Fewer than two systems, systems that do not fit, or shares whose sum is not 1.
    """
    count = len(systems)
    beta = np.full(count, 1.0 / max(count, 1)) if shares is None else np.asarray(shares, dtype=np.float64)
    if count < 2 or len({(s.states, s.epochs) for s in systems}) > 1:
        raise UsageError(
            f"federated: systems with (states, epochs) {[(s.states, s.epochs) for s in systems]}, expected two or more alike"
        )
    if len(beta) != count or not np.all(beta > 0.0) or abs(beta.sum() - 1.0) > 1e-9:
        raise UsageError(f"shares are {beta.tolist()}, expected {count} positive numbers with the sum 1")
    if every < 1:
        raise UsageError(f"every is {every}, expected at least 1")
    if any(s.S is not None and s.S.any() for s in systems):
        raise UsageError("S is given: shared process noise cannot be tied to one filter's measurements")

    scaled = [replace(s, P0=s.P0 / b, Q=s.Q / b) for s, b in zip(systems, beta)]
    epochs = systems[0].epochs
    edges = [*range(0, epochs, every), epochs]
    states: list[FilterState | None] = [None] * count
    found: list[tuple[Array, Array]] = []
    for start, stop in pairwise(edges):
        local = [kalman(s.between(start, stop), state, workers=workers) for s, state in zip(scaled, states)]
        x, P = _gathered([e.state.x for e in local], [e.state.P for e in local])
        found.append((x, P))
        states = [replace(e.state, x=x, P=P / b) if reset else e.state for e, b in zip(local, beta)]
    x, P = (np.stack(a, axis=-1 - core) for a, core in zip(zip(*found), (1, 2)))
    sigma = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1))
    return Federated(np.array(edges[1:]) - 1, x, sigma, P, tuple(local))


def _gathered(x: Sequence[Array], P: Sequence[Array]) -> tuple[Array, Array]:
    """Sum of the information of independent estimates."""
    Y = [_inverse(p) for p in P]
    total = _inverse(sum(Y[1:], Y[0]))
    return times(total, sum((times(i, a) for i, a in zip(Y, x)), np.zeros(1))), total


def _checked(
    x1: ArrayLike, P1: ArrayLike, x2: ArrayLike, P2: ArrayLike, P12: ArrayLike
) -> tuple[Array, Array, Array, Array, Array]:
    x = [np.asarray(a, dtype=np.float64) for a in (x1, x2)]
    P = [np.asarray(a, dtype=np.float64) for a in (P1, P2, P12)]
    n = x[0].shape[-1]
    for name, a, core in (("x2", x[1], (n,)), ("P1", P[0], (n, n)), ("P2", P[1], (n, n)), ("P12", P[2], (n, n))):
        if a.shape[-len(core) :] != core:
            raise UsageError(f"{name} has shape {a.shape}, expected (..., {', '.join(map(str, core))}) as in x1")
    return x[0], P[0], x[1], P[1], P[2]


def _inverse(A: Array) -> Array:
    """Of a covariance or an information matrix in whatever units."""
    return symmetric(_solved(A, np.broadcast_to(np.eye(A.shape[-1]), A.shape)))


def _solved(A: Array, B: Array) -> Array:
    """``A^-1 B`` for a positive definite A, its rows and columns scaled first."""
    try:
        size, L = scaled_cholesky(A)
    except np.linalg.LinAlgError:
        raise DataError(
            "fusion: a covariance that must be inverted is singular; leave out what is known exactly, or what both "
            "estimates say alike"
        ) from None
    half = np.linalg.solve(L, B / size[..., :, None])
    return np.asarray(np.linalg.solve(np.swapaxes(L, -1, -2), half) / size[..., :, None])
