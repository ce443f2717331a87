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
given heading as they were. The rule is ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import nearest
from truenorth.state.evidence import Evidence, note
from truenorth.state.layout import BA, BG, DP, DV, PHI, STATES
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

UP = PHI.start + 2
LINEAR = 0.1  # rad: of a turn within it the errors are linear to half a per cent
ROUNDING = 1e-9  # of a correlation
NEAR = 0.1  # rad: further off, a start may lose the track that the answer keeps
SEEN = 0.5  # of sigma: where answers differ by less, the log has shown heading


def start_evidence(run: Callable[[Start], Track], start: Start, track: Track) -> tuple[list[Evidence], Array]:
    """What the log does not show of heading though the filter says so, and by how much sigmas of phi, dv and dp grow for it.

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
    growth : (K, 9) array
        Times one sigma, along the way; ones where the answer depends on the start as sigma says.
    """
    sigma, none = track.sigma[:, :9], np.ones((len(track), 9))
    shifts, variance = _shifts(start)
    t = track.time - start.time
    free = np.sqrt(np.maximum(variance[0, 0] + 2.0 * t * variance[0, 1] + t**2 * variance[1, 1], 0.0))
    if free[-1] < LINEAR:
        return [], none
    moved = np.zeros_like(sigma)
    for shift in shifts.T:
        part = min(1.0, NEAR / max(float(np.linalg.norm(shift[PHI])), 1e-300))
        try:
            other = run(_moved(start, part * shift))
        except DataError:  # the filter broke down: nothing to compare
            return [], none
        moved += (track.errors_against(other, nearest(other.time, track.time)) / part) ** 2
    squares = moved / np.where(sigma > 0.0, sigma, np.inf) ** 2
    growth = np.sqrt(np.maximum(squares, 1.0))
    unseen = _unseen(np.sqrt(squares[:, UP]))
    more = np.where(unseen, np.maximum(free**2 - sigma[:, UP] ** 2, 0.0), 0.0)
    along = (
        track.P[:, :9, UP] * np.sqrt(more)[:, None] / np.where(sigma[:, UP] > 0.0, sigma[:, UP] ** 2, np.inf)[:, None]
    )
    growth = np.maximum(growth, np.sqrt(1.0 + along**2 / np.where(sigma > 0.0, sigma, np.inf) ** 2))
    last = float(growth[-1, UP])
    if last < limit("depends on its start"):
        return [], growth
    figures = {"sigma": float(sigma[-1, UP]), "grown": float(sigma[-1, UP]) * last}
    return [note("heading.by_start", "manoeuvre_gnss", "stops", urgent=True, **figures)], growth


def _unseen(moved: Array) -> NDArray[np.bool_]:
    """(K,) stretches in which the log has not shown heading, and answers differ by too much somewhere."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moved > SEEN, [False]]).astype(np.int8)))
    unseen = np.zeros(len(moved), dtype=np.bool_)
    for begin, end in edges.reshape(-1, 2):
        unseen[begin:end] = moved[begin:end].max() > limit("depends on its start")
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


def _moved(start: Start, x: Array) -> Start:
    """The start with these errors (15,) in it."""
    R_M, R_N = radii(start.lat)
    return replace(
        start,
        C_nb=dcm_from_rotation_vector(-x[PHI]) @ start.C_nb,
        v_n=start.v_n + x[DV],
        lat=start.lat + x[DP][1] / (R_M + start.alt),
        lon=start.lon + x[DP][0] / ((R_N + start.alt) * np.cos(start.lat)),
        alt=start.alt + x[DP][2],
        gyro_bias=start.gyro_bias + x[BG],
        accel_bias=start.accel_bias + x[BA],
    )
