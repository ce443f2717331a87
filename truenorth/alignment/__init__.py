"""Initial alignment: from a log to attitude, its uncertainty, and a verdict."""

from typing import TYPE_CHECKING

from truenorth.core.lazy import lazy

if TYPE_CHECKING:
    from truenorth.alignment.moving import Moving, Wheel
    from truenorth.alignment.recipes import Recipe, Request, align, register_recipe
    from truenorth.alignment.result import Alignment, History

__all__ = [
    "Alignment",
    "History",
    "Moving",
    "Recipe",
    "Request",
    "Wheel",
    "align",
    "register_recipe",
]

__getattr__, __dir__ = lazy(
    __name__,
    {
        "Alignment": "result",
        "History": "result",
        "Moving": "moving",
        "Recipe": "recipes",
        "Request": "recipes",
        "Wheel": "moving",
        "align": "recipes",
        "register_recipe": "recipes",
    },
)
