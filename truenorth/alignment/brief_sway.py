"""What a sway of less than a minute leaves open: how its level bends with a heading that nobody knows, and a swing on lines.

The earth's level rate, as an answer whose heading is off by ``d`` takes it, is wrong by ``w_ie cos L (sin d, cos d - 1)`` along its
own east and north. A filter that is linear knows the first as ``d`` and the second as nothing. In a log too short to show heading
good gyros leave neither open, and the tilt along north is that rate times the time: .08 deg of an IMU of a navigation grade after
half a minute, nine of its sigmas, as ``d`` was 144 deg. So what such a rate leaves in the answer is added, with the mean square of
``1 - cos d`` of a normal d (the term of second order; A. Gelb, *Applied Optimal Estimation*, 1974, sec. 6.1).

What floats also swings on its lines, within a metre or so and slower than any sea. Its acceleration changes by ``A w^3`` a second,
which looks like a level rate of ``A w^3 / g``; a log shorter than two periods shows no swing, and accuses no gyro of less.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import bias_signatures
from truenorth.alignment.check import LogCheck
from truenorth.alignment.fine import BEND, FineAlignment
from truenorth.alignment.matched import innovations_of, matched
from truenorth.alignment.swing_fit import MOST
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import PHI

Array = NDArray[np.float64]


def bent_by_heading(fine: FineAlignment, lat: float) -> Array:
    """(3, 3) covariance of the last misalignment, rad^2, that is of second order in a heading error."""
    # A rate that stays is a bias of the gyros from the first epoch on, which good gyros are not allowed.
    left = matched(innovations_of(fine), bias_signatures(fine, (("step", 0.0),)))[0].left[:, :3]
    north = (fine.C_n0_i @ fine.integrals.C_mean.mean(axis=0))[1]
    turned = EARTH_RATE * math.cos(lat) * left @ north
    variance = float(fine.P[PHI, PHI][2, 2])
    squares = 1.0 - 2.0 * math.exp(-0.5 * variance) + 0.5 * (1.0 + math.exp(-2.0 * variance))  # of 1 - cos d
    return np.asarray(squares * np.outer(turned, turned))


def may_swing_on_lines(check: LogCheck, position: Position) -> LogCheck:
    """The check of a brief log, of a base that may swing as far as any that lines hold."""
    rate = MOST * (2.0 * math.pi / BEND) ** 3 / gravity_of_place(position.lat, position.alt) / math.sqrt(2.0)  # RMS
    return replace(check, rate_noise=np.hypot(check.rate_noise, [rate, 0.0]))
