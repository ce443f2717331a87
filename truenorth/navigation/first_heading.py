"""A heading that is known where the log begins, carried by the gyros to the epoch of the level.

A boat at anchor sheers, a robot turns in place before it leaves: the heading of the first row is another one when the level is
known, up to two minutes later. The gyros turn by ``psi(t) + b t``, b the rate about the vertical that their bias adds. Of gyros
whose specification knows b within a degree an hour that is the answer. Of others it is not, and a swing shows b itself: the slope
of a line through what they turn misses it by what the swing has of a slope,

``var = x' G x / (x' x)^2``,  x the times about their mean, G the autocovariance of what the line leaves,

while it crosses the line often. Specification and line are joined by their weights.

Source: least squares with correlated residuals; W. Newey and K. West, *Econometrica* 55 (1987) 703 (weights of the lags).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.quality.regimes import motion_summary
from truenorth.quality.signals import white_noise
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import earth_rotation, integrate

Array = NDArray[np.float64]

POINTS = 100  # of the turn, at the least one a second
FEWEST_CROSSINGS = 8  # of the line: a swing with fewer goes on for too long to have an autocovariance
LAGS = 1.0 / 3.0  # of the time
PLAIN = 3.0  # sigmas: a base that seems to rest turns in place by as much
QUIET = ("still", "disturbed")


def turn_since_first_row(record: ImuRecord, answer: Alignment) -> tuple[float, float]:
    """By how much heading has grown from the record's beginning to an answer's epoch, and its sigma, rad.

    Zero and zero of a base at rest.

    Parameters
    ----------
    record : ImuRecord
    answer : Alignment
        Of its first part. Its level and the biases that it took off are used.
    """
    part = record.between(None, answer.time)
    time, heading = _headings(part, answer)
    span = float(time[-1] - time[0])
    slope, variance = _drift(time, heading)
    prior = float(np.sum((answer.C_nb[2] * answer.gyro_bias_sigma) ** 2))
    by_line = prior / (prior + variance)
    drift, left = by_line * slope, (1.0 - by_line) * prior
    turn = float(heading[-1] - heading[0]) - drift * span
    sigma = math.sqrt(left * span**2 + float(np.max(white_noise(part)[:3])) ** 2 * span)
    if motion_summary(part).overall in QUIET and abs(turn) < PLAIN * sigma:
        return 0.0, 0.0
    return turn, sigma


def _headings(record: ImuRecord, answer: Alignment) -> tuple[Array, Array]:
    """Times, s, and by how much heading is off the last there, rad, as the gyros turn about the vertical less the known bias.

    Of the whole turn, not of Euler's angle, which an IMU that stands on its forward axis does not have.
    """
    duration = float(record.time[-1] - record.time[0])
    seen = integrate(record, min(1.0, duration / POINTS), answer.gyro_bias, rows_at=[len(record) - 1])
    C_ib = np.concatenate([seen.C_ib, seen.C_ib_at])
    time = np.append(seen.time, record.time[-1] - seen.start)
    C_nb = earth_rotation(time[-1] - time, answer.position.lat) @ answer.C_nb @ C_ib[-1].T @ C_ib
    turn = C_nb @ answer.C_nb.T
    return time, -np.unwrap(np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1]))


def _drift(time: Array, heading: Array) -> tuple[float, float]:
    """Slope of a line through a heading, rad/s, and the variance of what it misses a steady drift by."""
    x = time - time.mean()
    square = float(x @ x)
    slope = float(x @ heading) / square
    left = heading - heading.mean() - slope * x
    if np.count_nonzero(np.diff(np.signbit(left))) < FEWEST_CROSSINGS:
        return slope, math.inf
    u = x * left
    lags = int(LAGS * len(x))
    sums = np.array([u[: len(u) - lag] @ u[lag:] for lag in range(lags)])
    weights = 1.0 - np.arange(lags) / lags
    return slope, max(2.0 * float(weights @ sums) - float(sums[0]), 0.0) / square**2
