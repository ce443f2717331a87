"""The figure of a navigation: track, height, velocity, attitude, their sigmas, innovations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.figures.style import COLOURS, REFERENCE, band, new_figure, style, trace
from truenorth.figures.thinning import evenly
from truenorth.figures.track import ellipses, track_unit
from truenorth.figures.units import Clock

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from truenorth.navigation.result import Navigation

Array = NDArray[np.float64]

HELD = 1e-6  # of the largest sigma


def plot_navigation(result: Navigation) -> Figure:
    """Draw track with error ellipses, height, velocity and attitude with one-sigma bands, sigmas, innovations."""
    with style():
        figure = new_figure(12.0, 10.5)
        columns = figure.add_gridspec(1, 2)
        left, right = columns[0].subgridspec(3, 1, height_ratios=[2.2, 1, 1]), columns[1].subgridspec(5, 1)
        track, height, velocity = (figure.add_subplot(left[i]) for i in range(3))
        heading, level, position, speeds, innovations = (figure.add_subplot(right[i]) for i in range(5))
        _track(track, result)
        clock = Clock.of(result.time)
        t = clock(result.time)
        band(height, t, result.position[:, 2], result.position_sigma[:, 2], color=COLOURS[2])
        height.set_title(f"Height ({result.altitude}), ±1σ")
        height.set_ylabel("m")
        for i, name in enumerate(("east", "north", "up")):
            band(velocity, t, result.v_n[:, i], result.v_sigma[:, i], color=COLOURS[i])
            velocity.lines[-1].set_label(name)
        velocity.set_title("Velocity, ±1σ")
        velocity.set_ylabel("m/s")
        velocity.legend(ncols=3, loc="best")
        turned = np.degrees(np.unwrap(result.euler[:, 0]))
        band(heading, t, turned, np.degrees(result.euler_sigma[:, 0]), color=COLOURS[0])
        heading.set_title("Heading, ±1σ")
        heading.set_ylabel("deg")
        for i, name in ((1, "pitch"), (2, "roll")):
            band(level, t, np.degrees(result.euler[:, i]), np.degrees(result.euler_sigma[:, i]), color=COLOURS[i])
            level.lines[-1].set_label(name)
        level.set_title("Pitch and roll, ±1σ")
        level.set_ylabel("deg")
        level.legend(ncols=2, loc="best")
        _sigmas(position, t, result.position_sigma, "One sigma of position", "m")
        _sigmas(speeds, t, result.v_sigma, "One sigma of velocity", "m/s")
        _innovations(innovations, result, clock)
        for ax in figure.axes[1:]:
            ax.set_xlim(t[0], t[-1])
            ax.tick_params(labelbottom=ax in (velocity, innovations))
        for ax in (velocity, innovations):
            ax.set_xlabel(f"time, {clock.label}")
        figure.align_ylabels([height, velocity])
        figure.align_ylabels([heading, level, position, speeds, innovations])
        smoothed = ", smoothed" if result.smoothed else ""
        figure.suptitle(f"{result.source}: {result.status}{smoothed}", x=0.01, ha="left")
    return figure


def _track(ax: Axes, result: Navigation) -> None:
    scale, unit = track_unit(result)
    rows = evenly(len(result.time))
    for points in ellipses(result):
        ax.plot(*(points / scale).T, color=COLOURS[0], alpha=0.4, linewidth=0.8)
    ax.plot(*(result.displacement[rows] / scale).T, color=COLOURS[0])
    ax.plot(*(result.displacement[0] / scale), marker="o", color=COLOURS[2], linestyle="", label="start")
    ax.plot(*(result.displacement[-1] / scale), marker="s", color=COLOURS[1], linestyle="", label="end")
    ax.set_aspect("equal", adjustable="datalim")
    ax.margins(0.08)
    ax.set_title("Track, one-sigma ellipses")
    ax.set_xlabel(f"east, {unit}")
    ax.set_ylabel(f"north, {unit}")
    ax.legend(loc="best")


def _sigmas(ax: Axes, t: Array, sigma: Array, title: str, unit: str) -> None:
    for i, name in enumerate(("east", "north", "up")):
        if np.median(sigma[:, i]) > HELD * np.nanmedian(sigma):  # a height that is held has a sigma of rounding
            trace(ax, t, sigma[:, i], color=COLOURS[i], label=name)
    ax.set_yscale("log")
    ax.set_title(title)
    ax.set_ylabel(unit)
    ax.margins(y=0.25)
    ax.legend(ncols=3, loc="best")


def _innovations(ax: Axes, result: Navigation, clock: Clock) -> None:
    ax.set_title("Innovations, in σ (crosses: rejected)")
    ax.set_ylabel("sigmas")
    for number, r in enumerate(result.residuals):
        if len(r.time) == 0:
            continue
        ratio = r.innovation / r.sigma
        time, rows = clock(r.time), evenly(len(r.time), 1000)
        colour = COLOURS[number % len(COLOURS)]
        for i in range(3):
            ax.plot(time[rows], ratio[rows, i], linestyle="", marker=".", markersize=2.5, color=colour)
        ax.plot([], [], linestyle="", marker=".", color=colour, label=r.name)
        out = time[~r.used]
        ax.plot(out, np.full(len(out), 4.8), linestyle="", marker="x", markersize=4.0, color=colour)
    for limit, dashes in ((2.0, ":"), (3.0, "--")):
        for sign in (1.0, -1.0):
            ax.axhline(sign * limit, color=REFERENCE, linestyle=dashes, linewidth=1.0)
    ax.set_ylim(-5.0, 5.0)
    if result.residuals:
        ax.legend(ncols=4, loc="lower left", frameon=True, fontsize=7.5)
    else:
        ax.text(0.5, 0.5, "no aiding: free inertial", transform=ax.transAxes, ha="center", va="center")
