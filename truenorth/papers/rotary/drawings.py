"""Figures of the study: modulated biases, coarse errors by run, convergence of the filters, and errors compared with sigmas."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.indexing import C_bs_from_angles
from truenorth.figures.style import COLOURS, REFERENCE, headed, new_figure, style
from truenorth.papers.drawing import marked, sheet
from truenorth.papers.rotary.truth import AXES, INDEXER_RATES

Array = NDArray[np.float64]
ARCMIN = np.radians(1.0) / 60.0
PHI_NAMES = ("phi E", "phi N", "phi U")
COARSE_AXES = ((-0.3, 0.3), (-0.3, 0.3), (-6.0, 6.0))  # deg
LABELS = {
    "kf": "KF",
    "sakf_r": "SAKF, factor on R (the paper's)",
    "sakf": "SAKF, factor on P (ours)",
    "makf": "MAKF",
    "imakf": "IMAKF",
}
PAPER_COARSE = np.array([[0.0287, -0.0419, 0.1506], [0.0740, 0.1563, 1.4611], [-0.0986, -0.2668, -0.1044]])


def modulated(time: Array, bias: Array) -> Array:
    """A constant bias of the IMU seen in the body, (K, 3): the paper's eqs. 8 and 9."""
    C_bs = C_bs_from_angles(AXES, time[:, None] * np.array(INDEXER_RATES))
    return C_bs @ bias


def draw_modulation() -> Figure:
    """Gyro and accelerometer biases in the body over two turns of the slower axis, and their integrals."""
    time = np.linspace(0.0, 120.0, 1201)
    heading = "Rotation modulation, w1 = 18 deg/s about x, w2 = 6 deg/s about z (eqs. 8, 9)"
    with sheet(10.0, 6.0, 2, 2, sharex=True, heading=heading, legend=4) as (figure, axes):
        for column, (size, unit, name, whole) in enumerate(
            ((0.01, "deg/h", "gyro", "arcsec"), (100.0, "ug", "accelerometer", "mm/s"))
        ):
            values = modulated(time, np.full(3, size))
            scale = 1.0 if column == 0 else 9.80665e-3  # deg/h s is an arcsec; 1 ug s is 9.8e-3 mm/s
            still = np.full(3, size)
            for axis, colour in zip(range(3), COLOURS, strict=False):
                axes[0, column].plot(time, values[:, axis], color=colour, linewidth=1.0, label="xyz"[axis])
                total = np.cumsum(values[:, axis]) * (time[1] - time[0]) * scale
                axes[1, column].plot(time, total, color=colour, linewidth=1.0, label="xyz"[axis])
            axes[1, column].plot(time, still[0] * scale * time, "--", color=REFERENCE, label="without rotation")
            axes[0, column].set(title=f"{name} bias in the body", ylabel=unit)
            axes[1, column].set(title="its integral", ylabel=whole, xlabel="time, s")
    return figure


def draw_coarse(errors: Mapping[str, Array]) -> Figure:
    """Misalignment at the end of coarse alignment by run (deg), with the paper's mean and range; linear, as there."""
    with sheet(12.0, 4.2, 1, 3, heading="Coarse alignment, 120 s, configuration A", legend=5) as (figure, axes):
        for axis, ax in enumerate(axes):
            for (method, phi), colour in zip(errors.items(), COLOURS, strict=False):
                count = np.arange(1.0, len(phi) + 1.0)
                size, inside = (7, "none") if method == "dual_vector" else (3, colour)
                label = method.replace("_", " ")
                options = {"markersize": size, "markerfacecolor": inside, "linestyle": "none"}
                marked(
                    ax,
                    count,
                    np.degrees(phi[:, axis]),
                    COARSE_AXES[axis],
                    marker="o",
                    color=colour,
                    label=label,
                    **options,
                )
            ax.axhspan(
                *sorted(PAPER_COARSE[1:, axis]), color=REFERENCE, alpha=0.15, linewidth=0, label="the paper's range"
            )
            ax.axhline(PAPER_COARSE[0, axis], color=REFERENCE, linestyle="--", label="the paper's mean")
            ax.set(title=f"{PHI_NAMES[axis]}, deg", xlabel="run")
            ax.set_xlim(0.0, len(count) + 1.0)
            ax.xaxis.get_major_locator().set_params(integer=True)
    return figure


