"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from truenorth.alignment.moving import Moving, Wheel
from truenorth.alignment.recipes import Recipe, Request, align, register_recipe
from truenorth.alignment.result import Alignment, History

__all__ = ["Alignment", "History", "Moving", "Recipe", "Request", "Wheel", "align", "register_recipe"]
