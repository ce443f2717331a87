"""How fast a base itself goes to and fro, where a filter does not show it: by its forces alone, in its last minute.

Forces are carried by the gyros into axes that do not turn, and summed up. Of the velocity that this gives a smooth curve is taken
off: tilt, biases and a gyro that drifts leave no more. What is left is the base's own motion and the noise of the sensors. The
noise is white, of rates and of forces, as the quiet part of the log shows it. What it leaves of the same sums is known, and is
taken off the square; where it may be all of it by chance, a sway that would be seen bounds the motion.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.regimes import motion_summary
from truenorth.quality.signals import even_rates, second_means, unturned, white_noise
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

LAST = 60  # s
# Degrees of the curve of velocity: of a short log by a tilt alone, of a minute by one that bends.
SMOOTHEST, SMOOTH = 1, 3
A_DEGREE = 15.0  # s of log for one degree
FEWEST = 5  # s
CHANCE = 3.0  # standard deviations of a sum of squares
SWELL = 12.0  # s, period of a sway that noise may hide
GRAVITY = 9.8  # m/s^2


def own_velocity(record: ImuRecord) -> Array:
    """RMS velocity of the base's own motion, to and fro, in the last minute of a log.

    Parameters
    ----------
    record : ImuRecord
        Of a base that goes nowhere.

    Returns
    -------
    (3,) array, m/s
        East, north and up. Heading may not be known: of the level ones both are the largest of any direction. Where noise
        explains it, half of what noise would hide; NaN of a log below 5 s.
    """
    motion = motion_summary(record)
    if len(motion.time) < FEWEST:
        return np.full(3, np.nan)
    interval, rates = even_rates(record)
    per_second = max(1, round(1.0 / interval))
    rates = rates[:, : len(motion.time) * per_second][:, -LAST * per_second :]
    turns = (rates[:3] - motion.rate_bias[:, None]) * interval
    force = second_means(unturned(turns, rates[3:]), per_second)
    seconds = force.shape[1]
    degree = max(SMOOTHEST, min(SMOOTH, round(seconds / A_DEGREE)))
    apart = _apart(seconds, degree)
    second = per_second * interval
    gained = apart @ np.cumsum(force, axis=1).T * second
    up = force.mean(axis=1)
    up /= np.linalg.norm(up)
    across_up = gained - np.outer(gained @ up, up)
    axes = np.linalg.eigh(across_up.T @ across_up)[1][:, 1:]  # the two level ones, by how fast the base goes along them
    noise = white_noise(record)
    by_force, by_tilt = _noise(apart, second)
    forces = float(np.max(noise[3:])) ** 2 * by_force
    tilts = forces + (GRAVITY * float(np.max(noise[:3]))) ** 2 * by_tilt
    swell = apart @ np.cos(2.0 * np.pi * second / SWELL * np.arange(seconds)) * np.sqrt(2.0)
    along, across = (_own(gained @ axes[:, k], tilts, swell, degree) for k in (1, 0))
    level = max(along, across)
    return np.array([level, level, _own(gained @ up, forces, swell, degree)])


def _apart(seconds: int, degree: int) -> Array:
    """(m, m) what takes a smooth curve off m velocities."""
    basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, seconds), degree)
    basis, _ = np.linalg.qr(basis)
    return np.asarray(np.eye(seconds) - basis @ basis.T)


def _noise(apart: Array, second: float) -> tuple[Array, Array]:
    """(m, m) covariances of what is left of velocities, of unit random walks of force and of tilt."""
    sums = np.tril(np.ones(apart.shape))
    walk = np.sqrt(second) * apart @ sums
    tilt = second * walk @ sums
    return walk @ walk.T, tilt @ tilt.T


def _own(left: Array, noise: Array, swell: Array, degree: int) -> float:
    """RMS of what is left of velocities (m,) beyond noise of this covariance; half of what noise would hide, where that is more.

    By chance the velocities, each as well as noise lets it be known, have as large a square as they are many. `swell`, of an RMS
    of 1, tells what must be there to be seen.
    """
    kept, square, mean = left.size - degree - 1, float(left @ left), float(np.trace(noise))
    if not mean:  # perfect sensors
        return float(np.sqrt(square / kept))
    values, ways = np.linalg.eigh(noise)
    known = ways[:, -kept:] / np.sqrt(values[-kept:])
    needed = CHANCE * float(np.sqrt(2.0 * kept))
    hidden = 0.5 * float(np.sqrt(needed / np.sum((known.T @ swell) ** 2)))
    if float(np.sum((known.T @ left) ** 2)) <= kept + needed:
        return hidden
    return max(float(np.sqrt(max(square - mean, 0.0) / kept)), 2.0 * hidden)
