"""Allan deviation of a log at rest, and the fit through it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from truenorth.figures.inspection import COLOURS, draw_allan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from truenorth.quality import Inspection


def plot_noise(inspection: Inspection) -> Figure:
    """Measured points with their one-sigma, and the fitted model, of gyros and accelerometers."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    gyro, accel = figure.subplots(1, 2)
    figure.suptitle(f"{inspection.source}: Allan deviation (points, one sigma) and fit (lines)")
    draw_allan(gyro, inspection.gyro_noise, "gyros", "deg/h")
    draw_allan(accel, inspection.accel_noise, "accelerometers", "ug")
    axes = [
        Line2D([], [], color=colour, marker="o", markersize=3.5, label=name)
        for colour, name in zip(COLOURS, "xyz", strict=False)
    ]
    figure.legend(handles=axes, loc="outside lower center", ncols=3, frameon=False)
    return figure
