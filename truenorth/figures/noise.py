"""Allan deviation of a log at rest, and the fit through it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from truenorth.figures.inspection import draw_allan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from truenorth.quality import Inspection


def plot_noise(inspection: Inspection) -> Figure:
    """Measured points with their one-sigma, and the fitted model, of gyros and accelerometers."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    gyro, accel = figure.subplots(1, 2)
    draw_allan(gyro, inspection.gyro_noise, f"{inspection.source}: gyros", "deg/h")
    draw_allan(accel, inspection.accel_noise, "accelerometers", "ug")
    return figure
