"""Figures of the study: the paper's own, its tables as graphs, spectra, eigenvalues, switching, and many voyages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from truenorth.damping.loop import Mode
from truenorth.damping.spectrum import spectrum
from truenorth.errors.marine import DV
from truenorth.figures.style import COLOURS, REFERENCE, trace
from truenorth.papers.damping.methods import SWITCH, Case
from truenorth.papers.damping.statistics import Signs
from truenorth.papers.damping.switching import SETTLED, WAYS
from truenorth.papers.damping.truth import HOUR
from truenorth.papers.drawing import sheet

Array = NDArray[np.float64]

NAMES = {
    "undamped": "undamped",
    "network_internal": "internal network",
    "network_external": "external network",
    "filter1": "filter 1",
    "filter2": "filter 2",
    "filter2_raw": "filter 2, raw reference",
    "fused": "fused",
    "fused_tuned": "fused, tuned",
    "augmented": "15 states",
    "augmented_long": "15 states, long-run",
}
PAPERS = {name: NAMES[name] for name in ("filter1", "filter2", "fused")}
DRAWN = ("filter1", "filter2", "fused", "augmented_long")
PANELS = {
    "attitude": ((0, "phi E, deg"), (1, "phi N, deg"), (2, "phi U (heading), deg")),
    "position": ((5, "latitude, deg"), (6, "longitude, deg")),
    "velocity": ((3, "east, m/s"), (4, "north, m/s")),
}


def draw_errors(case: Case, kind: Literal["attitude", "position", "velocity"]) -> Figure:
    """Errors of the filters over time, in the paper's manner; the undamped INS behind them."""
    panels = PANELS[kind]
    t = case.time / HOUR
    heading = f"{kind.capitalize()} errors, log error -.3 m/s"
    with sheet(9.0, 2.3 * len(panels) + 0.8, len(panels), 1, sharex=True, heading=heading, legend=5) as (figure, axes):
        for (column, label), ax in zip(panels, axes, strict=True):
            scale = 1.0 if kind == "velocity" else np.degrees(1.0)
            free = case.errors["undamped"][:, column] * scale
            trace(ax, t, free, color="#BBBBBB", linewidth=0.7, label="undamped")
            largest = 0.0
            for number, method in enumerate(DRAWN):
                values = case.errors[method][:, column] * scale
                on = case.time > SWITCH
                trace(ax, t[on], values[on], color=COLOURS[number], label=NAMES[method])
                largest = max(largest, np.abs(values[case.time > SWITCH + HOUR]).max())
            ax.set_ylim(-1.15 * largest, 1.15 * largest)
            ax.set_ylabel(label)
        axes[-1].set_xlabel("time, h")
        axes[-1].set_xticks(range(0, 49, 6))
    return figure


def draw_tables(ours: Mapping[str, Array], theirs: Mapping[str, Array], logs: Sequence[float]) -> Figure:
    """All seven columns of tables 1 and 2: errors (C, 7) at 20 h over the log's error, ours and the paper's."""
    order = (
        (0, "phi E, 1e-3 deg", 1e3),
        (1, "phi N, 1e-3 deg", 1e3),
        (2, "phi U (heading), deg", 1.0),
        (5, "latitude, deg", 1.0),
        (6, "longitude, deg", 1.0),
        (3, "v east, m/s", 1.0),
        (4, "v north, m/s", 1.0),
    )
    with sheet(12.0, 6.2, 2, 4, sharex=True, heading="Tables 1 and 2: errors at 20 h", legend=4) as (figure, axes):
        axes = axes.ravel()
        for ax, (column, label, scale) in zip(axes, order, strict=False):
            for number, method in enumerate(ours):
                for values, mark, whose in ((ours, "o-", "ours"), (theirs, "x--", "paper")):
                    ax.plot(
                        logs,
                        scale * values[method][:, column],
                        mark,
                        markersize=5,
                        linewidth=1.0 if whose == "ours" else 0.8,
                        color=COLOURS[number],
                        label=f"{NAMES[method]}, {whose}",
                    )
            ax.set_title(label)
            ax.margins(x=0.06)
        for ax in axes[3:7]:
            ax.set_xlabel("log error, m/s")
            ax.tick_params(labelbottom=True)
        axes[7].set_visible(False)
    return figure


