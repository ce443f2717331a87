"""Navigation: from an alignment onward, free inertial or aided."""

from truenorth.navigation.driver import Start
from truenorth.navigation.procedure import navigate
from truenorth.navigation.result import Navigation
from truenorth.navigation.sensors import Mounting

__all__ = ["Mounting", "Navigation", "Start", "navigate"]
