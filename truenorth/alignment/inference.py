"""How good is this IMU? What the log itself can check, when the user gives no specification.

Biases: on a base that stays where it is, the earth's rate and gravity are known. Three components can be checked: the
rate along north and along the vertical (their length and angle to gravity against the latitude), and the specific
force along the vertical. The rate along *east*, which turns heading, and the level components of force, which tilt,
cannot: their size is inferred from those that can, as drawn from the same population.

Random walks: overlapping Allan deviation. A base's own bounded motion falls off as 1/tau in it, white noise as
1/sqrt(tau), so the smallest ``adev sqrt(tau)`` bounds the random walk from above, on a moving base too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.allan import overlapping_adev
from truenorth.records import ImuRecord
from truenorth.specs import ImuSpec, imu_spec
from truenorth.strapdown import increments

Array = NDArray[np.float64]

ONE_SIGMA = math.erf(1.0 / math.sqrt(2.0))  # .6827
WORST_GYRO = np.radians(10.0)  # rad/s: end of the search for a bias scale
WORST_ACCEL = 10.0  # m/s^2
ALLAN_RATE = 10.0  # Hz: random walks show far below this; the log is averaged down to it first
SHORTEST_ALLAN = 10  # averaging times a window must hold for its Allan deviation to mean something


@dataclass(frozen=True)
class LogCheck:
    """Components of rate and specific force that the log lets us check, measured minus expected, with their noise.

    Attributes
    ----------
    rate_residual, rate_noise : (2,) arrays, rad/s
        Along north and up.
    force_residual, force_noise : float, m/s^2
        Along up.
    """

    rate_residual: Array
    rate_noise: Array
    force_residual: float
    force_noise: float


def predictive_sigma(residuals: Array, noises: Array, smallest: float, largest: float) -> float:
    """Half width of the central 68 % interval for one more draw from the population that `residuals` came from.

    The population is N(0, s^2), each residual is seen through noise of its own, and s is unknown with every order of
    magnitude in ``[smallest, largest]`` equally likely beforehand (Jeffreys). Two residuals without noise give
    1.32 times their RMS, Student's t with two degrees of freedom.

    Parameters
    ----------
    residuals, noises : (M,) arrays
    smallest, largest : float
        Range of s.

    Returns
    -------
    float
    """
    s = np.geomspace(smallest, largest, 400)
    variance = s[:, None] ** 2 + np.square(noises)
    log_likelihood = -0.5 * np.sum(np.square(residuals) / variance + np.log(variance), axis=1)
    weight = np.exp(log_likelihood - log_likelihood.max())
    weight /= weight.sum()
    low, high = smallest * 0.1, largest * 10.0
    erf = np.vectorize(math.erf)
    for _ in range(40):
        middle = math.sqrt(low * high)
        inside = float(weight @ erf(middle / (s * math.sqrt(2.0))))
        low, high = (middle, high) if inside < ONE_SIGMA else (low, middle)
    return math.sqrt(low * high)


def infer_spec(record: ImuRecord, check: LogCheck) -> ImuSpec:
    """Specification inferred from a log; no better than the `navigation` preset is ever assumed of biases.

    Parameters
    ----------
    record : ImuRecord
    check : LogCheck

    Returns
    -------
    ImuSpec
    """
    best = imu_spec("navigation")
    gyro_bias = predictive_sigma(check.rate_residual, check.rate_noise, best.gyro_bias, WORST_GYRO)
    accel_bias = predictive_sigma(
        np.array([check.force_residual]), np.array([check.force_noise]), best.accel_bias, WORST_ACCEL
    )
    gyro_walk, accel_walk = random_walks(record)
    return replace(
        best,
        name="inferred",
        gyro_bias=gyro_bias,
        accel_bias=accel_bias,
        gyro_random_walk=gyro_walk,
        accel_random_walk=accel_walk,
        gyro_bias_instability=0.0,
        accel_bias_instability=0.0,
    )


def random_walks(record: ImuRecord) -> tuple[float, float]:
    """Upper bounds of angle and velocity random walk (worst axis), rad/sqrt(s) and m/s/sqrt(s)."""
    dtheta, dvel = increments(record)
    block = max(1, round(record.rate / ALLAN_RATE))
    count = len(record) // block
    interval = block * record.interval
    longest = max(1, count // SHORTEST_ALLAN)
    taus = np.geomspace(1, longest, 12) * interval
    walks = []
    for increment in (dtheta, dvel):
        sums = increment[: count * block].reshape(count, block, 3).sum(axis=1)
        allan = overlapping_adev(sums, interval, taus, kind="increments")
        walks.append(float(np.max(np.min(allan.deviation * np.sqrt(allan.tau)[:, None], axis=0))))
    return walks[0], walks[1]
