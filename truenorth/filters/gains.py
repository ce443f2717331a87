"""The gains that a Kalman filter used, and how errors pass through them.

The error of the estimate obeys ``e_k = (I - K_k H_k) (Phi_k e_{k-1} - w_k) + K_k v_k``: linear in what caused it, so each
cause can be followed by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import copy_corner, transpose_block
from truenorth.core.vectors import load8, minus8, plus8, store8, times8, zero8
from truenorth.filters.stack import Array
from truenorth.filters.system import Estimates, LinearSystem, runs_of

# States and rows of a base at rest. Kernels in which such sizes are written take three quarters of the time of those that learn
# them as they run, to the same bits.
AT_REST = 12, 3
BIASES, AXES = 6, 3


T = TypeVar("T")


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
    Phi : (..., K, n, n) array
        The same.
    H_Phi : (..., K, m, n) array
        ``H_k Phi_k``: how an error of the epoch before is measured.
    """

    gain: Array
    step: Array
    H: Array
    Phi: Array
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
    gain, step, H_Phi = (np.empty((*shape, K, *size)) for size in ((n, m), (n, n), (m, n)))
    found = Gains(gain, step, system.H, system.Phi, H_Phi)
    given = (estimates.P, estimates.innovation, estimates.innovation_covariance, found.gain, found.step, found.H_Phi)
    fill = _fill_at_rest if (n, m) == AT_REST else _fill
    fill(runs, *(np.ascontiguousarray(a).reshape(-1, K, *a.shape[len(shape) + 1 :]) for a in given))
    return found


@compiled
def _fill(runs: Any, P: Any, innovation: Any, covariance: Any, gain: Any, step: Any, H_Phi: Any) -> None:
    """:func:`_gains_of` systems of any sizes."""
    _gains_of(gain.shape[2], gain.shape[3], runs, P, innovation, covariance, gain, step, H_Phi)


@compiled
def _fill_at_rest(runs: Any, P: Any, innovation: Any, covariance: Any, gain: Any, step: Any, H_Phi: Any) -> None:
    """:func:`_gains_of` systems of a base at rest."""
    _gains_of(AT_REST[0], AT_REST[1], runs, P, innovation, covariance, gain, step, H_Phi)


