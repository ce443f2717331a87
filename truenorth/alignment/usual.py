"""What is usual of sensors with the noise that a log shows: between the presets."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from truenorth.alignment.noise import PRIOR_WIDTH
from truenorth.errors.staying import StaticModel
from truenorth.records.specs import PRESETS, imu_spec

CORRELATION_TIME = 300.0  # s: of a bias that wanders, where nobody names one


@lru_cache(maxsize=64)
def usual(sensor: str, what: str, random_walk: float) -> float:
    """What is usual of a sensor with a random walk, such as its ``bias``: between the presets by a power law, SI."""
    presets = [imu_spec(name) for name in PRESETS]
    walks = np.log([getattr(spec, f"{sensor}_random_walk") for spec in presets])
    sizes = np.log([getattr(spec, f"{sensor}_{what}") for spec in presets])
    return math.exp(float(np.interp(math.log(max(random_walk, 1e-12)), walks, sizes)))


def wandering_as_usual(noise: StaticModel, *, promised: bool = False) -> StaticModel:
    """White noise as it is, and biases that wander as is usual of sensors with it; `promised`: as much as presets promise.

    Biases of accelerometers that are taken for constants see the earth turn gravity: a wander of .4 ug was a tilt of .02 deg. A
    preset promises what most sensors keep: it is one sigma of the prior (:mod:`truenorth.alignment.noise`) above its centre.
    """
    rate = math.sqrt(2.0 / CORRELATION_TIME) * (1.0 if promised else math.exp(-PRIOR_WIDTH))
    return replace(
        noise,
        gyro_rate_walk=rate * usual("gyro", "bias_instability", noise.gyro_random_walk),
        accel_rate_walk=rate * usual("accel", "bias_instability", noise.accel_random_walk),
    )