def draw_filters(curves: Mapping[str, Mapping[str, Array]], titles: Mapping[str, str]) -> Figure:
    """The paper's figure 4: signed errors (arcmin) of the first run; a row a start, a column an angle."""
    cases = ("A", "A_max_start")
    heading = "Fine alignment by the paper's filters, one run; dotted: the 250 s within which it says they converge"
    with sheet(12.0, 6.5, len(cases), 3, sharex=True, heading=heading, legend=5) as (figure, axes):
        for row, case in zip(axes, cases, strict=True):
            for axis, ax in enumerate(row):
                for (method, phi), colour in zip(curves[case].items(), COLOURS, strict=False):
                    if method == "sakf":  # ours: it would cover the four of the paper
                        continue
                    time = np.arange(1.0, phi.shape[1] + 1.0)
                    dashed = "--" if method == "imakf" else "-"
                    limits = (-5.0, 5.0) if axis < 2 else (-60.0, 60.0)
                    marked(
                        ax,
                        time,
                        phi[0, :, axis] / ARCMIN,
                        limits,
                        color=colour,
                        linestyle=dashed,
                        linewidth=1.0,
                        label=LABELS[method],
                    )
                ax.axvline(250.0, color=REFERENCE, linewidth=0.8, linestyle=":")
                ax.set_title(f"{PHI_NAMES[axis]}, {titles[case]}", fontsize=9)
            row[0].set_ylabel("error, arcmin")
        for ax in axes[-1]:
            ax.set_xlabel("time of fine alignment, s")
    return figure


def draw_convergence(curves: Mapping[str, Mapping[str, Array]], titles: Mapping[str, str]) -> Figure:
    """RMS over the runs of the misalignment (arcmin) against the time of fine alignment; a row a case, a column an angle."""
    with sheet(12.0, 2.9 * len(curves) + 0.7, len(curves), 3, sharex=True, squeeze=False, legend=5) as (figure, axes):
        for row, (case, methods) in zip(axes, curves.items(), strict=True):
            for axis, ax in enumerate(row):
                for (method, phi), colour in zip(methods.items(), COLOURS, strict=False):
                    rms = np.sqrt(np.mean(phi[:, :, axis] ** 2, axis=0)) / ARCMIN
                    dashed = "--" if method == "imakf" else "-"
                    ax.plot(np.arange(1, len(rms) + 1), rms, dashed, color=colour, linewidth=1.1, label=LABELS[method])
                ax.axvline(250.0, color=REFERENCE, linewidth=0.8, linestyle=":")
                ax.set_yscale("log")
                ax.set_title(f"{PHI_NAMES[axis]}, {titles[case]}", fontsize=9)
            row[0].set_ylabel("RMS, arcmin")
        for ax in axes[-1]:
            ax.set_xlabel("time of fine alignment, s")
        runs = len(next(iter(next(iter(curves.values())).values())))
        headed(figure, f"Fine alignment by the paper's filters, RMS over {runs} runs")
    return figure


def draw_honesty(points: Sequence[tuple[str, float, float, float]]) -> Figure:
    """Heading: RMS of the errors against the claimed sigma; of (case, time s, RMS, sigma) in arcmin."""
    cases = list(dict.fromkeys(case for case, *_ in points))
    markers = {120.0: "o", 250.0: "s", 600.0: "^"}
    with style():
        figure = new_figure(6.5, 6.0)
        ax = figure.subplots()
        low, high = min(min(p[2:]) for p in points) / 1.6, max(max(p[2:]) for p in points) * 1.6
        line = np.array([low, high])
        ax.plot(line, line, color=REFERENCE, label="RMS = sigma")
        ax.fill_between(line, line * 0.85, line * 1.2, color=REFERENCE, alpha=0.15, linewidth=0)
        for case, time, rms, sigma in points:
            label = case.replace("_", " ") if time == max(t for c, t, *_ in points if c == case) else None
            colour = COLOURS[cases.index(case) % len(COLOURS)]
            ax.plot(sigma, rms, markers.get(time, "d"), color=colour, label=label, linestyle="none")
        ax.set(
            xscale="log", yscale="log", xlabel="sigma that the filter claims, arcmin", ylabel="RMS of heading, arcmin"
        )
        ax.set_title("Coloured-noise filter: circles 120 s, squares 250 s, triangles 600 s", fontsize=10)
        ax.legend(loc="upper left")
    return figure
