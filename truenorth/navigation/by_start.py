"""Does heading depend on the start as its sigma says? The same log from starts that are one sigma off, in heading and in its gyro.

A Kalman filter moves its estimate by ``d = Phi_K delta`` where its start is off by ``delta``, and its covariance holds
``P >= Phi_K P0 Phi_K'``. So of starts that are off by ``delta_i``, together within the prior, ``sum delta_i delta_i' <= P0``, the
answers are off by no more than sigma:

    sum d_i d_i' <= P

This is exact of a linear filter. An extended one breaks it where it sees heading against its own noise. By ``dv' = f x phi``
level forces show heading. Of a vehicle that stands, or goes straight on at one speed, the filter computes a level force all the
same: what its corrections move of tilt and biases, which turn with a heading that may be wrong by tens of degrees. Gyros of
phones and drones turn a heading as far within a minute: in a log of 200 s without a push it was off by eight sigmas. Where
answers move by more than sigma, heading is as unsure as the start and the bias of its gyro leave it, as far back as the log did
not show it:

    sigma^2 = P_psi + 2 t P_psi,b + t^2 P_b

and so is what goes with it, such as the place of the IMU by an antenna on an arm: `P` with another variance of heading, the others
given heading as they were. The bias of the gyro about the vertical is as unsure as it was at the start, about its value there: the
filter moved it by what passed for knowledge. The rule is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.estimate.rivals import nearest
from truenorth.state.evidence import Evidence, note
from truenorth.state.layout import BG, PHI, STATES
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

UP = PHI.start + 2
LINEAR = 0.1  # rad: of a turn within it the errors are linear to half a per cent
ROUNDING = 1e-9  # of a correlation
NEAR = 0.1  # rad: further off, a start may lose the track that the answer keeps
SEEN = 0.5  # of sigma: where answers differ by less, the log has shown heading


@dataclass(frozen=True)
class Others:
    """Starts that are one sigma off, or part of it, together within the prior."""

    starts: tuple[Start, ...]
    parts: tuple[float, ...]  # of a sigma
    time: float  # s; of the start
    variance: Array  # (2, 2) of heading and of the gyro about the vertical
    gyro_bias: Array  # (3,) rad/s; of the start

    @classmethod
    def of(cls, start: Start) -> Others:
        """Those of a start."""
        shifts, variance = _shifts(start)
        parts = [min(1.0, NEAR / max(float(np.linalg.norm(shift[PHI])), 1e-300)) for shift in shifts.T]
        starts = tuple(start.with_errors(part * shift) for part, shift in zip(parts, shifts.T, strict=True))
        return cls(starts, tuple(parts), start.time, variance, np.asarray(start.gyro_bias))

    def free(self, time: Array) -> Array:
        """(K,) one sigma of heading, rad, as the start and its gyro alone leave it."""
        t, P = time - self.time, self.variance
        return np.sqrt(np.maximum(P[0, 0] + 2.0 * t * P[0, 1] + t**2 * P[1, 1], 0.0))

    def moved(self, track: Track, others: Sequence[Track]) -> Array:
        """(K, 9) by how much the answers from these starts, together, differ from the track: phi, dv, dp."""
        squares = np.zeros((len(track), 9))
        for other, part in zip((run.whole() for run in others), self.parts, strict=True):
            squares += (track.errors_against(other, nearest(other.time, track.time)) / part) ** 2
        return np.sqrt(squares)

    def growth(self, track: Track, moved: Array, most: float = 0.0) -> Array:
        """(K, 12) by how many times sigmas of phi, dv, dp and gyro biases grow; `most`: see :func:`stretch`."""
        sigma, free = track.sigma[:, :9], self.free(track.time)
        growth = np.ones((len(track), BG.stop))
        if free[-1] < LINEAR:
            return growth
        safe = np.where(sigma > 0.0, sigma, np.inf)
        unseen = _unseen(track, moved, most)
        more = np.where(unseen, np.maximum(free**2 - sigma[:, UP] ** 2, 0.0), 0.0)
        along = track.P[:, :9, UP] * np.sqrt(more)[:, None] / safe[:, UP, None] ** 2
        growth[:, :9] = np.maximum(np.maximum(moved / safe, 1.0), np.sqrt(1.0 + along**2 / safe**2))
        up, of_gyros = track.C_nb[:, 2], track.P[:, BG, BG]
        known = np.einsum("ki,kij,kj->k", up, of_gyros, up)
        led = np.einsum("ki,ki->k", up, track.gyro_bias - self.gyro_bias)  # by what passed for knowledge
        more = np.where(unseen, np.maximum(self.variance[1, 1] + led**2 - known, 0.0), 0.0)
        own = np.diagonal(of_gyros, axis1=1, axis2=2)
        growth[:, BG] = np.sqrt(1.0 + more[:, None] * up**2 / np.where(own > 0.0, own, np.inf))
        return growth


def start_evidence(run: Callable[[Start], Track], start: Start, track: Track) -> tuple[list[Evidence], Array]:
    """What the log does not show of heading though the filter says so, and by how much sigmas grow for it.

    Parameters
    ----------
    run : callable
        The same log from another start.
    start : Start
    track : Track
        From it.

    Returns
    -------
    evidence : list of Evidence
    growth : (K, 12) array
        Times one sigma of phi, dv, dp and gyro biases, along the way; ones where the answer depends on the start as sigma says.
    """
    others, none = Others.of(start), np.ones((len(track), BG.stop))
    if others.free(track.time[-1:])[0] < LINEAR:
        return [], none
    try:
        tracks = [run(other) for other in others.starts]
    except DataError:  # the filter broke down: nothing to compare
        return [], none
    growth = others.growth(track, others.moved(track, tracks))
    return unsure_heading(track, growth), growth


def unsure_heading(track: Track, growth: Array) -> list[Evidence]:
    """What there is to say of a heading whose sigma grows so."""
    sigma, last = float(track.sigma[-1, UP]), float(growth[-1, UP])
    if last < limit("depends on its start"):
        return []
    return [note("heading.by_start", "manoeuvre_gnss", "stops", urgent=True, sigma=sigma, grown=sigma * last)]


def stretch(track: Track, moved: Array, most: float = 0.0) -> float:
    """The most sigmas that heading has moved by since the log last showed it; `most`: before the first of these epochs."""
    for ratio in _in_sigma(track, moved):
        most = max(most, float(ratio)) if ratio > SEEN else 0.0
    return most


def _in_sigma(track: Track, moved: Array) -> Array:
    sigma = track.sigma[:, UP]
    return moved[:, UP] / np.where(sigma > 0.0, sigma, np.inf)


def _unseen(track: Track, moved: Array, most: float) -> NDArray[np.bool_]:
    """(K,) stretches in which the log has not shown heading, and answers differ by too much somewhere."""
    ratio = _in_sigma(track, moved)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ratio > SEEN, [False]]).astype(np.int8)))
    unseen = np.zeros(len(ratio), dtype=np.bool_)
    for begin, end in edges.reshape(-1, 2):
        largest = max(ratio[begin:end].max(), most if begin == 0 else 0.0)
        unseen[begin:end] = largest > limit("depends on its start")
    return unseen


def _shifts(start: Start) -> tuple[Array, Array]:
    """(15, 2) errors of the start, of heading and of the gyro about the vertical, and the covariance (2, 2) of these two.

    Groups that are known stay as they are: the errors are those that their values leave.
    """
    P = np.asarray(start.P)
    own, others = P[:STATES, :STATES], P[STATES:, :STATES]
    P = own - others.T @ np.linalg.pinv(P[STATES:, STATES:], hermitian=True) @ others
    A = np.zeros((2, STATES))
    A[0, UP], A[1, BG] = 1.0, -start.C_nb[2]  # heading's error grows by minus that of the gyro
    of_both = A @ P @ A.T
    size = np.sqrt(np.maximum(np.diag(of_both), 0.0))
    scale = np.where(size > 0.0, size, 1.0)
    values, ways = np.linalg.eigh(
        of_both / np.outer(scale, scale)
    )  # heading may be known, or all of its error be the gyro's
    seen = np.where(values > ROUNDING, values, np.inf)
    return P @ (A / scale[:, None]).T @ ways / np.sqrt(seen), of_both
