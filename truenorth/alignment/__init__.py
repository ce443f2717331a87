"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from truenorth.alignment.moving import Moving, Wheel
from truenorth.alignment.procedure import align
from truenorth.alignment.result import Alignment, History

if TYPE_CHECKING:
    from truenorth.alignment.in_motion import align_in_motion

__all__ = ["Alignment", "History", "Moving", "Wheel", "align", "align_in_motion"]


def __getattr__(name: str) -> Any:
    """Stands on navigation, which stands on the results here: loaded when it is first used."""
    if name != "align_in_motion":
        raise AttributeError(f"module 'truenorth.alignment' has no attribute {name!r}")
    from truenorth.alignment.in_motion import align_in_motion

    return align_in_motion
