"""One look for all figures: fonts, colours that colour-blind readers can distinguish, sigma bands, long traces.

Draw inside ``with style():`` on a figure from `new_figure`. Figures are made without pyplot, so no window system
is needed, nothing is global, and a long campaign leaks no figure.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from truenorth.figures.thinning import evenly, thin

Array = NDArray[np.float64]

# Okabe and Ito (2008), "Color universal design", in the order in which neighbours differ most.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
REFERENCE = "#444444"  # truth and limits
AXES_NAMES = ("x", "y", "z")

_RC: dict[Any, Any] = {
    "figure.dpi": 110,
    "figure.constrained_layout.use": True,
    "figure.facecolor": "white",
    "savefig.dpi": 150,
    "font.size": 10.0,
    "font.family": "sans-serif",
    "axes.titlesize": 11.0,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 10.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.prop_cycle": cycler(color=COLOURS),
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 5),
    "axes.xmargin": 0.0,
    "grid.color": "#D9D9D9",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "legend.handlelength": 1.6,
    "svg.fonttype": "none",
}


PLAIN_BELOW = 4  # powers of ten, below which a number on a logarithmic axis is written out: 60, not 6 x 10^1


class Drawing(Figure):
    """A figure whose logarithmic axes have plain numbers; matplotlib looks that up when it draws, after `style` has ended."""

    def draw(self, renderer: Any) -> None:
        """Draw as matplotlib does, with plain numbers."""
        with mpl.rc_context({"axes.formatter.min_exponent": PLAIN_BELOW}):
            super().draw(renderer)


@contextmanager
def style() -> Iterator[None]:
    """Set the project's look for the figures made and drawn inside."""
    with mpl.rc_context(_RC):
        yield


def new_figure(width: float = 9.0, height: float = 6.0) -> Figure:
    """Make a figure of this size, inches, that belongs to no window; its `savefig` works without a display."""
    return Drawing(figsize=(width, height), layout="constrained")


def band(
    ax: Axes,
    time: ArrayLike,
    mean: ArrayLike,
    sigma: ArrayLike,
    *,
    factor: float = 1.0,
    label: str | None = None,
    color: str | None = None,
) -> None:
    """Draw a line within its sigma band.

    Parameters
    ----------
    ax : Axes
    time, mean, sigma : (N,) arrays
        In the units of the axes.
    factor : float
        Half width of the band in sigmas.
    label : str, optional
        Of the line; the band is named after it.
    color : str, optional
        Default: the next of the palette.
    """
    t, m, s = (np.asarray(x, dtype=np.float64) for x in (time, mean, sigma))
    keep = thin(t, m)
    (line,) = ax.plot(t[keep], m[keep], label=label, color=color)
    even = evenly(t.size)
    ax.fill_between(
        t[even],
        (m - factor * s)[even],
        (m + factor * s)[even],
        color=line.get_color(),
        alpha=0.18,
        linewidth=0.0,
        label=None if label is None else f"{label} ± {factor:g}σ",
    )


def trace(ax: Axes, time: ArrayLike, values: ArrayLike, **options: Any) -> None:
    """Plot a long trace thinned to what the eye can tell; `options` go to ``Axes.plot``."""
    t, v = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    keep = thin(t, v)
    ax.plot(t[keep], v[keep], **options)


def headed(figure: Figure, text: str) -> None:
    """Put a heading over all axes, flush left."""
    figure.suptitle(text, ha="left", x=0.01, fontsize=11)
