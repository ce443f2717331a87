"""How much the structure between a master and a slave IMU bends."""

from __future__ import annotations

from dataclasses import dataclass

from truenorth.records.unit_spec import UnitSpec, value

# Of beams: .5 (a moment at the end) to .75 (a load spread evenly), 1 of a hinge at the root.
COUPLING, COUPLING_SIGMA = 0.7, 0.2
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
    coupling : (3,) floats
        How far the slave's end moves for what it turns about right, forward and up, by the chord from where the structure is
        clamped (:mod:`truenorth.errors.bending`): ``delta = (k theta) x arm``. Used where there is an arm.
    coupling_sigma : float
        What an alignment takes each to be uncertain by.
    arm : (3,) floats, m
        From where the structure is clamped to the slave, slave axes, of one that is simulated. Zeros: the slave turns in its place,
        as on a mount that yields. An alignment takes the lever arm.
    """

    sigma: tuple[float, float, float] = value("angle angle angle", "arcmin arcmin arcmin", (0.0, 0.0, 0.0))
    correlation_time: float = value("time", "s", 5.0, sign="positive")
    coupling: tuple[float, float, float] = value("ratio ratio ratio", "1 1 1", (COUPLING,) * 3)
    coupling_sigma: float = value("ratio", "1", COUPLING_SIGMA)
    arm: tuple[float, float, float] = value("length length length", "m m m", (0.0, 0.0, 0.0), sign="any")

    @property
    def beta(self) -> float:
        """Natural frequency of the critically damped process, rad/s."""
        return DECAY / self.correlation_time
