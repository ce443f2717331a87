"""Signatures of what the model leaves out, matched with the innovations of a filter: a generalised likelihood ratio test.

Something begins at epoch k: errors ``u`` enter the state, ``a`` the measurement, and go on in courses of size ``w``,
``u_i = U w``, ``a_i = A_i w`` (a bias that grows, a velocity that stays). What is left between truth and estimate is

    e_i = (I - K_i H_i) Phi_i (e_(i-1) + u_i) - K_i a_i,    seen in the innovation as    y_i = H_i Phi_i (e_(i-1) + u_i) + a_i

Match ``sum y' W^-1 nu`` and energy ``sum y' W^-1 y`` of all epochs behind k are a linear and a quadratic form of ``(e_k, w)``:
both are summed up once, from the last epoch back, for whatever begins when and goes on in whatever course. The likelihood
ratio is ``match^2 / energy``.

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems", IEEE Trans. Autom. Control 21 (1976), eqs. 13-20.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import copy_corner, four_rows_within, mirror_upper, transpose_block
from truenorth.core.vectors import load8, minus8, over8, plus8, product8, spread8, store8, times8, zero8
from truenorth.errors.staying import STARTS
from truenorth.filters.gains import Gains, through

Array = NDArray[np.float64]


# States, rows of the measurement, states with all courses, and columns of innovations, of a base at rest: written in a kernel, they
# save it a quarter of its time (:data:`truenorth.filters.gains.AT_REST`).
AT_REST = 12, 3, 23, 1


class Signatures(NamedTuple):
    """What may begin, S of them, and the courses that they take.

    Attributes
    ----------
    epoch : (S,) int array
        At which it begins.
    state : (n, S) array
        Errors that enter the state before that epoch.
    measured : (m, S) array
        Errors of the measurement at that epoch.
    after : (w, S) array
        Sizes of the courses behind it.
    state_course, measured_course : (n, w) and (K, m, w) arrays
        ``U`` and ``A`` of the courses.
    """

    epoch: NDArray[np.int64]
    state: Array
    measured: Array
    after: Array
    state_course: Array
    measured_course: Array


class Match(NamedTuple):
    """How signatures match.

    Attributes
    ----------
    ratio : (S,) array
        Twice the logarithm of each likelihood ratio.
    size : (S,) array
        Of each signature, the most likely.
    left : (3, S) array
        Misalignment of the last estimate that a signature of size one leaves.
    """

    ratio: Array
    size: Array
    left: Array


class Innovations(NamedTuple):
    """Innovations of a filter, made white, and how it comes to them.

    Attributes
    ----------
    L : (K, m, m) array
        Of each innovation's covariance ``L L'``.
    gains : Gains
    white : (K, m, 1 + M) array
        ``L^-1`` of the innovations, and of what M other errors of one sigma make of them.
    """

    L: Array
    gains: Gains
    white: Array


def innovations_of(fine: FineAlignment, others: Array | None = None) -> Innovations:
    """Innovations of a fine alignment.

    Parameters
    ----------
    others : (K, m, M) array, optional
        Signatures, of one sigma each, of errors in the measurements that the filter leaves out and any log may have: they
        explain what they can.
    """
    seen = fine.estimates.innovation[..., None]
    if others is not None:
        seen = np.concatenate([seen, through(fine.gains, others)[0]], axis=2)
    L = np.zeros(fine.estimates.innovation_covariance.shape)
    _factor(np.ascontiguousarray(fine.estimates.innovation_covariance), L)
    return Innovations(L, fine.gains, whitened(L, seen))


@compiled
def _factor(covariance: Any, L: Any) -> None:
    """Lower triangles of ``L L'`` of (K, m, m), zero so far: of small matrices a library takes longer to begin than to do it."""
    for k in range(len(L)):
        for i in range(L.shape[1]):
            for j in range(i + 1):
                total = covariance[k, i, j]
                for r in range(j):
                    total -= L[k, i, r] * L[k, j, r]
                L[k, i, j] = np.sqrt(total) if i == j else total / L[k, j, j]


