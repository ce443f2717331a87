"""How good is this IMU? What the log itself can check, when the user gives no specification.

Biases: on a base that stays where it is, the earth's rate and gravity are known. Three components can be checked: the
rate along north and along the vertical (their length and angle to gravity against the latitude), and the specific
force along the vertical. The rate along *east*, which turns heading, and the level components of force, which tilt,
cannot: their size is inferred from those that can, as drawn from the same population.

Random walks: the Allan deviation of a still base is fitted. On a base that moves, its own bounded motion falls off as
1/tau, white noise as 1/sqrt(tau): the smallest ``adev sqrt(tau)`` bounds the random walk from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.allan import noise_coefficients, overlapping_adev
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


def infer_spec(record: ImuRecord, check: LogCheck, still: bool) -> ImuSpec:
    """Specification inferred from a log; no better than the `navigation` preset is ever assumed of biases.

    Parameters
    ----------
    record : ImuRecord
    check : LogCheck
    still : bool
        Whether nothing but the sensors moves the numbers: then the Allan deviation is theirs. On a base that moves it
        bounds the random walks from above, and those usual for such biases are taken where they are smaller.

    Returns
    -------
    ImuSpec
    """
    best = imu_spec("navigation")
    gyro_bias = predictive_sigma(check.rate_residual, check.rate_noise, best.gyro_bias, WORST_GYRO)
    accel_bias = predictive_sigma(
        np.array([check.force_residual]), np.array([check.force_noise]), best.accel_bias, WORST_ACCEL
    )
    if still:
        gyro, accel = noise_coefficients(record)
        walks = _worst(gyro.random_walk), _worst(accel.random_walk)
        drifts = _worst(gyro.bias_instability), _worst(accel.bias_instability)
    else:
        bounds, usual = random_walk_bounds(record), usual_walks(gyro_bias, accel_bias)
        walks = min(bounds[0], usual[0]), min(bounds[1], usual[1])
        drifts = 0.0, 0.0
    return ImuSpec(
        name="inferred",
        gyro_bias=gyro_bias,
        accel_bias=accel_bias,
        gyro_random_walk=walks[0],
        accel_random_walk=walks[1],
        gyro_bias_instability=drifts[0],
        accel_bias_instability=drifts[1],
    )


def _worst(per_axis: Array) -> float:
    return float(np.max(per_axis))


def usual_walks(gyro_bias: float, accel_bias: float) -> tuple[float, float]:
    """Angle and velocity random walk usual for IMUs of such biases: the presets, interpolated on logarithmic scales."""
    presets = [imu_spec(name) for name in ("navigation", "tactical", "industrial", "consumer")]

    def interpolate(bias: float, biases: list[float], random_walks: list[float]) -> float:
        return float(np.exp(np.interp(np.log(bias), np.log(biases), np.log(random_walks))))

    return (
        interpolate(gyro_bias, [p.gyro_bias for p in presets], [p.gyro_random_walk for p in presets]),
        interpolate(accel_bias, [p.accel_bias for p in presets], [p.accel_random_walk for p in presets]),
    )


def random_walk_bounds(record: ImuRecord) -> tuple[float, float]:
    """Upper bounds of angle and velocity random walk (worst axis), rad/sqrt(s) and m/s/sqrt(s)."""
    block = max(1, round(record.rate / ALLAN_RATE))
    count = len(record) // block
    interval = block * record.interval
    taus = np.geomspace(1, max(1, count // SHORTEST_ALLAN), 12) * interval
    bounds = []
    for increment in increments(record):
        sums = increment[: count * block].reshape(count, block, 3).sum(axis=1)
        allan = overlapping_adev(sums, interval, taus, "increments")
        bounds.append(_worst(np.min(allan.deviation * np.sqrt(allan.tau)[:, None], axis=0)))
    return bounds[0], bounds[1]


def walks(spec: ImuSpec) -> tuple[float, float, float, float]:
    """Noise of the static model for a specification: two random walks, and two random walks of the biases.

    A Gauss-Markov bias of size B and correlation time tau spreads as a random walk of ``B sqrt(2/tau)`` over times
    shorter than tau.
    """
    spread = math.sqrt(2.0 / spec.correlation_time)
    return (
        spec.gyro_random_walk,
        spec.accel_random_walk,
        spec.gyro_bias_instability * spread,
        spec.accel_bias_instability * spread,
    )
