"""What accelerometer biases do as they swing with the base: left out of the filter of a sway, and no departure and no step.

Biases act by the slow attitude there (:func:`truenorth.errors.sway.without_sway`), since an arm swings in step with the tilt as
well. What is left out is known in its course, ``int (C - C_slow) nabla dt``, and in its size by the prior of the biases.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.core.position import Position
from truenorth.errors.staying import local_axes
from truenorth.errors.sway import without_sway

Array = NDArray[np.float64]


def swung_biases(fine: FineAlignment, sigma: Array, position: Position, C_sb: Array | None = None) -> Array:
    """(K, 3, 3) mean velocities of the intervals (E, N, U), m/s, of a bias of one sigma along each axis.

    Parameters
    ----------
    fine : FineAlignment
        In the velocity form.
    sigma : (3,) array, m/s^2
    position : Position
    C_sb : (K+1, 3, 3) array, optional
        Attitude of the base in the IMU, of one on an indexer.
    """
    log = fine.integrals
    swings = fine.C_n0_i @ (log.C_mean - without_sway(log, C_sb).C_mean)
    gained = log.intervals[:, None, None] * swings * sigma
    velocity = np.cumsum(gained, axis=0) - 0.5 * gained
    return np.asarray(local_axes(log.time, position.lat) @ velocity)
