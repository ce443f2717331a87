"""How an aiding sensor sits on the vehicle, and how well that is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.state.limits import limit

Array = NDArray[np.float64]

SLIP_SIGMA = 0.1  # m/s, of a wheel sideways and of a body on its springs up and down
COMPLIANCE_SIGMA = 5e-3  # rad s^2/m, 2.8 deg/g: tyres give 1 to 5 deg/g, springs 2 to 4
LONGEST_ARM = 100.0  # m; ships have no longer ones


class Clock(NamedTuple):
    """How late what a sensor shows is, and how well that is known."""

    latency: float  # s, by which it is older than its time stamp
    latency_sigma: float  # s; 0: known, else it is estimated


@dataclass(frozen=True)
class Mounting:
    """How an aiding sensor sits on the vehicle, and how well that is known.

    Attributes
    ----------
    lever_arm : (3,) array, m
        IMU to sensor (antenna, wheel), IMU body axes: right, forward, up.
    lever_arm_sigma : float, m
        0: known; else the arm is estimated.
    C_mb : (3, 3) array
        IMU body to vehicle axes (right, forward, up) for body velocities.
    angle_sigma : float, rad
        Of pitch and yaw of that; 0: known.
    scale_sigma : float
        Of an odometer's or a log's scale factor; 0: known.
    bias_sigma : float or None, m/s or m
        Of a slow error of a velocity log, a barometer or a receiver's places (of its heights in proportion to sigma); 0: none.
        None: nothing is said of it; places are then known no better than a fix, since no data show an error of all of them.
    bias_time : float, s
        Its correlation time.
    latency : float, s
        The measurement is older than its time stamp by this much.
    latency_sigma : float, s
        0: known; else the latency is estimated.
    velocities : Clock, optional
        How late a receiver's velocities are, where that is not how late its places are: a mean over an interval is half of it older
        than a place of the same stamp.
    gate : float
        Probability of rejecting a sound measurement; 0: none is rejected.
    noise : float or None, m/s or m
        One-sigma noise where the record itself does not say; None: a usual value.
    slip : float, m/s
        One-sigma velocity of a wheel sideways and upwards (the non-holonomic constraint).
    compliance : float, rad s^2/m
        One sigma of the angle by which tyres and springs let the body lean from the path of an odometer's wheel, for each
        m/s^2 of force across and along; 0: rigid, as on rails.
    """

    lever_arm: Array = field(default_factory=lambda: np.zeros(3))
    lever_arm_sigma: float = 0.0
    C_mb: Array = field(default_factory=lambda: np.eye(3))
    angle_sigma: float = 0.0
    scale_sigma: float = 0.0
    bias_sigma: float | None = None
    bias_time: float = math.inf
    latency: float = 0.0
    latency_sigma: float = 0.0
    velocities: Clock | None = None
    gate: float = limit("gate")
    noise: float | None = None
    slip: float = SLIP_SIGMA
    compliance: float = COMPLIANCE_SIGMA

    @property
    def of_velocities(self) -> Clock:
        """How late a receiver's velocities are: as its places, where nothing else is said."""
        return self.velocities or Clock(self.latency, self.latency_sigma)

    @property
    def slow(self) -> float:
        """Sigma of its slow error; 0 where nothing is said of one."""
        return self.bias_sigma or 0.0

    def __post_init__(self) -> None:
        arm = np.asarray(self.lever_arm, dtype=np.float64)
        if arm.shape != (3,) or not np.all(np.isfinite(arm)):
            raise UsageError(f"lever arm {self.lever_arm!r}; expected three finite numbers: right, forward, up, metres")
        if np.linalg.norm(arm) > LONGEST_ARM:
            raise UsageError(
                f"lever arm {arm.tolist()} is {np.linalg.norm(arm):.0f} m long; expected metres (right, forward, up): were "
                "centimetres or millimetres handed in?"
            )
        object.__setattr__(self, "lever_arm", arm)
        if self.velocities is not None:
            try:
                clock = Clock(*map(float, self.velocities))
            except (TypeError, ValueError):
                clock = Clock(math.nan, math.nan)
            if not (math.isfinite(clock.latency) and 0.0 <= clock.latency_sigma < math.inf):
                raise UsageError(f"velocities={self.velocities!r}; expected how late they are and its sigma, s")
            object.__setattr__(self, "velocities", clock)


def mounting_angles(heading: float, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """``C_mb`` from where the IMU's axes point on the vehicle: its heading, pitch, roll against the vehicle, rad."""
    return np.asarray(dcm_from_euler(heading, pitch, roll), dtype=np.float64)
