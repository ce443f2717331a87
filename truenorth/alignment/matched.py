"""Signatures of what the model leaves out, matched with the innovations of a filter: a generalised likelihood ratio test.

Something begins at epoch k: errors ``u`` enter the state, ``a`` the measurement, and go on in courses of size ``w``,
``u_i = U w``, ``a_i = A_i w`` (a bias that grows, a velocity that stays). What is left between truth and estimate is

    e_i = (I - K_i H_i) Phi_i (e_(i-1) + u_i) - K_i a_i,    seen in the innovation as    y_i = H_i Phi_i (e_(i-1) + u_i) + a_i

Match ``sum y' W^-1 nu`` and energy ``sum y' W^-1 y`` of all epochs behind k are a linear and a quadratic form of ``(e_k, w)``:
both are summed up once, from the last epoch back, for whatever begins when and goes on in whatever course. The likelihood
ratio is ``match^2 / energy``.

What the filter takes up cancels in these sums. Of a course that grows with the square of time and begins with the log it is almost
all: of 3 h of gravity's bend 1e18 is left as .5. Such a course is followed forward, where nothing cancels (:func:`matched_whole`).

Source: A. Willsky and H. Jones, "A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems", IEEE Trans. Autom. Control 21 (1976), eqs. 13-20.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.summed_back import AT_REST, linear_back, sum_back, sum_back_at_rest
from truenorth.core.compiled import compiled
from truenorth.errors.staying import PHI
from truenorth.filters.gains import Gains, SharedGains, factors, through

Array = NDArray[np.float64]


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
    L = fine.gains.L if isinstance(fine.gains, SharedGains) else factors(fine.estimates.innovation_covariance)
    return Innovations(L, fine.gains, whitened(L, seen))


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
    if isinstance(seen.gains, SharedGains) and seen.white.shape[2] == 1:
        return _of_known(seen, seen.gains, all_of, banks)
    energy, match, left = _match(seen, all_of)
    return _by_bank(*_not_explained(seen.white, energy, match), left, banks)


def matched_whole(seen: Innovations, bank: Signatures) -> Match:
    """:func:`matched` of errors of the measurement alone, in courses that begin with the log: each followed forward."""
    gains, course = seen.gains, bank.measured_course @ bank.after

    def follow() -> tuple[Array, Array, Signatures]:
        made, taken = through(gains, course)
        return whitened(seen.L, made), -taken[PHI], bank  # held: its number is its own as long

    made, left, _ = gains.once(("whole", id(bank)), follow) if isinstance(gains, SharedGains) else follow()
    energy, match = np.einsum("kms,kms->s", made, made), np.einsum("kms,kmr->sr", made, seen.white)
    return _by_bank(*_not_explained(seen.white, energy, match), left, (bank,))[0]


def _not_explained(white: Array, energy: Array, match: Array) -> tuple[Array, Array]:
    """Energy (S,) and match (S,) of signatures without what other errors explain; `match` (S, 1 + M) holds these behind."""
    of_innovations = match[:, 0]
    if white.shape[2] > 1:
        others = white[:, :, 1:].reshape(white[..., 0].size, -1)
        known = np.column_stack([others.T @ white[:, :, 0].ravel(), match[:, 1:].T])
        explained = np.linalg.solve(np.eye(others.shape[1]) + others.T @ others, known)
        energy = energy - np.einsum("sr,rs->s", match[:, 1:], explained[:, 1:])
        of_innovations = of_innovations - match[:, 1:] @ explained[:, 0]
    return np.maximum(energy, 1e-300), of_innovations


def _match(seen: Innovations, all_of: _Together) -> tuple[Array, Array, Array]:
    """Energy (S,), match (S, 1 + M) and what is left at the end (3, S) of each signature."""
    (n, courses), right, gains = all_of.state_course.shape, seen.white.shape[2], seen.gains
    behind = all_of.behind
    forms = np.empty((len(behind), n + courses, n + courses + right))
    ends = np.empty((len(behind), 3, n + courses))
    of_gains = tuple(np.ascontiguousarray(a) for a in (gains.step, gains.H_Phi, gains.gain, seen.L))
    white = np.ascontiguousarray(seen.white)
    at_rest = (n, gains.gain.shape[-1], n + courses, right) == AT_REST
    sum_up = sum_back_at_rest if at_rest else sum_back
    sum_up(of_gains, all_of.measured_course, all_of.state_course, white, behind, forms, ends)
    count = len(all_of.epoch)
    energy, match, left = np.empty(count), np.empty((count, right)), np.empty((3, count))
    _match_each(all_of, *of_gains, white, forms, ends, np.empty((2, n + courses)), energy, match, left)
    return energy, match, left


def _by_bank(energy: Array, of_innovations: Array, left: Array, banks: Sequence[Signatures]) -> tuple[Match, ...]:
    """A match for each bank."""
    size = of_innovations / energy
    ratio, edges = of_innovations * size, np.cumsum([0, *(len(bank.epoch) for bank in banks)]).tolist()
    parts = (slice(*pair) for pair in pairwise(edges))
    return tuple(Match(ratio[part], size[part], left[:, part]) for part in parts)


class _Responses(NamedTuple):
    """What gains that logs share decide of signatures."""

    of: _Together  # held: its number is its own as long
    energy: Array  # (S,)
    left: Array  # (3, S)
    first: Array  # (m, S): of each in its first epoch, made white
    begun: Array  # (n + w, S): the error behind it, and the sizes of its courses


def _of_known(seen: Innovations, gains: SharedGains, of: _Together, banks: Sequence[Signatures]) -> tuple[Match, ...]:
    """:func:`matched` by gains that logs share: what does not depend on the innovations is worked out once.

    What does is a linear form of the innovations behind each epoch, followed back: a row, not a matrix.
    """
    known = gains.once(("signatures", id(of)), lambda: _responses(gains, of))
    white, behind = np.ascontiguousarray(seen.white[:, :, 0]), of.behind
    forms = np.zeros((len(behind), len(known.begun)))
    A, U = of.measured_course, of.state_course
    linear_back(gains.places, gains.values, gains.H_Phi, gains.gain, gains.L, A, U, white, behind, forms)
    match = np.einsum("as,sa->s", known.first, white[of.epoch]) + np.einsum("is,si->s", known.begun, forms[of.at])
    return _by_bank(known.energy, match, known.left, banks)


def _responses(gains: SharedGains, of: _Together) -> _Responses:
    silent = Innovations(gains.L, gains, np.zeros((*gains.gain.shape[::2], 1)))
    energy, _, left = _match(silent, of)
    k, measured, state = of.epoch, of.measured.T[..., None], of.state.T[..., None]
    first = whitened(gains.L[k], measured + gains.H_Phi[k] @ state)[..., 0].T
    begun = np.concatenate([(gains.step[k] @ state - gains.gain[k] @ measured)[..., 0].T, of.after])
    return _Responses(of, np.maximum(energy, 1e-300), left, first, begun)


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
