"""What the drawings of all studies share: an axis that marks what lies beyond it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MARKS = 40  # at most, along one edge


def marked(ax: Any, x: Array, y: Array, limits: tuple[float, float], **line: Any) -> None:
    """Draw a curve on an axis of fixed limits; triangles on its edges mark the points beyond it."""
    ax.plot(x, y, **line)
    ax.set_ylim(*limits)
    inset = 0.02 * (limits[1] - limits[0])
    for beyond, edge, mark in ((y > limits[1], limits[1] - inset, "^"), (y < limits[0], limits[0] + inset, "v")):
        at = np.flatnonzero(beyond)
        at = at[:: max(1, len(at) // MARKS)]
        ax.plot(x[at], np.full(len(at), edge), mark, markersize=4, color=line.get("color"), linestyle="none")