def whitened(L: Array, x: Array) -> Array:
    """``L^-1 x`` of lower triangular L (S, m, m) and x (S, m, r), with few rows m: a row of all of them at a time."""
    found = np.empty_like(x)
    for i in range(x.shape[1]):
        known = sum((L[:, i, j, None] * found[:, j] for j in range(i)), np.zeros(()))
        found[:, i] = (x[:, i] - known) / L[:, i, i, None]
    return found


def matched(seen: Innovations, *banks: Signatures) -> tuple[Match, ...]:
    """Match innovations with those that signatures make, all banks of them in one pass.

    Parameters
    ----------
    seen : Innovations
    *banks : Signatures

    Returns
    -------
    tuple of Match
        One for each bank.
    """
    all_of = _together(banks)
    (n, courses), right, gains = all_of.state_course.shape, seen.white.shape[2], seen.gains
    behind = all_of.behind
    forms = np.empty((len(behind), n + courses, n + courses + right))
    ends = np.empty((len(behind), 3, n + courses))
    of_gains = tuple(np.ascontiguousarray(a) for a in (gains.step, gains.H_Phi, gains.gain, seen.L))
    white = np.ascontiguousarray(seen.white)
    at_rest = (n, gains.gain.shape[-1], n + courses, right) == AT_REST
    sum_back = _sum_back_at_rest if at_rest else _sum_back
    sum_back(of_gains, all_of.measured_course, all_of.state_course, white, behind, forms, ends)
    count = len(all_of.epoch)
    energy, match, left = np.empty(count), np.empty((count, right)), np.empty((3, count))
    _match_each(all_of, *of_gains, white, forms, ends, np.empty((2, n + courses)), energy, match, left)
    of_innovations = match[:, 0]
    if right > 1:
        others = white[:, :, 1:].reshape(white[..., 0].size, -1)
        known = np.column_stack([others.T @ white[:, :, 0].ravel(), match[:, 1:].T])
        explained = np.linalg.solve(np.eye(others.shape[1]) + others.T @ others, known)
        energy = energy - np.einsum("sr,rs->s", match[:, 1:], explained[:, 1:])
        of_innovations = of_innovations - match[:, 1:] @ explained[:, 0]
    energy = np.maximum(energy, 1e-300)
    size = of_innovations / energy
    ratio, edges = of_innovations * size, np.cumsum([0, *(len(bank.epoch) for bank in banks)]).tolist()
    parts = (slice(*pair) for pair in pairwise(edges))
    return tuple(Match(ratio[part], size[part], left[:, part]) for part in parts)


class _Together(NamedTuple):
    """All banks: courses one behind the other, and of each signature a column with its sizes of all of them."""

    epoch: NDArray[np.int64]
    at: NDArray[np.int64]  # place of the epoch in `behind`
    behind: NDArray[np.int64]  # epochs, ascending, each once
    state: Array
    measured: Array
    after: Array  # (w, S)
    state_course: Array
    measured_course: Array


MOST_JOINED = 4  # forms of the measurement and lengths of logs, by turns
_JOINED: dict[tuple[int, ...], tuple[tuple[Signatures, ...], _Together]] = {}


def _together(banks: tuple[Signatures, ...]) -> _Together:
    """Remembered of the last banks, which are the same for all logs as long."""
    key = tuple(map(id, banks))
    if key not in _JOINED:
        epoch = np.concatenate([bank.epoch for bank in banks]).astype(np.int64)
        behind, at = np.unique(epoch, return_inverse=True)
        after, course, signature = np.zeros((sum(len(bank.after) for bank in banks), len(epoch))), 0, 0
        for bank in banks:
            courses, signatures = bank.after.shape
            after[course : course + courses, signature : signature + signatures] = bank.after
            course, signature = course + courses, signature + signatures
        state, measured, state_course = (
            np.ascontiguousarray(np.concatenate([getattr(bank, name) for bank in banks], axis=1))
            for name in ("state", "measured", "state_course")
        )
        measured_course = np.ascontiguousarray(np.concatenate([bank.measured_course for bank in banks], axis=2))
        found = _Together(epoch, at.astype(np.int64), behind, state, measured, after, state_course, measured_course)
        if len(_JOINED) == MOST_JOINED:
            _JOINED.clear()
        _JOINED[key] = banks, found  # that the banks are held keeps their numbers their own
    return _JOINED[key][1]


