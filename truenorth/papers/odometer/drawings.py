"""Figures of the study: the paper's own four, and convergence from each start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.style import COLOURS, REFERENCE, headed, new_figure, style
from truenorth.papers.odometer.loop import Errors

Array = NDArray[np.float64]
ARCMIN = np.radians(1.0) / 60.0
SHOWN = {"sgkf3": "SGKF (order 3)", "ckf": "CKF", "invariant_ekf": "invariant EKF"}
STARTS = {
    "invariant_ekf": "invariant EKF",
    "ekf": "EKF",
    "ckf": "CKF",
    "gh3": "GH3",
    "gh7": "GH7",
    "sgkf3": "SGKF3",
}


def draw_paper_figures(found: Mapping[tuple[str, str], Errors], case: str) -> Figure:
    """RMS over runs of velocity, attitude, accelerometer and gyro bias errors."""
    panels = (
        ("velocity", "1: velocity, m/s", 1.0, "ENU"),
        ("phi", "2: attitude, arcmin", ARCMIN, "ENU"),
        ("accel_bias", "3: accelerometer bias, ug", MICRO_G, "xyz"),
        ("gyro_bias", "4: gyro bias, deg/h", DEG_PER_HOUR, "xyz"),
    )
    with style():
        figure = new_figure(12.0, 10.0)
        axes = figure.subplots(4, 3, sharex=True)
        for row, (name, title, unit, letters) in zip(axes, panels, strict=True):
            for i, ax in enumerate(row):
                for (method, label), colour in zip(SHOWN.items(), COLOURS, strict=False):
                    errors = found[case, method]
                    rms = np.sqrt(np.mean(getattr(errors, name)[:, :, i] ** 2, axis=0)) / unit
                    ax.plot(errors.time, rms, color=colour, linewidth=1.0, label=label)
                ax.set(title=f"{title}, {letters[i]}", yscale="linear" if name == "gyro_bias" else "log")
                ax.set_xlim(0.0, errors.time[-1])
                if name == "gyro_bias":
                    ax.set_ylim(0.0, None)
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
        runs = len(found[case, "ckf"].phi)
        headed(figure, f"RMS errors over {runs} runs, from 10 deg of azimuth error")
    return figure


def draw_starts(found: Mapping[tuple[str, str], Errors], angles: Sequence[float]) -> Figure:
    """Median heading error over time from each start."""
    with style():
        figure = new_figure(12.0, 4.2)
        axes = figure.subplots(1, len(angles), sharex=True, sharey=True)
        for ax, angle in zip(axes, angles, strict=True):
            for (method, label), colour in zip(STARTS.items(), COLOURS, strict=False):
                errors = found[f"start{angle:g}", method]
                ax.plot(
                    errors.time,
                    np.median(np.abs(errors.phi[:, :, 2]), axis=0) / ARCMIN,
                    color=colour,
                    linewidth=1.8 if method == "invariant_ekf" else 1.0,
                    label=label,
                )
            ax.axhline(60.0, color=REFERENCE, linestyle="--", linewidth=0.8)
            ax.set(title=f"start {angle:g} deg off", yscale="log", xlabel="time, s")
        axes[0].set_ylabel("heading error, median, arcmin")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=len(STARTS))
    return figure
