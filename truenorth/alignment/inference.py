"""How good is this IMU? What the log itself can check, when the user gives no specification.

Biases: three components can be checked (:mod:`truenorth.alignment.check`). The rate along *east*, which turns heading, and
the level components of force, which tilt, cannot: their size is inferred from those that can, as drawn from the same
population.

Random walks: by maximum likelihood of the filter (:mod:`truenorth.alignment.noise`), which tells them from the base's
motion.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import LogCheck
from truenorth.models.static import StaticModel
from truenorth.quality.noise import noise_coefficients
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec, imu_spec

Array = NDArray[np.float64]

ONE_SIGMA = math.erf(1.0 / math.sqrt(2.0))  # .6827
CORRELATION_TIME = 300.0  # s: of a bias that wanders, where nobody names one
WORST_GYRO = np.radians(10.0)  # rad/s: end of the search for a bias scale
WORST_ACCEL = 10.0  # m/s^2


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


def infer_spec(check: LogCheck, noise: StaticModel) -> ImuSpec:
    """Specification inferred from a log; no better than the `navigation` preset is ever assumed of biases.

    Parameters
    ----------
    check : LogCheck
    noise : StaticModel
        Random walks, as fitted to the log.

    Returns
    -------
    ImuSpec
    """
    best = imu_spec("navigation")
    gyro_bias = predictive_sigma(check.rate_residual, check.rate_noise, best.gyro_bias, WORST_GYRO)
    accel_bias = predictive_sigma(
        np.array([check.force_residual]), np.array([check.force_noise]), best.accel_bias, WORST_ACCEL
    )
    return ImuSpec(
        name="inferred",
        gyro_bias=gyro_bias,
        accel_bias=accel_bias,
        gyro_random_walk=noise.gyro_random_walk,
        accel_random_walk=noise.accel_random_walk,
        gyro_bias_instability=noise.gyro_rate_walk * math.sqrt(0.5 * CORRELATION_TIME),
        accel_bias_instability=noise.accel_rate_walk * math.sqrt(0.5 * CORRELATION_TIME),
        correlation_time=CORRELATION_TIME,
    )


def noise_of(spec: ImuSpec) -> StaticModel:
    """Noise of the static model for a specification.

    A Gauss-Markov bias of size B and correlation time tau spreads as a random walk of ``B sqrt(2/tau)`` over times
    shorter than tau.
    """
    spread = math.sqrt(2.0 / spec.correlation_time)
    return StaticModel(
        spec.gyro_random_walk,
        spec.accel_random_walk,
        math.hypot(spec.gyro_bias_instability * spread, spec.gyro_rate_random_walk),
        math.hypot(spec.accel_bias_instability * spread, spec.accel_rate_random_walk),
    )


def usual_noise() -> StaticModel:
    """Where the fit of the random walks begins: the navigation preset's."""
    return replace(noise_of(imu_spec("navigation")), accel_rate_walk=0.0)


def allan_noise(record: ImuRecord) -> StaticModel:
    """Random walks of a base at rest by the Allan deviation (worst axis)."""
    gyro, accel = noise_coefficients(record)
    return StaticModel(float(np.max(gyro.random_walk)), float(np.max(accel.random_walk)))
