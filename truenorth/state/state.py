"""One epoch: where a vehicle is, how it lies and moves, and what is assumed of its IMU."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import SupportsFloat

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import radii
from truenorth.state.layout import BA, BG, DP, DV, PHI, STATES
from truenorth.state.mounting import Clock, Drift, Mounting
from truenorth.state.prior import WholeBiases

Array = NDArray[np.float64]


@dataclass(frozen=True)
class State:
    """Attitude, velocity and place at one epoch, ENU, and the biases assumed."""

    time: float  # s
    C_nb: Array  # (3, 3)
    v_n: Array  # (3,) m/s
    lat: float  # rad
    lon: float  # rad
    alt: float  # m
    gyro_bias: Array  # (3,) rad/s
    accel_bias: Array  # (3,) m/s^2

    @classmethod
    def at(
        cls,
        C_nb: ArrayLike,
        lat: SupportsFloat,
        lon: SupportsFloat = 0.0,
        alt: SupportsFloat = 0.0,
        v_n: ArrayLike = (0.0, 0.0, 0.0),
        time: float = 0.0,
    ) -> State:
        """A motion (attitude (3, 3), rad, m, m/s, s) of an IMU without biases."""
        C, v = (np.array(values, dtype=np.float64) for values in (C_nb, v_n))
        return State(time, C, v, float(lat), float(lon), float(alt), np.zeros(3), np.zeros(3))


@dataclass(frozen=True)
class Start(State):
    """Where navigation begins: a state, and what is known of its errors.

    Attributes
    ----------
    P : (15, 15) or (n, n) array
        Covariance of the errors phi, dv, dp, gyro and accelerometer bias (see :mod:`truenorth.errors.ins`), ENU; where a procedure
        gives the prior of its groups too, of all states of its model.
    whole : WholeBiases or None
        The biases hold the slow ones as well, and how to take them apart; None: the slow ones come on top of them, unknown.
    wheel : Mounting or None
        How an alignment on the move found the odometer to sit and to count.
    gnss_delay : (delay, sigma) or None, s
        By which that alignment found the receiver's stamps to be late.
    gnss_velocity_delay : Clock or None
        By which it found those of the receiver's velocities to be late, where they have a delay of their own.
    gnss_drift : Drift or None
        How it found the receiver's clock to run against the IMU's.
    plumb : float, rad
        One-sigma deflection of the vertical that P holds as tilt and accelerometer bias that cancel each other; 0: none.
    known : mapping of name to (m,) values
        Groups that an alignment on the move, or a transfer, has estimated, such as the IMU's scale factors and misalignments
        (:mod:`truenorth.errors.axes`): they stand behind the fifteen in P, in this order.
    force : (3,) array, m/s^2
        Specific force at rest, body axes: known axes of the accelerometers act on what differs from it. Zeros where none are known.
    within : bool
        Whether the epoch may lie within a row of the IMU, as that of a transfer does.
    """

    P: Array
    whole: WholeBiases | None = None
    wheel: Mounting | None = None
    gnss_delay: tuple[float, float] | None = None
    gnss_velocity_delay: Clock | None = None
    gnss_drift: Drift | None = None
    plumb: float = 0.0
    known: Mapping[str, Array] = field(default_factory=dict)
    force: Array = field(default_factory=lambda: np.zeros(3))
    within: bool = False

    @classmethod
    def of(cls, state: State, P: Array) -> Start:
        """A state, its errors known by a covariance."""
        return cls(
            state.time, state.C_nb, state.v_n, state.lat, state.lon, state.alt, state.gyro_bias, state.accel_bias, P
        )

    def with_errors(self, x: Array) -> Start:
        """The start with errors (15,) in it: of motion computed minus true, of biases true minus assumed."""
        R_M, R_N = radii(self.lat)
        return replace(
            self,
            C_nb=dcm_from_rotation_vector(-x[PHI]) @ self.C_nb,
            v_n=self.v_n + x[DV],
            lat=self.lat + x[DP][1] / (R_M + self.alt),
            lon=self.lon + x[DP][0] / ((R_N + self.alt) * np.cos(self.lat)),
            alt=self.alt + x[DP][2],
            gyro_bias=self.gyro_bias - x[BG],
            accel_bias=self.accel_bias - x[BA],
        )

    def states_of(self, name: str) -> slice:
        """Where a group that is known stands in P."""
        before = list(self.known)[: list(self.known).index(name)]
        first = STATES + sum(len(self.known[own]) for own in before)
        return slice(first, first + len(self.known[name]))

    def without(self, name: str) -> Start:
        """The start with nothing known of a group; the same where nothing was."""
        if name not in self.known:
            return self
        kept = np.delete(np.arange(len(self.P)), self.states_of(name))
        known = {own: x for own, x in self.known.items() if own != name}
        return replace(self, P=self.P[np.ix_(kept, kept)], known=known)
