"""Navigation: from an alignment onward, free inertial or aided."""

from truenorth.navigation.procedure import navigate
from truenorth.navigation.result import Navigation
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start

__all__ = ["Mounting", "Navigation", "Start", "navigate"]
