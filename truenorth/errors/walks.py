"""From a specification to noise: the random walks that drive every error model, made here and nowhere else.

A bias instability of size B and correlation time tau is a Gauss-Markov process. Where it is no state of its own, it counts

* over times shorter than tau as a random walk of the bias, of density ``B sqrt(2/tau)``;
* over times longer than tau, when it is forgotten, as white noise of the sensor, of density ``B sqrt(2 tau)``.

Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, sec. 3.8 (Gauss-Markov processes and their limits).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Walks:
    """White noise of the sensors and random walks of their biases; one-sigma densities, SI."""

    gyro_random_walk: float = 0.0  # rad/sqrt(s)
    accel_random_walk: float = 0.0  # m/s/sqrt(s)
    gyro_rate_walk: float = 0.0  # of the gyro biases, rad/s/sqrt(s)
    accel_rate_walk: float = 0.0  # of the accelerometer biases, m/s^2/sqrt(s)

    def __post_init__(self) -> None:
        for name in Walks.__dataclass_fields__:
            if not 0.0 <= getattr(self, name) < math.inf:
                raise UsageError(f"{name} is {getattr(self, name)}; expected zero or more, and finite")

    @classmethod
    def of(cls, spec: ImuSpec, slow: Literal["walk", "white", "state"] = "walk", **others: Any) -> Self:
        """Those of a specification.

        Parameters
        ----------
        spec : ImuSpec
        slow : {"walk", "white", "state"}
            How the bias instabilities count: as random walks of the biases, as white noise, or not at all, being states.
        **others
            Further fields of the model.
        """
        rate = math.sqrt(2.0 / spec.correlation_time) if slow == "walk" else 0.0
        white = math.sqrt(2.0 * spec.correlation_time) if slow == "white" else 0.0
        gyro, accel = spec.gyro_bias_instability, spec.accel_bias_instability
        return cls(
            math.hypot(spec.gyro_random_walk, white * gyro),
            math.hypot(spec.accel_random_walk, white * accel),
            math.hypot(spec.gyro_rate_random_walk, rate * gyro),
            math.hypot(spec.accel_rate_random_walk, rate * accel),
            **others,
        )

    def density(self, states: int, phi: slice, dv: slice, bg: slice, ba: slice) -> Array:
        """(n,) spectral density of the white noise that drives each state of a model, its unit^2/s."""
        q = np.zeros(states)
        q[phi], q[dv] = self.gyro_random_walk**2, self.accel_random_walk**2
        q[bg], q[ba] = self.gyro_rate_walk**2, self.accel_rate_walk**2
        return q