@compiled
def _match_each(
    of: _Together,
    step: Any,
    H_Phi: Any,
    gain: Any,
    L: Any,
    white: Any,
    forms: Any,
    ends: Any,
    work: Any,
    energy: Any,
    match: Any,
    left: Any,
) -> None:
    """Energy (S,), match (S, 1 + M) and what is left at the end (3, S) of each signature."""
    first, begun = work[0], work[1]
    n, m, right, own = gain.shape[1], gain.shape[2], white.shape[2], ends.shape[2]
    for s in range(len(energy)):
        k, at = of.epoch[s], of.at[s]
        energy[s] = 0.0
        for r in range(right):
            match[s, r] = 0.0
        # Its first epoch by itself, made white.
        for a in range(m):
            first[a] = of.measured[a, s]
            for i in range(n):
                first[a] += H_Phi[k, a, i] * of.state[i, s]
            for c in range(a):
                first[a] -= L[k, a, c] * first[c]
            first[a] /= L[k, a, a]
            energy[s] += first[a] * first[a]
            for r in range(right):
                match[s, r] += first[a] * white[k, a, r]
        # The error behind it, and the courses: (e, w).
        for i in range(n):
            begun[i] = 0.0
            for j in range(n):
                begun[i] += step[k, i, j] * of.state[j, s]
            for a in range(m):
                begun[i] -= gain[k, i, a] * of.measured[a, s]
        for j in range(own - n):
            begun[n + j] = of.after[j, s]
        for i in range(own):
            if begun[i] != 0.0:
                for j in range(own):
                    energy[s] += begun[i] * forms[at, i, j] * begun[j]
                for r in range(right):
                    match[s, r] += begun[i] * forms[at, i, own + r]
        for a in range(3):
            left[a, s] = 0.0
            for j in range(own):
                left[a, s] += ends[at, a, j] * begun[j]


@compiled
def _sum_back(of_gains: Any, A: Any, U: Any, seen: Any, behind: Any, forms: Any, ends: Any) -> None:
    """:func:`_forms_of` any sizes."""
    step, _, gain, _ = of_gains
    sizes = step.shape[1], gain.shape[2], forms.shape[1], seen.shape[2]
    _forms_of(sizes, of_gains, A, U, seen, behind, forms, ends)


@compiled
def _sum_back_at_rest(of_gains: Any, A: Any, U: Any, seen: Any, behind: Any, forms: Any, ends: Any) -> None:
    """:func:`_forms_of` a base at rest."""
    _forms_of(AT_REST, of_gains, A, U, seen, behind, forms, ends)


