"""How much the structure between a master and a slave IMU bends."""

from __future__ import annotations

from dataclasses import dataclass

from truenorth.records.unit_spec import UnitSpec, value

DECAY = 2.146193  # (1 + x) exp(-x) = 1/e: correlation time times beta


@dataclass(frozen=True, kw_only=True)
class FlexureSpec(UnitSpec):
    """How much a structure bends, and how fast.

    Attributes
    ----------
    sigma : (3,) floats, rad
        Of the slave's heading, pitch and roll relative to the rigid body.
    correlation_time : float, s
        After which the autocorrelation ``(1 + beta t) exp(-beta t)`` is 1/e, ``beta = 2.146 / correlation_time``.
    """

    sigma: tuple[float, float, float] = value("angle angle angle", "arcmin arcmin arcmin", (0.0, 0.0, 0.0))
    correlation_time: float = value("time", "s", 5.0, sign="positive")

    @property
    def beta(self) -> float:
        """Natural frequency of the critically damped process, rad/s."""
        return DECAY / self.correlation_time
