"""How an aiding sensor sits on the vehicle, and how well that is known."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.state.limits import limit

Array = NDArray[np.float64]

SLIP_SIGMA = 0.1  # m/s, of a wheel sideways and of a body on its springs up and down
COMPLIANCE_SIGMA = 5e-3  # rad s^2/m, 2.8 deg/g: tyres give 1 to 5 deg/g, springs 2 to 4
# Of a quartz clock without compensation of its temperature, s/s: 10 to 100 ppm, and of hobby boards and phones up to 500 ppm, which
# is within 3.3 of these sigmas. Source: J. R. Vig, "Quartz Crystal Resonators and Oscillators for Frequency Control and Timing
# Applications" (tutorial), hierarchy of oscillators; for the boards our own choice.
QUARTZ = 1.5e-4
LONGEST_ARM = 100.0  # m; ships have no longer ones


class Clock(NamedTuple):
    """How late what a sensor shows is, and how well that is known."""

    latency: float  # s, by which it is older than its time stamp
    latency_sigma: float  # s; 0: known, else it is estimated


class Drift(NamedTuple):
    """A clock that runs at another rate than the IMU's."""

    rate: float  # by how much the latency grows, s/s
    rate_sigma: float  # 0: known, else it is estimated
    since: float  # s, when the latency is that of the mounting


ONE_CLOCK = Drift(0.0, 0.0, 0.0)  # a receiver's and an IMU's stamps are of one


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
        Of pitch and yaw of that, of a magnetometer or another system about each axis; 0: known.
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
    drift : Drift, optional
        Of a receiver's clock against the IMU's: the latency grows at a steady rate. Left out, it does as quartz clocks do
        (:data:`QUARTZ`) where the latency is estimated, and does not where it is known.
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
    drift: Drift | None = None
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
    def clock(self) -> Drift:
        """How a receiver's clock runs against the IMU's: as quartz clocks do, where nothing else is said."""
        return self.drift or Drift(0.0, QUARTZ if self.latency_sigma > 0.0 else 0.0, 0.0)

    def late_at(self, time: Any) -> Any:
        """Latency at a time or at times, s."""
        rate, _, since = self.clock
        return self.latency + rate * (time - since)

    def stamped(self, time: Any) -> Any:
        """The stamp of what holds at a time, s: that of :meth:`late_at` is of the stamp."""
        rate, _, since = self.clock
        return time + (self.latency + rate * (time - since)) / (1.0 - rate) if rate else time + self.latency

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
        if self.drift is not None:
            try:
                drift = Drift(*map(float, self.drift))
            except (TypeError, ValueError):
                drift = Drift(math.nan, math.nan, math.nan)
            if not (abs(drift.rate) < 1.0 and 0.0 <= drift.rate_sigma < math.inf and math.isfinite(drift.since)):
                raise UsageError(f"drift={self.drift!r}; expected a rate and its sigma, s/s, and a time, s")
            object.__setattr__(self, "drift", drift)
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
