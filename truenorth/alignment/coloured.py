"""Matches of signatures weighed by the colour of the innovations (:mod:`truenorth.quality.colour`): of a base that sways.

Only what white innovations would hardly give is weighed: the rest shows nothing anyhow.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.matched import Innovations, Match, Signatures, whitened
from truenorth.quality.colour import colour_of
from truenorth.state.limits import limit

Array = NDArray[np.float64]


def weighed_by_colour(seen: Innovations, banks: Sequence[Signatures], matches: Sequence[Match]) -> tuple[Match, ...]:
    """The same matches, with ratios that are as rare in coloured innovations.

    Parameters
    ----------
    seen : Innovations
    banks : sequence of Signatures
    matches : sequence of Match
        Of these banks.
    """
    found = []
    for bank, match in zip(banks, matches, strict=True):
        ratio = match.ratio.copy()
        which = np.flatnonzero(ratio > limit("hint"))
        signatures, left = _apart(seen, made(seen, bank, which), match.size[which]) if len(which) else ((), ())
        for k, signature, residual in zip(which, signatures, left, strict=True):
            ratio[k] = colour_of(residual, signature).ratio(float(ratio[k]))
        found.append(match._replace(ratio=ratio))
    return tuple(found)


def made(seen: Innovations, bank: Signatures, which: NDArray[np.int64]) -> Array:
    """(S, K, m) white innovations that signatures of size one make, of those with these numbers (S,)."""
    step, H_Phi, gain = seen.gains.step, seen.gains.H_Phi, seen.gains.gain
    begin, state, measured, after = (
        bank.epoch[which],
        bank.state[:, which],
        bank.measured[:, which],
        bank.after[:, which],
    )
    course = bank.state_course @ after
    found = np.zeros((len(step), gain.shape[2], len(which)))
    error = np.zeros_like(state)
    for k in range(int(begin.min()), len(step)):
        first, behind = k == begin, k > begin
        error += np.where(first, state, 0.0) + np.where(behind, course, 0.0)
        seen_now = np.where(first, measured, 0.0) + np.where(behind, bank.measured_course[k] @ after, 0.0)
        found[k] = H_Phi[k] @ error + seen_now
        error = step[k] @ error - gain[k] @ seen_now
    return np.ascontiguousarray(np.moveaxis(whitened(seen.L, found), 2, 0))


def _apart(seen: Innovations, signatures: Array, size: Array) -> tuple[Array, Array]:
    """Signatures (S, K, m) without what other errors explain of them, and what they and these leave of the innovations."""
    nu, others = seen.white[:, :, 0], seen.white[:, :, 1:]
    left = nu - size[:, None, None] * signatures
    if others.shape[2]:
        columns = others.reshape(-1, others.shape[2])
        inner = np.eye(columns.shape[1]) + columns.T @ columns

        def without(x: Array) -> Array:
            explained = np.linalg.solve(inner, columns.T @ x.reshape(len(x), -1).T)
            return np.asarray(x - (columns @ explained).T.reshape(x.shape))

        return without(signatures), without(left)
    return signatures, left
