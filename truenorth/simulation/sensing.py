"""What an ideal IMU senses: integrals of rate and specific force over each sampling interval.

Gauss-Legendre quadrature of four nodes, on steps of an eighth of the fastest oscillation at most and never across a
corner of the motion: exact to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import skew
from truenorth.records.motion import MotionStates, Moving

Array = NDArray[np.float64]

MOST_SAMPLES = 2e8  # of one log: two days at a kilohertz
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
BLOCK = 4096  # intervals at once: keeps the work arrays in the cache


def increments(moving: Moving, edges: Array) -> tuple[Array, Array]:
    """Integrals of rate and specific force between successive `edges` (N+1,), as (N, 3) rad and m/s."""
    both = integrals(moving, edges, lambda at: np.concatenate([at.w_ib_b, at.f_b], axis=-1), 6)
    return np.ascontiguousarray(both[:, :3]), np.ascontiguousarray(both[:, 3:])


def leverage(moving: Moving, edges: Array) -> Array:
    """Integrals of ``[dw x] + [w x]^2`` between successive `edges` (N+1,), as (N, 3, 3) 1/s.

    Times a place r from the centre of the IMU it is what an accelerometer there senses compared with one in the centre.
    """
    return integrals(moving, edges, lambda at: acceleration_gain(at).reshape(*at.time.shape, 9), 9).reshape(-1, 3, 3)


def acceleration_gain(at: MotionStates) -> Array:
    """``[dw x] + [w x]^2``, (..., 3, 3) 1/s^2: acceleration of a point of the body relative to its centre, per metre."""
    w = at.w_ib_b
    square = np.sum(w * w, axis=-1)[..., None, None] * np.eye(3)
    return skew(at.dw_ib_b) + w[..., :, None] * w[..., None, :] - square


def integrals(moving: Moving, edges: Array, rates: Callable[[MotionStates], Array], columns: int) -> Array:
    """Integrals between successive `edges` (N+1,) of the (..., columns) values that `rates` takes from the states, (N, columns)."""
    if getattr(moving, "at_rest", False):  # one rate for all of the log; most motions do not say
        return np.diff(edges)[:, None] * rates(moving.states(edges[:1]))
    corners = moving.breaks
    inside = corners[(corners > edges[0]) & (corners < edges[-1])]
    parts = math.ceil(8 * float(np.max(np.diff(edges))) / moving.shortest_period)
    if parts > 1:
        fractions = np.arange(1, parts) / parts
        inside = np.union1d(inside, (edges[:-1, None] + np.diff(edges)[:, None] * fractions).ravel())
    steps = np.union1d(edges, inside) if inside.size else edges
    sums = np.empty((len(steps) - 1, columns))
    for first in range(0, len(sums), BLOCK):
        rows = slice(first, min(first + BLOCK, len(sums)))
        start, length = steps[rows], np.diff(steps[first : rows.stop + 1])
        at = moving.states(start[:, None] + 0.5 * length[:, None] * (1.0 + NODES))
        sums[rows] = np.einsum("kn,kni->ki", 0.5 * length[:, None] * WEIGHTS, rates(at))
    return np.add.reduceat(sums, np.searchsorted(steps, edges[:-1])) if inside.size else sums
