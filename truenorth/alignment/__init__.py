"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from truenorth.alignment.moving import Moving, Wheel
from truenorth.alignment.positions import align_positions
from truenorth.alignment.procedure import align
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.rotary import align_rotary

if TYPE_CHECKING:
    from truenorth.alignment.in_motion import align_in_motion
    from truenorth.alignment.transfer import align_transfer

__all__ = [
    "Alignment",
    "History",
    "Moving",
    "Wheel",
    "align",
    "align_in_motion",
    "align_positions",
    "align_rotary",
    "align_transfer",
]

# They stand on navigation or simulation, which stand on the results here: loaded when first used.
LATER = {
    "align_in_motion": "truenorth.alignment.in_motion",
    "align_transfer": "truenorth.alignment.transfer",
}


def __getattr__(name: str) -> Any:
    """Procedures that are loaded when they are first used."""
    if name not in LATER:
        raise AttributeError(f"module 'truenorth.alignment' has no attribute {name!r}")
    return getattr(import_module(LATER[name]), name)