@compiled(forceinline=True)
def _forms_of(sizes: Any, of_gains: Any, A: Any, U: Any, seen: Any, behind: Any, forms: Any, ends: Any) -> None:
    """Forms of ``(e_k, w)``, summed over the epochs behind each k of `behind`, which ascends, and the last misalignment of it.

    The quadratic form comes first, the linear ones of the innovations are columns behind it. Rows have zeros at their ends.
    """
    misalignment, (step, H_Phi, gain, L) = STARTS[0], of_gains
    n, m, used, right = sizes
    N, rows, wide = 4 * ((n + 3) // 4), 4 * ((used + 3) // 4), 8 * ((used + right + 7) // 8)
    form, end = np.zeros((rows, wide)), np.zeros((4, wide))
    for i in range(3):
        end[i, misalignment + i] = 1.0
    form_before, end_before, T = np.zeros_like(form), np.zeros_like(end), np.zeros_like(form)
    # e goes on as F (e, w), and is seen, made white, as G (e, w), which stands below T; behind G stand the innovations.
    whole, course, measured, ones = np.zeros((N, N)), np.zeros((N, wide)), np.zeros((m, wide)), np.zeros(wide)
    for i in range(n):
        course[i, i] = 1.0
        for j in range(U.shape[1]):
            course[i, n + j] = U[i, j]
    ones[n:] = 1.0
    F, above_t, below = np.zeros((N, wide)), np.zeros((rows, N + m)), np.zeros((n + m, wide))
    row = len(behind) - 1
    for k in range(step.shape[0] - 1, -1, -1):
        while row >= 0 and behind[row] == k:
            _keep(form, forms[row])
            _keep(end, ends[row])
            row -= 1
        if row < 0:
            break
        copy_corner(step[k], whole, n, n)
        for i in range(m):
            for j in range(A.shape[2]):
                measured[i, n + j] = A[k, i, j]
        _go_on(whole, gain[k], measured, course, F)
        _see(H_Phi[k], L[k], measured, course, below)
        for i in range(m):
            for j in range(right):
                below[n + i, used + j] = seen[k, i, j]
        _times_course(n, form, F, ones, T)
        # [F; G]' [T; G], and T itself of the courses: M' form M + G' G.
        for i in range(0, rows, 4):
            for j in range(0, N, 4):
                transpose_block(F, j, i, above_t)
        for i in range(m):
            for j in range(used):
                above_t[j, n + i] = below[n + i, j]
        copy_corner(T, below, n, wide)
        for i in range(0, rows, 4):  # what stands before the diagonal is what stands behind it
            four_rows_within(n + m, above_t, below, None, i, 8 * (i // 8), wide, form_before)
        for i in range(n, rows):
            for j in range(8 * (i // 8), wide, 8):
                store8(form_before, (i, j), plus8(load8(form_before, (i, j)), load8(T, (i, j))))
        mirror_upper(rows, form_before)
        form, form_before = form_before, form
        _times_course(n, end, F, ones, end_before)
        end, end_before = end_before, end


@compiled
def _keep(values: Any, place: Any) -> None:
    """``place = values``, as far as it goes: one by one, since Numba takes a second to compile what checks whole arrays' shapes."""
    for i in range(place.shape[0]):
        for j in range(place.shape[1]):
            place[i, j] = values[i, j]


@borrowing(forceinline=True)
def _go_on(step: Any, gain: Any, A: Any, course: Any, F: Any) -> None:
    """``F = step [I, U] - gain [0, A]``, with ``course = [I, U]``; `A` stands where the courses do."""
    n, known = gain.shape[0], 8 * (gain.shape[0] // 8)  # columns of the step itself
    for i in range(0, len(step), 4):
        four_rows_within(n, step, course, None, i, known, F.shape[1], F)
    for i in range(n):
        for j in range(0, known, 8):
            store8(F, (i, j), load8(step, (i, j)))
        for j in range(known, F.shape[1], 8):
            left = load8(F, (i, j))
            for r in range(gain.shape[1]):
                left = minus8(left, times8(gain[i, r], load8(A, (r, j))))
            store8(F, (i, j), left)


@borrowing(forceinline=True)
def _see(H_Phi: Any, L: Any, A: Any, course: Any, below: Any) -> None:
    """``G = L^-1 (H Phi [I, U] + [0, A])``, L lower triangular, below the rows of T."""
    m, n = H_Phi.shape
    known = 8 * (n // 8)
    for i in range(m):
        for j in range(0, below.shape[1], 8):
            if j < known:
                total = load8(H_Phi, (i, j))
            else:
                total = zero8()
                for r in range(n):
                    total = plus8(total, times8(H_Phi[i, r], load8(course, (r, j))))
                total = plus8(total, load8(A, (i, j)))
            for r in range(i):
                total = minus8(total, times8(L[i, r], load8(below, (n + r, j))))
            store8(below, (n + i, j), over8(total, spread8(L[i, i])))


@borrowing(forceinline=True)
def _times_course(n: int, X: Any, F: Any, ones: Any, Y: Any) -> None:
    """``Y = X M`` with ``M = [F; 0 I]``, the identity behind the first n, where `ones` are; of rows of courses the upper half."""
    for i in range(0, X.shape[0], 4):
        first = 8 * (i // 8) if i >= n else 0
        four_rows_within(n, X, F, None, i, first, Y.shape[1], Y)
    for i in range(X.shape[0]):
        for j in range(8 * (max(n, i) // 8), Y.shape[1], 8):
            store8(Y, (i, j), plus8(load8(Y, (i, j)), product8(load8(ones, (j,)), load8(X, (i, j)))))
