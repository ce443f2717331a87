"""Plug-ins of other packages, by entry points: found when they are first asked for, imported when they are used.

Groups: ``truenorth.formats``, ``truenorth.methods``, ``truenorth.motions``, ``truenorth.errors``, ``truenorth.aiding``.
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points


@cache
def plugins(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; ``.load()`` gives the object."""
    return {point.name: point for point in entry_points(group=group)}