def draw_windows(signs: Signs, runs: int) -> Figure:
    """RMS of heading and latitude over runs against time, hour by hour."""
    with sheet(10.0, 4.0, 1, 2, heading=f"{runs} voyages, all errors with random signs", legend=6) as (figure, axes):
        edges = np.arange(3, 49)
        for ax, (column, label) in zip(axes, ((2, "heading, deg"), (5, "latitude, deg")), strict=True):
            for number, method in enumerate(
                ("filter1", "filter2", "fused", "fused_tuned", "augmented", "augmented_long")
            ):
                rms = []
                for hour in edges[:-1]:
                    window = (signs.time >= hour * HOUR) & (signs.time < (hour + 1) * HOUR)
                    rms.append(np.degrees(np.sqrt(np.mean(signs.errors[method][:, window, column] ** 2))))
                ax.plot(edges[:-1] + 0.5, rms, color=COLOURS[number], label=NAMES[method])
            ax.set(yscale="log", xlabel="time, h", title=f"RMS of {label}")
            if column == 2:
                ax.set_yticks([0.03, 0.05, 0.1, 0.2])
            ax.yaxis.set_major_formatter("{x:g}")
            ax.yaxis.set_minor_formatter(NullFormatter())
            ax.set_xticks(range(0, 49, 12))
    return figure


def draw_spectra(case: Case) -> Figure:
    """Amplitude of the velocity error over period, both senses of turning."""
    settled = case.time >= SWITCH + 3.0 * HOUR
    with sheet(10.0, 4.0, 1, 2, sharey=True, legend=4) as (figure, axes):
        for number, method in enumerate(("undamped", "network_external", "filter1", "fused")):
            dv = case.errors[method][settled][:, DV]
            found = spectrum(dv[:, 0] + 1j * dv[:, 1], case.course.interval)
            for ax, sign in zip(axes, (1.0, -1.0), strict=True):
                f = sign * found.frequency
                band = (f > 1.0 / (40.0 * HOUR)) & (f < 1.0 / (30.0 * 60.0))
                ax.plot(1.0 / f[band] / 60.0, found.amplitude[band], color=COLOURS[number], label=NAMES[method])
        for ax, title in zip(axes, ("anticlockwise", "clockwise"), strict=True):
            ax.set(xscale="log", yscale="log", xlabel="period, min", title=title, ylim=(1e-4, 3.0))
            ax.set_xticks([30, 60, 84.4, 180, 720, 1440], ["30", "60", "84", "180", "720", "1440"])
            ax.minorticks_off()
        axes[0].set_ylabel("velocity amplitude, m/s")
    return figure


def draw_eigenvalues(loops: Mapping[str, Sequence[Mode]], filters: Mapping[str, Sequence[Mode]]) -> Figure:
    """Eigenvalues in the s plane: about the Schuler rate, and about the earth's."""
    markers = "osD^v<"
    with sheet(10.0, 4.6, 1, 2, legend=6) as (figure, axes):
        for number, (name, modes) in enumerate([*loops.items(), *filters.items()]):
            s = np.array([m.eigenvalue for m in modes if abs(m.eigenvalue) > 2e-6])
            label = NAMES.get(name, name)
            for ax, scale in zip(axes, (1e3, 1e5), strict=True):
                ax.plot(
                    s.real * scale,
                    s.imag * scale,
                    markers[number],
                    markersize=6,
                    markerfacecolor="none",
                    color=COLOURS[number],
                    label=label,
                )
        axes[0].set(
            xlim=(-6.0, 0.5), ylim=(-0.2, 6.0), title="Schuler", xlabel="real, 1e-3/s", ylabel="imaginary, 1e-3 rad/s"
        )
        axes[1].set(
            xlim=(-20.0, 1.5),
            ylim=(-0.5, 9.0),
            title="Earth (24 h)",
            xlabel="real, 1e-5/s",
            ylabel="imaginary, 1e-5 rad/s",
        )
        for ax in axes:
            ax.axvline(0.0, color=REFERENCE, linewidth=0.8)
    return figure


def draw_switching(case: Case, switched: Mapping[str, Array]) -> Figure:
    """Size of the velocity error about the switch."""
    at = SWITCH + SETTLED
    window = (case.time > at - 2.0 * HOUR) & (case.time < at + 8.0 * HOUR)
    t = (case.time[window] - at) / HOUR
    with sheet(9.0, 4.2, legend=3) as (figure, ax):
        free = np.linalg.norm(case.errors["undamped"][window, DV], axis=1)
        trace(ax, t, free, color="#BBBBBB", label="undamped")
        for number, (name, v) in enumerate(switched.items()):
            trace(ax, t, np.linalg.norm(v[window], axis=1), color=COLOURS[number], label=WAYS[name])
        ax.axvline(0.0, color=REFERENCE, linewidth=0.8)
        ax.set(xlabel="hours after the switch", ylabel="velocity error, m/s", ylim=(0.0, None))
    return figure