@compiled(forceinline=True)
def _gains_of(
    n: int, m: int, runs: Any, P: Any, innovation: Any, covariance: Any, gain: Any, step: Any, H_Phi: Any
) -> None:
    """Gains of each run and epoch, and how an error goes on in it; worked out in rows with zeros at their ends."""
    wide = 8 * ((n + 7) // 8)
    Phi, Phi_t = np.zeros((wide, wide)), np.zeros((wide, wide))
    Q, before = np.zeros((wide, wide)), np.zeros((wide, wide))
    own, seen, cross, W = np.zeros((m, wide)), np.zeros((m, wide)), np.zeros((m, wide)), np.zeros((m, m))
    for b in range(gain.shape[0]):
        for k in range(gain.shape[1]):
            load_corner(runs.Phi[min(b, runs.Phi.shape[0] - 1), min(k, runs.Phi.shape[1] - 1)], Phi)
            load_corner(runs.Q[min(b, runs.Q.shape[0] - 1), min(k, runs.Q.shape[1] - 1)], Q)
            H = runs.H[min(b, runs.H.shape[0] - 1), min(k, runs.H.shape[1] - 1)]
            S = runs.S[min(b, runs.S.shape[0] - 1), min(k, runs.S.shape[1] - 1)]
            if k == 0:
                load_corner(runs.P0[min(b, runs.P0.shape[0] - 1)], before)
            else:
                load_corner(P[b, k - 1], before)
            for i in range(0, wide, 4):
                for j in range(0, wide, 4):
                    transpose_block(Phi, i, j, Phi_t)
            # H (Phi P Phi' + Q) + S', of m rows, not n: covariances are symmetric.
            rows_times(H, m, n, Phi, own)
            rows_times(own, m, n, before, seen)
            rows_times(seen, m, n, Phi_t, cross)
            rows_times(H, m, n, Q, seen)
            for a in range(m):
                for i in range(n):
                    cross[a, i] += seen[a, i] + S[i, a]
                    H_Phi[b, k, a, i] = own[a, i]
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
                for j in range(0, wide, 8):
                    left = load8(Phi, (i, j))
                    for a in range(m):
                        left = minus8(left, times8(cross[a, i], load8(own, (a, j))))
                    store8(Phi, (i, j), left)
            copy_corner(Phi, step[b, k], n, n)


@borrowing(forceinline=True)
def load_corner(A: Any, B: Any) -> None:
    """A square matrix into the corner of a larger one."""
    copy_corner(A, B, A.shape[0], A.shape[1])


@borrowing(forceinline=True)
def rows_times(X: Any, rows: int, n: int, A: Any, Y: Any) -> None:
    """The first rows of ``Y = X A``, of n terms; three at a time, so that each row of `A` is read once for them."""
    a = 0
    while a + 3 <= rows:
        for j in range(0, A.shape[1], 8):
            one, two, three = zero8(), zero8(), zero8()
            for k in range(n):
                row = load8(A, (k, j))
                one = plus8(one, times8(X[a, k], row))
                two = plus8(two, times8(X[a + 1, k], row))
                three = plus8(three, times8(X[a + 2, k], row))
            store8(Y, (a, j), one)
            store8(Y, (a + 1, j), two)
            store8(Y, (a + 2, j), three)
        a += 3
    while a < rows:
        row_times(X, a, n, A, Y)
        a += 1


@borrowing(forceinline=True)
def row_times(X: Any, a: int, n: int, A: Any, Y: Any) -> None:
    """Row a of ``Y = X A``, of n terms; the rows of `A` and `Y` are a multiple of 8 wide."""
    for j in range(0, A.shape[1], 8):
        total = zero8()
        for k in range(n):
            total = plus8(total, times8(X[a, k], load8(A, (k, j))))
        store8(Y, (a, j), total)


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
    inner = whole[known[:, None], known]
    part = np.empty((len(step), *whole[states, states].shape))
    response = np.zeros((size, 8 * ((len(known) + 7) // 8)))
    response[known, np.arange(len(known))] = 1.0
    first = range(size)[states].start
    parts = _parts_at_rest if (size, len(known), part.shape[1]) == (AT_REST[0], BIASES, AXES) else _parts
    parts(np.ascontiguousarray(step), np.ascontiguousarray(inner), first, response, part)
    last = response[:, : len(known)]
    return part, np.asarray(last @ inner @ last.T)


class SharedGains(Gains):
    """Gains that many logs share (:mod:`truenorth.filters.known`), with what was found of them before.

    Attributes
    ----------
    L : (K, m, m) array
        Of each innovation's covariance ``L L'``.
    places, values : (E, 2) and (K, E) arrays
        Elements of ``Phi`` that are not zero at every epoch, by row and column: most are.
    found : dict
        What depends on the gains alone, by whatever else decides it: it is worked out once.
    """

    L: Array
    places: NDArray[np.int64]
    values: Array
    found: dict[Any, Any]

    def once(self, key: Any, work: Callable[[], T]) -> T:
        """What this work finds, found once."""
        if key not in self.found:
            self.found[key] = work()
        found: T = self.found[key]
        return found


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
    arrays = (gains.H_Phi, gains.gain, gains.Phi, signature)
    _through(*(np.ascontiguousarray(a) for a in arrays), innovation, x, np.empty_like(x))
    return innovation, x


def factors(covariance: Array) -> Array:
    """Lower triangles L of ``L L'`` of covariances (K, m, m): of small matrices a library takes longer to begin than to do it."""
    L = np.zeros(covariance.shape)
    _factor(np.ascontiguousarray(covariance), L)
    return L


@compiled
def _factor(covariance: Any, L: Any) -> None:
    """Fill L, zero so far."""
    for k in range(len(L)):
        for i in range(L.shape[1]):
            for j in range(i + 1):
                total = covariance[k, i, j]
                for r in range(j):
                    total -= L[k, i, r] * L[k, j, r]
                L[k, i, j] = np.sqrt(total) if i == j else total / L[k, j, j]


@compiled
def _parts(step: Any, inner: Any, first: int, response: Any, part: Any) -> None:
    """:func:`_parts_of` any sizes."""
    _parts_of(response.shape[0], inner.shape[0], part.shape[1], step, inner, first, response, part)


@compiled
def _parts_at_rest(step: Any, inner: Any, first: int, response: Any, part: Any) -> None:
    """:func:`_parts_of` biases in the misalignment of a base at rest."""
    _parts_of(AT_REST[0], BIASES, AXES, step, inner, first, response, part)


@compiled(forceinline=True)
def _parts_of(n: int, p: int, q: int, step: Any, inner: Any, first: int, response: Any, part: Any) -> None:
    """``response = step[k] ... step[0] response``, and ``part[k] = X inner X'`` of its rows from the first one wanted."""
    before, now, X = np.zeros((n, response.shape[1])), response, np.empty((q, p))
    for k in range(step.shape[0]):
        for i in range(n):
            for j in range(p):
                before[i, j] = now[i, j]
        rows_times(step[k], n, n, before, now)
        for a in range(q):
            for r in range(p):
                X[a, r] = 0.0
            for s in range(p):
                for r in range(p):
                    X[a, r] += now[first + a, s] * inner[s, r]
            for c in range(q):
                total = 0.0
                for r in range(p):
                    total += X[a, r] * now[first + c, r]
                part[k, a, c] = total


@compiled
def _through(H_Phi: Any, gain: Any, Phi: Any, signature: Any, innovation: Any, x: Any, work: Any) -> None:
    """``y = signature - H Phi x`` and ``x = Phi x + K y``: most of Phi is zero, where of ``(I - K H) Phi`` hardly anything is.

    What is all zero up to an epoch is left out: signatures that begin one after the other stand in that order.
    """
    m, begun = signature.shape[1], 0
    for k in range(signature.shape[0]):
        for s in range(signature.shape[2] - 1, begun - 1, -1):
            there = False
            for i in range(m):
                there |= signature[k, i, s] != 0.0
            if there:
                begun = s + 1
                break
        for i in range(m):
            for s in range(signature.shape[2]):
                innovation[k, i, s] = signature[k, i, s]
            for j in range(len(x)):
                if H_Phi[k, i, j] != 0.0:
                    for s in range(begun):
                        innovation[k, i, s] -= H_Phi[k, i, j] * x[j, s]
        for i in range(len(x)):
            for s in range(begun):
                work[i, s] = 0.0
            for j in range(len(x)):
                factor = Phi[min(k, len(Phi) - 1), i, j]
                if factor != 0.0:
                    for s in range(begun):
                        work[i, s] += factor * x[j, s]
        for i in range(len(x)):
            for s in range(begun):
                x[i, s] = work[i, s]
            for j in range(m):
                for s in range(begun):
                    x[i, s] += gain[k, i, j] * innovation[k, j, s]


@compiled
def times(A: Any, B: Any, C: Any) -> None:
    """``C = A B`` of any shapes; `C` is neither."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            C[i, j] = 0.0
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                C[i, j] += A[i, k] * B[k, j]
