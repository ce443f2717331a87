"""Figures of the study: the paper's own four, and convergence from each start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.style import COLOURS, REFERENCE, headed
from truenorth.papers.drawing import marked, sheet
from truenorth.papers.odometer.loop import Errors

Array = NDArray[np.float64]
ARCMIN = np.radians(1.0) / 60.0
SINGLE_METHOD, SINGLE = "sgkf3", 10  # runs drawn one by one
PANELS = (
    ("velocity", "1: velocity, m/s", 1.0, "ENU", (0.5, 0.5, 0.1)),
    ("phi", "2: attitude, arcmin", ARCMIN, "ENU", (1.0, 1.0, 30.0)),
    ("accel_bias", "3: accelerometer bias, ug", MICRO_G, "xyz", (150.0, 150.0, 50.0)),
    ("gyro_bias", "4: gyro bias, deg/h", DEG_PER_HOUR, "xyz", (0.06, 0.06, 0.06)),
)
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
    """Velocity, attitude, accelerometer and gyro bias: signed errors of single runs, and the RMS over all; linear axes."""
    with sheet(12.0, 10.0, 4, 3, sharex=True, legend=4) as (figure, axes):
        for row, (name, title, unit, letters, wide) in zip(axes, PANELS, strict=True):
            for i, ax in enumerate(row):
                limits = (-wide[i], wide[i])
                single = getattr(found[case, SINGLE_METHOD], name)[:SINGLE, :, i] / unit
                time = found[case, SINGLE_METHOD].time
                for k, run in enumerate(single):
                    label = f"single runs, {SHOWN[SINGLE_METHOD]}" if k == 0 else None
                    ax.plot(time, run, color=COLOURS[0], linewidth=0.4, alpha=0.5, label=label)
                for (method, label), colour in zip(SHOWN.items(), COLOURS, strict=False):
                    rms = np.sqrt(np.mean(getattr(found[case, method], name)[:, :, i] ** 2, axis=0)) / unit
                    marked(ax, time, rms, limits, color=colour, linewidth=1.2, label=f"RMS, {label}")
                ax.axhline(0.0, color=REFERENCE, linewidth=0.5)
                ax.set(title=f"{title}, {letters[i]}", xlim=(0.0, time[-1]))
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
        runs = len(found[case, SINGLE_METHOD].phi)
        headed(figure, f"Errors of single runs and RMS over {runs}, from 10 deg of azimuth error")
    return figure


def draw_starts(found: Mapping[tuple[str, str], Errors], angles: Sequence[float]) -> Figure:
    """Median heading error over time from each start."""
    with sheet(12.0, 4.2, 1, len(angles), sharex=True, sharey=True, legend=len(STARTS)) as (figure, axes):
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
    return figure
