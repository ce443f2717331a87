"""What every procedure shares: the state of a vehicle, its track, how error states are laid out, how sensors sit; and the judge."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.state.layout import Layout
    from truenorth.state.mounting import Mounting
    from truenorth.state.state import Start, State
    from truenorth.state.track import Residuals, Track

__all__ = ["Layout", "Mounting", "Residuals", "Start", "State", "Track"]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Layout": "layout",
        "Mounting": "mounting",
        "Residuals": "track",
        "Start": "state",
        "State": "state",
        "Track": "track",
    },
)
