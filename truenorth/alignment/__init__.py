"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.moving import Moving, Wheel
from truenorth.alignment.positions import align_positions
from truenorth.alignment.procedure import align
from truenorth.alignment.result import Alignment, History

__all__ = ["Alignment", "History", "Moving", "Wheel", "align", "align_in_motion", "align_positions"]
