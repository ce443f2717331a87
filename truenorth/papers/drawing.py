"""What the drawings of all studies share: a sheet with its legend, and an axis that marks what lies beyond it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.figures.style import headed, new_figure, style

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


@contextmanager
def sheet(
    width: float, height: float, rows: int = 1, columns: int = 1, *, legend: int, heading: str = "", **shared: Any
) -> Iterator[tuple[Figure, Any]]:
    """A figure of this size (inches) in the project's look with its axes, to be drawn on inside.

    At the end the heading stands above, and each label of the axes once in a legend of so many columns below them; `shared` goes
    to :meth:`matplotlib.figure.Figure.subplots`.
    """
    with style():
        figure = new_figure(width, height)
        axes = figure.subplots(rows, columns, **shared)
        yield figure, axes
        if heading:
            headed(figure, heading)
        labelled: dict[str, Any] = {}
        for ax in np.ravel(axes):
            for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
                labelled.setdefault(label, handle)
        figure.legend(labelled.values(), labelled.keys(), loc="outside lower left", ncols=legend)
