"""Forms of what begins in a log, summed up from its last epoch back (:mod:`truenorth.alignment.matched`); compiled."""

from __future__ import annotations

from typing import Any

import numpy as np

from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import copy_corner, four_rows_within, mirror_upper, transpose_block
from truenorth.core.vectors import load8, minus8, over8, plus8, product8, spread8, store8, times8, zero8
from truenorth.errors.staying import STARTS

# States, rows of the measurement, states with all courses, and columns of innovations, of a base at rest: written in a kernel, they
# save it a quarter of its time (:data:`truenorth.filters.gains.AT_REST`).
AT_REST = 12, 3, 22, 1


@compiled
def sum_back(of_gains: Any, A: Any, U: Any, seen: Any, behind: Any, forms: Any, ends: Any) -> None:
    """:func:`_forms_of` any sizes."""
    step, _, gain, _ = of_gains
    sizes = step.shape[1], gain.shape[2], forms.shape[1], seen.shape[2]
    _forms_of(sizes, of_gains, A, U, seen, behind, forms, ends)


@compiled
def sum_back_at_rest(of_gains: Any, A: Any, U: Any, seen: Any, behind: Any, forms: Any, ends: Any) -> None:
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


@compiled
def linear_back(
    places: Any, values: Any, H_Phi: Any, gain: Any, L: Any, A: Any, U: Any, white: Any, behind: Any, forms: Any
) -> None:
    """Linear forms of ``(e_k, w)`` (n + w): of innovations with what goes on behind each k of `behind`, which ascends.

    An error goes on by ``(I - K H) Phi = Phi - K H_Phi``; of Phi those elements that are not zero, in their places.
    """
    n, m, courses = gain.shape[1], gain.shape[2], U.shape[1]
    form, now, v = np.zeros(n), np.zeros(n), np.zeros(m)
    states, measured = (
        np.zeros(n),
        np.zeros(courses),
    )  # of the courses: what enters the states, summed up, and the measurements
    row = len(behind) - 1
    for k in range(len(gain) - 1, -1, -1):
        while row >= 0 and behind[row] == k:
            for i in range(n):
                forms[row, i] = form[i]
            for w in range(courses):
                forms[row, n + w] = measured[w]
                for i in range(n):
                    forms[row, n + w] += U[i, w] * states[i]
            row -= 1
        if row < 0:
            break
        for a in range(m - 1, -1, -1):  # L' v = white
            v[a] = white[k, a]
            for c in range(a + 1, m):
                v[a] -= L[k, c, a] * v[c]
            v[a] /= L[k, a, a]
        for i in range(n):
            now[i] = 0.0
            for a in range(m):
                v[a] -= gain[k, i, a] * form[i]
        for a in range(m):
            for i in range(n):
                now[i] += H_Phi[k, a, i] * v[a]
            for w in range(courses):
                measured[w] += A[k, a, w] * v[a]
        for e in range(len(places)):
            now[places[e, 1]] += values[k, e] * form[places[e, 0]]
        for i in range(n):
            states[i] += now[i]
            form[i] = now[i]
