"""How good is this IMU? What the log itself can check, when the user gives no specification.

Biases: three components can be checked (:mod:`truenorth.alignment.check`). The rate along *east*, which turns heading, and
the level components of force, which tilt, cannot: their size is inferred from those that can, as drawn from the same
population, and from what is usual of sensors with the random walk that the log shows.

Random walks: by maximum likelihood of the filter (:mod:`truenorth.alignment.noise`), which separates them from the base's
motion.

The vertical force shows what acts as an accelerometer bias: the bias, and what a scale factor makes of gravity. The filter needs
their sum; what the answer states is taken apart (:func:`apart_from_axes`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import LogCheck
from truenorth.alignment.usual import CORRELATION_TIME, usual
from truenorth.errors.staying import StaticModel
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec, imu_spec

Array = NDArray[np.float64]

GYRO_WIDTH = math.log(7.0)  # one sigma of the logarithm of a bias about what is usual with such a random walk
ACCEL_WIDTH = math.log(2.0)  # narrower: an accelerometer's offset goes with its noise, a gyro's with its maker's care
LEAST = 0.3  # of the navigation preset's biases: beginning of the search
WORST_GYRO = np.radians(10.0)  # rad/s: end of the search for a bias scale
WORST_ACCEL = 10.0  # m/s^2
BEYOND_THREE = math.erfc(3.0 / math.sqrt(2.0))  # share of a normal distribution beyond three sigmas
STEPS = 50  # of Newton's method, at the most; it takes some five
INFERRED = "inferred from the log"


def predictive_sigma(
    residuals: Array, noises: Array, typical: float, width: float, smallest: float, largest: float
) -> float:
    """Sigma of one more draw from the population that `residuals` came from; three of it hold 99.73 % of such draws.

    The population is N(0, s^2), each residual is seen through noise of its own, and s is unknown: log-normal about what is
    typical. Such a draw has long tails (Student's t, had nothing been known of s), since two residuals may be small by
    chance. Its standard deviation would hold 98.8 % within three, and let one draw of 150 be more than four off. Who reads a
    sigma takes it for that of a normal distribution: it is as wide as three of it say. The middle of the distribution is
    narrower then: most errors are smaller than sigma. It is no smaller than the standard deviation.

    Parameters
    ----------
    residuals, noises : (M,) arrays
    typical : float
        Median of s beforehand.
    width : float
        One sigma of its logarithm.
    smallest, largest : float
        Range of s.

    Notes
    -----
    A coverage interval, as the Guide to the expression of uncertainty in measurement asks for where a distribution is not
    normal (JCGM 101:2008, 7.7), divided by its factor of a normal distribution.
    """
    s = np.geomspace(smallest, largest, 400)
    variance = s[:, None] ** 2 + np.square(noises)
    log_density = -0.5 * np.sum(np.square(residuals) / variance + np.log(variance), axis=1)
    log_density -= 0.5 * (np.log(s / typical) / width) ** 2
    weight = np.exp(log_density - log_density.max())
    weight /= weight.sum()
    sigma = math.sqrt(float(weight @ s**2))
    kept = weight > 1e-9
    slope, weight = 3.0 / math.sqrt(2.0) / s[kept], weight[kept]
    for _ in range(STEPS):  # the share beyond is convex: Newton's method comes to the root from below
        beyond = float(weight @ [math.erfc(x) for x in slope * sigma]) - BEYOND_THREE
        if beyond <= 1e-6 * BEYOND_THREE:
            break
        sigma += beyond / float(2.0 / math.sqrt(math.pi) * (weight * slope) @ np.exp(-np.square(slope * sigma)))
    return sigma


def infer_spec(check: LogCheck, noise: StaticModel) -> ImuSpec:
    """Specification inferred from a log; no better than the `navigation` preset is ever assumed of biases.

    Parameters
    ----------
    noise : StaticModel
        Random walks, as fitted to the log.
    """
    best = imu_spec("navigation")
    typical_gyro = usual("gyro", "bias", noise.gyro_random_walk)
    typical_accel = usual("accel", "bias", noise.accel_random_walk)
    force, force_noise = np.array([check.force_residual]), np.array([check.force_noise])
    gyro_bias = predictive_sigma(
        check.rate_residual, check.rate_noise, typical_gyro, GYRO_WIDTH, LEAST * best.gyro_bias, WORST_GYRO
    )
    accel_bias = predictive_sigma(force, force_noise, typical_accel, ACCEL_WIDTH, LEAST * best.accel_bias, WORST_ACCEL)
    return ImuSpec(
        name="inferred",
        gyro_bias=max(gyro_bias, best.gyro_bias),
        accel_bias=max(accel_bias, best.accel_bias),
        gyro_random_walk=noise.gyro_random_walk,
        accel_random_walk=noise.accel_random_walk,
        gyro_bias_instability=noise.gyro_rate_walk * math.sqrt(0.5 * CORRELATION_TIME),
        accel_bias_instability=noise.accel_rate_walk * math.sqrt(0.5 * CORRELATION_TIME),
        correlation_time=CORRELATION_TIME,
    )


def apart_from_axes(spec: ImuSpec, gravity: float) -> ImuSpec:
    """An inferred specification, its accelerometer bias apart from what axes make of gravity (m/s^2).

    The ratio is what is usual with such noise. Misalignments are taken for as large as scale factors: whatever the attitude, the
    sum that acts stays what the log has shown. A specification with scale factors is one whose filter estimates them: it stays.
    """
    if spec.accel_scale_factor > 0.0:
        return spec
    bias = usual("accel", "bias", spec.accel_random_walk)
    of_axes = gravity * usual("accel", "scale_factor", spec.accel_random_walk)
    both = math.hypot(bias, of_axes)
    axes = spec.accel_bias * of_axes / (both * gravity)
    return replace(spec, accel_bias=spec.accel_bias * bias / both, accel_scale_factor=axes, accel_misalignment=axes)


def specification(spec: ImuSpec | None, check: LogCheck, noise: Callable[[], StaticModel]) -> tuple[ImuSpec, str]:
    """The specification that is given, or else inferred (:func:`infer_spec`), and where it comes from in words.

    `noise` is asked for only where none is given: a log's noise takes time.
    """
    if spec is not None:
        return spec, f"specification {spec.name!r}"
    return infer_spec(check, noise()), INFERRED


@cache
def usual_noise() -> StaticModel:
    """Where the fit of the random walks begins: the navigation preset's.

    Biases of accelerometers that wander look like a base that goes slowly to and fro: one that moves has none.
    """
    return replace(StaticModel.of(imu_spec("navigation")), accel_rate_walk=0.0)


def allan_noise(record: ImuRecord) -> StaticModel:
    """Random walks of a base at rest by the Allan deviation (worst axis)."""
    from truenorth.quality.noise import noise_coefficients

    gyro, accel = noise_coefficients(record)
    return StaticModel(float(np.max(gyro.random_walk)), float(np.max(accel.random_walk)))
