"""The figure of an alignment: convergence of the three angles, their sigmas, innovations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.figures.style import COLOURS, REFERENCE, band, new_figure, style, trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from truenorth.alignment.result import Alignment

ANGLES = ("heading", "pitch", "roll")
SETTLED_FROM = 0.25


def plot_alignment(result: Alignment) -> Figure:
    """Draw convergence with one-sigma bands, sigmas with their floors, and innovations with two-sigma bounds.

    Raises
    ------
    ValueError
        The method kept no history.
    """
    from truenorth.alignment.result import euler_sigma

    h = result.history
    if h is None:
        raise ValueError(f"method {result.method!r} gives one answer and keeps no history to draw")
    t = h.time
    with style():
        figure = new_figure(11.0, 7.5)
        axes = figure.subplots(3, 2, sharex=True)
        late = slice(int(SETTLED_FROM * len(t)), None)
        floor = euler_sigma(h.C_nb, h.phi_floor)
        values, sigmas = (np.degrees(x) for x in result.convergence)
        for i, angle in enumerate(ANGLES):
            value, sigma = values[:, i], sigmas[:, i]
            ax = axes[i, 0]
            band(ax, t, value, sigma, color=COLOURS[i])
            low, high = np.min((value - sigma)[late]), np.max((value + sigma)[late])
            margin = 0.15 * max(high - low, 1e-9)
            ax.set_ylim(low - margin, high + margin)
            ax.set_ylabel(f"{angle}, deg")
            trace(axes[0, 1], t, 60 * np.degrees(h.euler_sigma[:, i]), color=COLOURS[i], label=angle)
            trace(axes[0, 1], t, 60 * np.degrees(floor[:, i]), color=COLOURS[i], linestyle=":")
        axes[0, 0].set_title("Attitude at the answer's epoch, as told at each time")
        axes[0, 1].set_title("One sigma; dotted: what waiting does not improve")
        axes[0, 1].set_yscale("log")
        axes[0, 1].set_ylabel("arcmin")
        axes[0, 1].legend(ncols=3)
        for i, axis in enumerate(("east", "north")):
            ax = axes[i + 1, 1]
            bound = 2e3 * h.innovation_sigma[:, i]
            trace(ax, t, 1e3 * h.innovation[:, i], color=COLOURS[i])
            for sign in (1, -1):
                trace(ax, t, sign * bound, color=REFERENCE, linestyle=":")
            ax.set_ylim(-1.6 * np.max(bound[late]), 1.6 * np.max(bound[late]))
            ax.set_ylabel(f"{axis}, mm/s")
        axes[1, 1].set_title("Innovations with two-sigma bounds")
        for ax in axes[2]:
            ax.set_xlabel("time, s")
        figure.suptitle(f"{result.source}: {result.status}, method {result.method}", x=0.01, ha="left")
    return figure
