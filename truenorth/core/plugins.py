"""Plug-ins of other packages, by entry points: found when they are first asked for, imported when they are used.

- ``truenorth.formats``: ``read(path, layout) -> ImuRecord``, by ``read_imu(path, format=NAME)`` or the suffix ``.NAME``;
- ``truenorth.methods``: ``align(request) -> Alignment``, by ``align(..., method=NAME)``, in campaigns too;
- ``truenorth.motions``: ``build(position, arm, rng, **options) -> Motion``, by ``motion: {kind: plug-in, name: NAME}``;
- ``truenorth.errors``: ``make(spec) -> Group``, by ``navigate(..., errors=[NAME])``, ``align`` on the move and ``--error NAME``;
- ``truenorth.aiding``: ``read(path) -> aid``, by ``truenorth navigate --aid NAME=FILE``; the aid brings its own error states.

``examples/plugin`` has one of each.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from truenorth.core.errors import UsageError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint


@cache
def plugins(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name; ``.load()`` gives the object."""
    from importlib.metadata import entry_points  # it reads mail headers: 15 ms that most processes need not wait

    return {point.name: point for point in entry_points(group=group)}


def plugin(group: str, name: str) -> Any:
    """The object of one plug-in.

    Raises
    ------
    UsageError
        None of that name is installed.
    """
    found = plugins(group)
    if name not in found:
        installed = ", ".join(sorted(found)) or "none"
        raise UsageError(f"plug-in {name!r} of {group} is not installed; installed: {installed}")
    return found[name].load()
