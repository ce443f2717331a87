"""Angular rate without gyros: from twelve accelerometers, three at each of four places of a rigid body.

The specific force at a place r of a body is ``f(r) = f_0 + A r`` with

    A = [w' x] + [w x]^2

Four places that lie in no plane tell f_0 and all nine elements of A (:func:`field_of`). Its skew part is the angular
acceleration; its symmetric part is ``W = w w' - |w|^2 I``, which tells the rate but for its sign: ``w w' = W - I tr(W)/2``.
Integrating w' alone drifts, the roots of W are poor where a component is near zero and have no sign. A Kalman filter takes both
(:func:`rate_filter`): w' carries the rate on, the six elements of ``w w'`` measure it, and the constant errors that the
accelerometers' biases make in both are states.

Source: X. Wang, S. Wang, H. Zhu, Angular rate calculation of gyro-free strapdown INS, J. Naval Univ. Eng. 20 (3), 2008 (cited
by "Kalman filters for static alignment"); the equations are derived here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.core.linalg import symmetric

Array = NDArray[np.float64]

PLACES = 4
# Elements of a symmetric matrix that are kept.
ROWS, COLUMNS = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
RATE, DRIFT, OFFSET = slice(0, 3), slice(3, 6), slice(6, 12)


class Field(NamedTuple):
    """What four triads tell of a rigid body."""

    force: Array  # (..., 3) m/s^2: specific force at the origin
    acceleration: Array  # (..., 3) rad/s^2: angular
    square: Array  # (..., 6) (rad/s)^2: xx, yy, zz, xy, xz, yz of ``w w'``


def _inverse(places: Array) -> Array:
    """(4, 4) that solves ``f_i = f_0 + A r_i``."""
    if places.shape != (PLACES, 3):
        raise UsageError(f"places have shape {places.shape}; expected (4, 3), m")
    M = np.column_stack([np.ones(PLACES), places])
    if np.linalg.cond(M) > 1e8:
        raise UsageError("the four places lie in a plane; expected four that do not, such as 0 and one on each axis")
    return np.asarray(np.linalg.inv(M))


def field_of(force: ArrayLike, places: ArrayLike) -> Field:
    """Force, angular acceleration and the squares of the rate, from four triads.

    Parameters
    ----------
    force : (..., 4, 3) array, m/s^2
        Specific force at each place, body axes.
    places : (4, 3) array, m

    Raises
    ------
    UsageError
        Places that lie in a plane, or not four of them.
    """
    solved = np.einsum(
        "ij,...jk->...ik", _inverse(np.asarray(places, dtype=np.float64)), np.asarray(force, dtype=np.float64)
    )
    A = np.swapaxes(solved[..., 1:, :], -1, -2)
    S = 0.5 * (A - np.swapaxes(A, -1, -2))
    W = symmetric(A)
    outer = W - 0.5 * np.trace(W, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
    acceleration = np.stack([S[..., 2, 1], S[..., 0, 2], S[..., 1, 0]], axis=-1)
    return Field(solved[..., 0, :], acceleration, outer[..., ROWS, COLUMNS])


def noise_of(places: ArrayLike) -> Array:
    """(9, 9) covariance of angular acceleration and squares for accelerometers of unit variance."""
    columns = [field_of(e.reshape(PLACES, 3), places) for e in np.eye(12)]
    J = np.array([np.concatenate([c.acceleration, c.square]) for c in columns]).T
    return np.asarray(J @ J.T)


def rate_filter(
    field: Field, interval: float, places: ArrayLike, sigma: float, bias: float, start: ArrayLike, start_sigma: float
) -> tuple[Array, Array]:
    """Extended Kalman filter of the rate, of R runs at once.

    Parameters
    ----------
    field : Field
        Of (R, K, ...) samples.
    interval : float, s
    places : (4, 3) array, m
    sigma, bias : float, m/s^2
        One-sigma white noise of a sample and constant bias of each accelerometer.
    start : (R, 3) array, rad/s
        Rate before the first sample, known to `start_sigma`.
    start_sigma : float, rad/s

    Returns
    -------
    rate, sigma : (R, K, 3) arrays, rad/s
    """
    C = noise_of(places)
    runs, count = field.square.shape[:2]
    x = np.zeros((runs, 12))
    x[:, RATE] = start
    P = np.zeros((12, 12))
    P[RATE, RATE], P[3:, 3:] = start_sigma**2 * np.eye(3), bias**2 * C
    P = np.tile(P, (runs, 1, 1))
    Q, R = (sigma * interval) ** 2 * C[:3, :3], sigma**2 * C[3:, 3:]
    F = np.eye(12)
    F[RATE, DRIFT] = -interval * np.eye(3)
    rate, claimed = np.empty((runs, count, 3)), np.empty((runs, count, 3))
    H = np.zeros((runs, 6, 12))
    H[:, :, OFFSET] = np.eye(6)
    for k in range(count):
        x[:, RATE] += interval * (field.acceleration[:, k] - x[:, DRIFT])
        P = F @ P @ F.T
        P[:, RATE, RATE] += Q
        w = x[:, RATE]
        H[:, :, RATE] = 0.0
        for row, (i, j) in enumerate(zip(ROWS, COLUMNS, strict=True)):  # d(w_i w_j)
            H[:, row, i] += w[:, j]
            H[:, row, j] += w[:, i]
        expected = w[:, ROWS] * w[:, COLUMNS] + x[:, OFFSET]
        PH = P @ np.swapaxes(H, 1, 2)
        K = np.swapaxes(np.linalg.solve(H @ PH + R, np.swapaxes(PH, 1, 2)), 1, 2)
        x = x + np.einsum("rij,rj->ri", K, field.square[:, k] - expected)
        keep = np.eye(12) - K @ H
        P = keep @ P @ np.swapaxes(keep, 1, 2) + K @ R @ np.swapaxes(K, 1, 2)
        rate[:, k], claimed[:, k] = x[:, RATE], np.sqrt(np.einsum("rii->ri", P)[:, RATE])
    return rate, claimed
