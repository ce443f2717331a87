"""Mechanisation: from increments of angle and velocity to attitude, velocity and position, in several frames."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.strapdown.inertial_integration import inertial_integrals, integrate_attitude
    from truenorth.strapdown.level import Underway, go_on, mechanise, underway

__all__ = ["Underway", "go_on", "inertial_integrals", "integrate_attitude", "mechanise", "underway"]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Underway": "level",
        "go_on": "level",
        "inertial_integrals": "inertial_integration",
        "integrate_attitude": "inertial_integration",
        "mechanise": "level",
        "underway": "level",
    },
)
