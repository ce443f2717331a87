"""Figures of the study: the paper's four, and level over time in every manoeuvre."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.units import DEG_PER_HOUR
from truenorth.figures.style import COLOURS, REFERENCE, new_figure, style
from truenorth.papers.transfer.filtering import EPOCHS, Errors
from truenorth.papers.transfer.truth import ARCMIN, BEGIN, STOP

Array = NDArray[np.float64]
SINGLE = 10  # runs drawn one by one
LINEAR = 10.0  # arcmin: beyond, the scale is logarithmic where the limits are wider


def draw_misalignment(errors: Errors, title: str) -> Figure:
    """The paper's figures 1 and 3: misalignment east, north and up over time."""
    names = ("phi E (tilt)", "phi N (tilt)", "phi U (heading)")
    return _draw(errors.phi / ARCMIN, errors.phi_sigma / ARCMIN, names, "arcmin", (4.0, 4.0, 100.0), title)


def draw_biases(errors: Errors, title: str) -> Figure:
    """The paper's figures 2 and 4: gyro biases over time."""
    names = ("x gyro", "y gyro", "z gyro")
    return _draw(errors.gyro / DEG_PER_HOUR, errors.gyro_sigma / DEG_PER_HOUR, names, "deg/h", (3.0, 3.0, 3.0), title)


def _draw(values: Array, sigmas: Array, names: Sequence[str], unit: str, limits: Sequence[float], title: str) -> Figure:
    with style():
        figure = new_figure(10.0, 7.5)
        axes = figure.subplots(3, 1, sharex=True)
        for i, ax in enumerate(axes):
            for k, run in enumerate(values[:SINGLE, :, i]):
                ax.plot(
                    EPOCHS, run, color=COLOURS[0], linewidth=0.5, alpha=0.5, label="single runs" if k == 0 else None
                )
            rms, sigma = (np.sqrt(np.mean(x[:, :, i] ** 2, axis=0)) for x in (values, sigmas))
            ax.plot(EPOCHS, rms, color=COLOURS[1], label=f"RMS of {len(values)} runs")
            for sign in (1.0, -1.0):
                ax.plot(EPOCHS, sign * sigma, "--", color=REFERENCE, linewidth=1.0, label="sigma" if sign > 0 else None)
            ax.axvspan(BEGIN, STOP, color=REFERENCE, alpha=0.08, linewidth=0.0, label="turn")
            if limits[i] > LINEAR:
                ax.set_yscale("symlog", linthresh=LINEAR)
                ax.set_yticks([-100.0, -10.0, 0.0, 10.0, 100.0], ["-100", "-10", "0", "10", "100"])
            ax.set_ylim(-limits[i], limits[i])
            ax.set_ylabel(f"{names[i]}, {unit}")
            ax.margins(x=0.0)
        axes[-1].set_xlabel("time, s")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
        figure.suptitle(title, x=0.01, ha="left")
    return figure


def draw_level(found: Mapping[tuple[str, str], Errors], cases: Sequence[str]) -> Figure:
    """RMS of both tilts over time in every manoeuvre, velocity matching above, with attitude below."""
    with style():
        figure = new_figure(3.0 * len(cases) + 0.6, 6.5)
        axes = figure.subplots(2, len(cases), sharex=True, sharey="row")
        methods = ("states12", "states13", "states16", "oracle")
        for column, case in enumerate(cases):
            for row, suffix in enumerate(("", "_att")):
                ax = axes[row, column]
                for method, colour in zip(methods, COLOURS):
                    phi = found[case, method + suffix].phi[..., :2]
                    rms = np.sqrt(np.mean(phi**2, axis=(0, 2))) / ARCMIN
                    told = method == "oracle"
                    label = "delay and arm known" if told else f"{method.removeprefix('states')} states"
                    ax.plot(EPOCHS, rms, "--" if told else "-", color=REFERENCE if told else colour, label=label)
                ax.axvspan(BEGIN, STOP, color=REFERENCE, alpha=0.08, linewidth=0.0)
                ax.set(yscale="log", ylim=(0.08, 12.0))
                ax.margins(x=0.0)
            axes[0, column].set_title(case.replace("_", " "))
            axes[1, column].set_xlabel("time, s")
        axes[0, 0].set_ylabel("velocity: level, arcmin")
        axes[1, 0].set_ylabel("with attitude: level, arcmin")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=4)
        figure.suptitle("Level error, RMS over the runs (grey: manoeuvre)", x=0.01, ha="left")
    return figure
