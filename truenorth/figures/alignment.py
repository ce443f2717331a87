"""The figure of an alignment: convergence of the angles, their sigmas, biases, innovations and NIS."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.convergence import NIS_BLOCK, Course, averaged_nis, courses, settled_limits
from truenorth.figures.style import AXES_NAMES, COLOURS, REFERENCE, band, new_figure, style, trace
from truenorth.figures.units import Clock

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from truenorth.alignment.result import Alignment, History

Array = NDArray[np.float64]


def plot_alignment(result: Alignment) -> Figure:
    """Draw convergence with one-sigma bands and floors, sigmas, biases, innovations over their sigmas, and NIS.

    Raises
    ------
    ValueError
        The method kept no history.
    """
    h = result.history
    if h is None:
        raise ValueError(f"method {result.method!r} gives one answer and keeps no history to draw")
    angles = courses(result)
    clock = Clock.of(h.time)
    t = clock(h.time)
    with style():
        figure = new_figure(12.0, 10.5)
        columns = figure.add_gridspec(1, 2)
        left, right = columns[0].subgridspec(len(angles) + 1, 1), columns[1].subgridspec(4, 1)
        convergence = [figure.add_subplot(left[i]) for i in range(len(angles))]
        nis = figure.add_subplot(left[len(angles)])
        sigmas, gyro, accel, innovations = (figure.add_subplot(right[i]) for i in range(4))

        for i, (ax, course) in enumerate(zip(convergence, angles)):
            _converge(ax, t, course, COLOURS[i])
        convergence[0].set_title("Attitude as known at each time, ±1σ (dark: floor)")
        _sigmas(sigmas, t, angles)
        _biases(gyro, t, h.gyro_bias / DEG_PER_HOUR, h.gyro_bias_sigma / DEG_PER_HOUR)
        gyro.set_title("Gyro bias, ±1σ")
        gyro.set_ylabel("deg/h")
        gyro.legend(ncols=3, loc="upper right")
        _biases(accel, t, h.accel_bias / MICRO_G, h.accel_bias_sigma / MICRO_G)
        accel.set_title("Accelerometer bias, ±1σ")
        accel.set_ylabel("µg")
        _innovations(innovations, h, t)
        _nis(nis, h, clock)
        for ax in figure.axes:
            ax.set_xlim(t[0], t[-1])
            ax.tick_params(labelbottom=ax in (nis, innovations))
        for ax in (nis, innovations):
            ax.set_xlabel(f"time, {clock.label}")
        figure.suptitle(f"{result.source}: {result.status}, method {result.method}", x=0.01, ha="left")
    return figure


def _converge(ax: Axes, t: Array, course: Course, colour: str) -> None:
    value, sigma, floor = (np.degrees(x) for x in (course.value, course.sigma, course.floor))
    band(ax, t, value, sigma, color=colour)
    band(ax, t, value, floor, color=colour)
    ax.set_ylim(*settled_limits(value, sigma))
    ax.set_ylabel(f"{course.name}, deg")


def _sigmas(ax: Axes, t: Array, angles: list[Course]) -> None:
    for colour, course in zip(COLOURS, angles):
        trace(ax, t, 60 * np.degrees(course.sigma), color=colour, label=course.name)
        trace(ax, t, 60 * np.degrees(course.floor), color=colour, linestyle=":")
    ax.set_yscale("log")
    ax.set_ylim(bottom=0.5 * 60 * np.degrees(min(course.floor[-1] for course in angles)))
    ax.set_title("One sigma (dotted: floor, waiting does not help)")
    ax.set_ylabel("arcmin")
    ax.legend(ncols=3, loc="upper right")


def _biases(ax: Axes, t: Array, bias: Array, sigma: Array) -> None:
    for axis, colour in enumerate(COLOURS[:3]):
        band(ax, t, bias[:, axis], sigma[:, axis], color=colour)
        ax.lines[-1].set_label(AXES_NAMES[axis])
    limits = [settled_limits(bias[:, axis], sigma[:, axis]) for axis in range(3)]
    ax.set_ylim(min(low for low, _ in limits), max(high for _, high in limits))


def _innovations(ax: Axes, h: History, t: Array) -> None:
    for axis in h.components:
        ratio = h.innovation[:, axis] / h.innovation_sigma[:, axis]
        trace(ax, t, ratio, color=COLOURS[axis], label=h.innovation_axes[axis], linewidth=0.8)
    for level, dashes in ((2.0, ":"), (3.0, "--")):
        for sign in (1.0, -1.0):
            ax.axhline(sign * level, color=REFERENCE, linestyle=dashes, linewidth=1.0)
    ax.set_ylim(-5.0, 5.0)
    ax.set_title(f"Innovations of {h.innovation_of}, in σ")
    ax.set_ylabel("sigmas")
    ax.legend(ncols=3, loc="upper right")


def _nis(ax: Axes, h: History, clock: Clock) -> None:
    t, mean, low, high = averaged_nis(h)
    trace(ax, clock(t), mean, color=COLOURS[0], marker=".", markersize=3.0)
    ax.axhspan(low, high, color=REFERENCE, alpha=0.12, linewidth=0.0)
    ax.set_ylim(0.0, max(1.3 * high, float(np.quantile(mean, 0.98)) if mean.size else 0.0))
    ax.set_title(f"NIS, mean of {NIS_BLOCK} epochs (grey: 95 % band)")
    ax.set_ylabel("NIS")
