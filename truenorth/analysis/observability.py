"""What can the measurements tell of the state? Rank, piece-wise constant systems, degrees, and the answer in words.

*Rank* asks whether a direction of the state is seen at all, however weakly: it knows no noise. *Degrees* ask how much
of a prior uncertainty the measurements, with their noise, take away. Both are found with states in units of their prior
sigmas, so that rad/s next to metres do no harm.

Sources: D. Goshen-Meskin, I. Y. Bar-Itzhack, Observability analysis of piece-wise constant systems, IEEE Trans.
Aerospace and Electronic Systems 28, 1992 (total and stripped matrix); F. M. Ham, R. G. Brown, Observability, eigenvalues,
and Kalman filtering, IEEE Trans. Aerospace and Electronic Systems 19, 1983 (degrees from the covariance).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.analysis.combinations import Entangled, entangled_states
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, smoother

Array = NDArray[np.float64]

UNSEEN = 1e-9  # of what a direction could do to the measurements: less is rounding
NOT_ESTIMATED = 0.9  # of its prior sigma: a state whose sigma stays above this is not estimated
HARDLY = 0.1  # coefficients that do not matter where a direction is only hardly seen


class Segment(NamedTuple):
    """A span in which the system does not change."""

    F: Array  # (n, n) 1/s: ``x' = F x``
    H: Array  # (m, n): ``z = H x``
    duration: float = 1.0  # s; until the next segment


@dataclass(frozen=True)
class PiecewiseObservability:
    """Observability of the state at the start, from the first segments on.

    Attributes
    ----------
    rank : (r,) int array
        Of the total observability matrix of segments 1 to j: what is observable.
    stripped_rank : (r,) int array
        Of the stripped one, which leaves out the transition between segments.
    stripped_holds : bool
        Whether what no segment sees stays constant in it (``null Q_j`` in ``null F_j``): then both ranks are equal by
        theorem 1 of Goshen-Meskin and Bar-Itzhack, else the stripped one may err.
    states : int
    unobservable : (n, n - rank[-1]) array
        Basis of what all segments together do not see, state units, each state part in units of its scale at most 1.
    entangled : tuple of Entangled
        The same in words.
    """

    rank: NDArray[np.int64]
    stripped_rank: NDArray[np.int64]
    stripped_holds: bool
    states: int
    unobservable: Array
    entangled: tuple[Entangled, ...]

    def __str__(self) -> str:
        steps = ", ".join(map(str, self.rank))
        return "\n".join([f"rank {steps} of {self.states}", *map(str, self.entangled)])


@dataclass(frozen=True)
class Observability:
    """What the measurements of a system tell of its state before epoch 0.

    Attributes
    ----------
    names : tuple of str
    rank : int
    unobservable : (n, n - rank) array
        Basis of what is not seen at all, state units.
    entangled : tuple of Entangled
        The same in words.
    sigma_ratio : (n,) array
        Sigma of each state with all measurements over that without: 0 known, 1 nothing learnt.
    degrees : (n,) array
        Singular values of the measurements' square-root information in units of the prior: prior sigma over the
        measurements' own along each of `directions`, greatest first; 0 where nothing is seen, 2 where ``sigma_ratio`` is .45.
    directions : (n, n) array
        In columns, state units, each one prior sigma long.
    hardly : tuple of Entangled
        In words, what keeps more than `not_estimated` of its prior sigma: hardly seen or not at all.
    not_estimated : float
    """

    names: tuple[str, ...]
    rank: int
    unobservable: Array
    entangled: tuple[Entangled, ...]
    sigma_ratio: Array
    degrees: Array
    directions: Array
    hardly: tuple[Entangled, ...]
    not_estimated: float

    def __str__(self) -> str:
        lines = [f"rank {self.rank} of {len(self.names)}", *map(str, self.entangled)]
        if self.hardly and self.hardly != self.entangled:
            lines += [f"with this noise and prior (sigma above {self.not_estimated:g} of the prior's):"]
            lines += [f"  {group}" for group in self.hardly]
        return "\n".join(lines)


def piecewise_observability(
    segments: Sequence[Segment], scale: ArrayLike, names: Sequence[str], units: Sequence[str]
) -> PiecewiseObservability:
    """Observability of a piece-wise constant system; with one segment, that of a time-invariant one.

    Parameters
    ----------
    segments : sequence of Segment
    scale : (n,) array
        Size of each state, such as its prior sigma.
    names, units : n str
        Of the states, units as in "rad/s".

    Raises
    ------
    UsageError
        No segment, or shapes that do not fit.
    """
    from scipy.linalg import expm

    size = np.asarray(scale, dtype=np.float64)
    n = len(size)
    if not segments:
        raise UsageError("no segments: piecewise_observability needs at least one")
    total, stripped = np.zeros((0, n)), np.zeros((0, n))
    ranks, stripped_ranks, holds = [], [], True
    since_start = np.eye(n)
    for number, segment in enumerate(segments):
        F, H = np.asarray(segment.F, dtype=np.float64), np.asarray(segment.H, dtype=np.float64)
        if F.shape != (n, n) or H.ndim != 2 or H.shape[1] != n:
            raise UsageError(
                f"segment {number}: F has shape {F.shape} and H {H.shape}, expected ({n}, {n}) and (m, {n}) as in scale"
            )
        F, H = F * size / size[:, None], H * size
        seen = observable_rows(F, H)
        null = _complement(seen)
        holds &= bool(np.all(np.abs(F @ null) <= UNSEEN * np.abs(F).max(initial=0.0)))
        stripped = _joined(stripped, seen)
        total = _joined(total, seen @ since_start)
        ranks.append(len(total))
        stripped_ranks.append(len(stripped))
        since_start = expm(F * segment.duration) @ since_start
    unobservable = size[:, None] * _complement(total)
    return PiecewiseObservability(
        np.array(ranks),
        np.array(stripped_ranks),
        holds,
        n,
        unobservable,
        entangled_states(unobservable, size, names, units),
    )


def observable_rows(F: Array, H: Array, rounding: float = 0.0) -> Array:
    """(rank, n) orthonormal rows that span the rows of ``H, H F, H F^2, ...``.

    Grown one power at a time from an orthonormal basis, as the powers themselves would soon be lost in rounding (Earth
    rate to the fifth is 1e-21). For a discrete system F is ``Phi - I``, and `rounding` what the subtraction left in it.
    """
    seen = np.zeros((0, F.shape[0]))
    front, size = H, np.abs(H)
    while len(front):
        # A row counts by what is new in it, besides what its terms are made of.
        reach = np.linalg.norm(size, axis=1)
        front = (front / np.where(reach > 0.0, reach, 1.0)[:, None])[reach > 0.0]
        rows: list[Array] = []
        for row in front:
            new = _new_part(row, np.vstack([seen, *rows]) if rows else seen)
            if new is not None:
                rows.append(new[None])
        if not rows:
            break
        fresh = np.vstack(rows)
        seen = np.vstack([seen, fresh])
        front, size = fresh @ F, np.abs(fresh) @ (np.abs(F) + rounding / UNSEEN * np.eye(len(F)))
    return seen


def _new_part(row: Array, seen: Array) -> Array | None:
    """What a row, of length 1 at most, adds to orthonormal ones, of length 1; None where it is rounding."""
    rest = row - (row @ seen.T) @ seen
    rest = rest - (rest @ seen.T) @ seen
    length = np.linalg.norm(rest)
    return rest / length if length > UNSEEN else None


def _joined(basis: Array, rows: Array) -> Array:
    """Orthonormal rows that span both."""
    stack = np.vstack([basis, rows / np.linalg.norm(rows, axis=1, keepdims=True)])
    _, s, Vt = np.linalg.svd(stack, full_matrices=False)
    return Vt[s > UNSEEN * s.max(initial=0.0)]


def _complement(rows: Array) -> Array:
    """(n, n - r) orthonormal columns orthogonal to r orthonormal rows."""
    return np.linalg.svd(rows, full_matrices=True)[2][len(rows) :].T


def observability(
    system: LinearSystem, names: Sequence[str], units: Sequence[str], not_estimated: float = NOT_ESTIMATED
) -> Observability:
    """Observability of a linear system by its matrices and by its noise.

    The rank is that of ``H_k Phi_k ... Phi_0`` over the rows that are present; a direction that moves them by less than
    1e-9 of what others do counts as not seen. Degrees take process noise, S and absent rows as the filter does.

    Parameters
    ----------
    system : LinearSystem
        Of one run; of `z` only matters which rows are present.
    names, units : n str
        Of the states, units as in "rad/s".
    not_estimated : float
        Part of its prior sigma above which a direction is reported as hardly seen.

    Raises
    ------
    UsageError
        Several runs, or a prior that does not leave every state open.
    """
    if system.runs != ():
        raise UsageError(f"observability: the system has runs {system.runs}, expected one run without a run axis")
    if not 0.0 < not_estimated < 1.0:
        raise UsageError(f"not_estimated is {not_estimated}, expected a part of the prior sigma between 0 and 1")
    scale = np.sqrt(np.diag(system.P0))
    try:
        L = np.linalg.cholesky(system.P0 / np.outer(scale, scale)) if np.all(scale > 0.0) else None
    except np.linalg.LinAlgError:
        L = None
    if L is None:
        raise UsageError("P0 is singular: leave states or combinations that are known from the start out of the system")
    unobservable = scale[:, None] * _complement(_seen_rows(system, scale))

    P = smoother(replace(system, z=np.where(np.isnan(system.z), np.nan, 0.0), u=None)).P0 / np.outer(scale, scale)
    half = np.linalg.solve(L, P)
    kept, V = np.linalg.eigh(np.linalg.solve(L, half.T))  # variances with measurements, prior 1
    kept = np.clip(kept, 1e-16, 1.0)
    directions = scale[:, None] * (L @ V)
    hardly = directions[:, kept > not_estimated**2]
    return Observability(
        tuple(names),
        len(scale) - unobservable.shape[1],
        unobservable,
        entangled_states(unobservable, scale, names, units),
        np.sqrt(np.diag(P)),
        np.sqrt(1.0 / kept - 1.0),
        directions,
        entangled_states(hardly, scale, names, units, HARDLY),
        not_estimated,
    )


def _seen_rows(system: LinearSystem, scale: Array) -> Array:
    """(rank, n) orthonormal rows that the measurements see of the state before epoch 0, in units of `scale`."""
    Phi = system.Phi * scale / scale[:, None]
    H, present = system.H * scale, np.isfinite(system.z)
    n = system.states
    if len(Phi) == 1 and len(H) == 1 and system.epochs >= n and present.all():
        seen = observable_rows(Phi[0] - np.eye(n), H[0], rounding=4.0 * float(np.finfo(float).eps))
        return _joined(np.zeros((0, n)), seen @ Phi[0])
    triangle, since_start = np.zeros((0, n)), np.eye(n)
    block: list[Array] = []
    for k in range(system.epochs):
        since_start = Phi[k if len(Phi) > 1 else 0] @ since_start
        rows = H[k if len(H) > 1 else 0][present[k if len(present) > 1 else 0]] @ since_start
        length = np.linalg.norm(rows, axis=1, keepdims=True)
        block.append(rows[length[:, 0] > 0.0] / length[length[:, 0] > 0.0])
        if len(block) == 100 or k == system.epochs - 1:
            triangle = np.asarray(np.linalg.qr(np.vstack([triangle, *block]), mode="r"))
            block = []
    _, s, Vt = np.linalg.svd(triangle, full_matrices=False)
    return Vt[s > UNSEEN * s.max(initial=0.0)]
