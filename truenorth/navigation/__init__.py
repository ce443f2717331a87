"""Navigation: from an alignment onward, free inertial or aided. Names load what they need: an alignment needs little."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from truenorth.navigation.procedure import navigate
    from truenorth.navigation.result import Navigation
    from truenorth.state.mounting import Mounting
    from truenorth.state.state import Start

_HOMES = {
    "Mounting": "truenorth.state.mounting",
    "Navigation": "truenorth.navigation.result",
    "Start": "truenorth.state.state",
    "navigate": "truenorth.navigation.procedure",
}

__all__ = ["Mounting", "Navigation", "Start", "navigate"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(name)
    return getattr(import_module(_HOMES[name]), name)
