"""What iron does to a magnetometer: it adds a field of its own (hard), and bends the earth's (soft); and what the ground adds.

All relative to the earth's field: ``m = (I + S) C_mb C' (B + anomaly) + h``, with h three constants of the body, S symmetric.
"""

from __future__ import annotations

import math

import numpy as np

from truenorth.errors.group import Group


def hard_iron(sigma: float) -> Group:
    """Magnets and currents that turn with the body: three constants."""
    return Group("magnetometer hard iron", np.full(3, sigma))


def soft_iron(sigma: float) -> Group:
    """Iron in the earth's field, and scale factors: xx, yy, zz, xy, xz, yz of a symmetric matrix.

    The field of iron has no preferred axes: an element off the diagonal varies as half the difference of two on it.
    """
    return Group("magnetometer soft iron", sigma * np.array([1.0, 1.0, 1.0, *np.full(3, math.sqrt(0.5))]))


def anomaly(sigma: float, distance: float) -> Group:
    """What the ground adds to the model of the earth's field (east, north, up), and changes along the way."""
    return Group("magnetometer anomaly", np.full(3, sigma), correlation_distance=distance)
