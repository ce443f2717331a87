"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from truenorth.alignment.procedure import align
from truenorth.alignment.result import Alignment, History

__all__ = ["Alignment", "History", "align"]
