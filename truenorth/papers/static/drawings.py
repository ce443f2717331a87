"""Figures of the study: the paper's own, and convergence over many runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.analysis.observability import Observability
from truenorth.errors.stationary import KEPT
from truenorth.figures.style import COLOURS, REFERENCE, new_figure, style
from truenorth.papers.drawing import marked, sheet
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.static.truth import ARCMIN, Truth

Array = NDArray[np.float64]
ANGLES = ("phi E (tilt)", "phi N (tilt)", "phi U (heading)")
METHODS = {
    "ekf": "EKF",
    "ukf": "UKF, tilt after azimuth",
    "ukf_rotation_vector": "UKF, rotation vector",
    "ukf_quaternion": "UKF, quaternion",
    "ekf_passes": "EKF, five passes",
    "gaussian_sum": "twelve EKFs",
    "particle": "particle filter",
    "oba": "optimisation-based",
    "gyrocompass_loop": "gyrocompass loop",
    "product": "truenorth align",
}


def draw_literal(literal: Mapping[int, tuple[Truth, Array, Array]]) -> Figure:
    """Estimates of the three angles in one run of the paper's scenario, ten states above, eight below; signed, linear."""
    heading = "The paper's scenario: P0 = 1e5 I, Q = 0, R = .001, 1000 steps of .02 s"
    with sheet(12.0, 6.5, 2, 3, sharex=True, heading=heading, legend=3) as (figure, axes):
        for row, (states, (truth, x, sigma)) in zip(axes, literal.items(), strict=True):
            true = (truth.phi if states == 10 else truth.phi_platform)[0]
            for axis, ax in enumerate(row):
                limits = (-30.0, 50.0) if axis < 2 else (-400.0, 400.0)
                marked(
                    ax, truth.time, x[0, :, axis] / ARCMIN, limits, color=COLOURS[0], linewidth=0.8, label="estimate"
                )
                ax.plot(truth.time, true[:, axis] / ARCMIN, "--", color=REFERENCE, label="truth")
                own = f"its own sigma at the end: {np.degrees(sigma[-1, axis]):.0f} deg"
                ax.text(
                    0.98,
                    0.04,
                    own,
                    transform=ax.transAxes,
                    ha="right",
                    fontsize=9,
                    bbox={"facecolor": "white", "lw": 0},
                )
                ax.set_title(f"{ANGLES[axis]}, {states} states")
            row[0].set_ylabel("arcmin")
        for ax in axes[1]:
            ax.set_xlabel("time, s")
    return figure


def draw_convergence(
    times: Sequence[float], found: Mapping[tuple[str, int], list[AttitudeErrors]], runs: int
) -> Figure:
    """RMS of heading and level over time in every case, compared with the claimed sigma."""
    cases = list(dict.fromkeys(case for case, _ in found))
    heading = f"Honest comparison, {runs} runs of each case"
    with sheet(3.0 * len(cases) + 0.6, 6.5, 2, len(cases), sharex=True, sharey="row", heading=heading, legend=4) as (
        figure,
        axes,
    ):
        for column, case in enumerate(cases):
            for states, colour in ((10, COLOURS[0]), (8, COLOURS[1])):
                errors = found[case, states]
                for row, part in ((0, slice(2, 3)), (1, slice(0, 2))):
                    ax = axes[row, column]
                    rms, sigma = (
                        [np.sqrt(np.mean(getattr(e, name)[:, part] ** 2)) / ARCMIN for e in errors]
                        for name in ("phi", "sigma")
                    )
                    ax.plot(times, rms, "o-", markersize=3, color=colour, label=f"{states} states, RMS")
                    ax.plot(times, sigma, "--", linewidth=1.0, color=colour, label=f"{states} states, sigma")
            axes[0, column].set(title=case.replace("_", " "), xscale="log", yscale="log")
            axes[1, column].set(yscale="log", xlabel="time, s")
            axes[1, column].set_xticks(times, [f"{t:g}" for t in times])
            axes[1, column].minorticks_off()
            for ax in axes[:, column]:
                ax.margins(x=0.06)
        axes[0, 0].set_ylabel("heading, arcmin")
        axes[1, 0].set_ylabel("level, arcmin")
    return figure


def draw_degrees(seen: Mapping[tuple[str, int], Observability]) -> Figure:
    """Degrees of each direction, and the part of its prior sigma that each state keeps."""
    with sheet(12.0, 4.6, 1, 2, legend=4) as (figure, (left, right)):
        width = 0.8 / len(seen)
        for number, ((case, states), result) in enumerate(seen.items()):
            colour = COLOURS[number]
            label = f"{case.replace('_', ' ')}, {states} states"
            seen_at_all = np.maximum(result.degrees, 1e-4)
            left.plot(np.arange(1, states + 1), seen_at_all, "o-", color=colour, label=label)
            at = np.arange(10)[KEPT[states]] + (number - 0.5 * (len(seen) - 1)) * width
            right.bar(at, result.sigma_ratio, width, color=colour)
        left.axhline(1.0, color=REFERENCE, linestyle="--", linewidth=1.0)
        left.set(
            yscale="log", xlabel="direction, best seen first", ylabel="degree (below 1e-4 drawn there)", title="Degrees"
        )
        left.margins(x=0.04)
        names = max((result.names for result in seen.values()), key=len)
        right.set_xticks(range(len(names)), names, rotation=45)
        right.set(ylabel="sigma after 600 s / prior sigma", title="What each state keeps")
        right.margins(x=0.02)
    return figure


def draw_large(found: Mapping[str, tuple[Array, Array | None]], duration: float) -> Figure:
    """Heading error of every run by method."""
    with style():
        figure = new_figure(10.0, 5.0)
        ax = figure.subplots()
        for row, (phi, _) in enumerate(found.values()):
            heading = np.abs(phi[:, 2]) / ARCMIN
            spread = row + 0.5 * (np.arange(len(heading)) / len(heading) - 0.5)
            ax.plot(np.maximum(heading, 0.01), spread, ".", markersize=3, color=COLOURS[row % len(COLOURS)])
            rms = float(np.sqrt(np.mean(heading**2)))
            size = f"{rms:.2f}'" if rms < 60 else f"{rms / 60:.1f} deg"
            ax.text(1.02, row, f"{np.mean(heading <= 60):.0%}, {size}", transform=ax.get_yaxis_transform(), va="center")
        ax.axvline(60.0, color=REFERENCE, linestyle="--", linewidth=1.0)
        ax.set_yticks(range(len(found)), [METHODS[name] for name in found])
        ax.invert_yaxis()
        ax.set(xscale="log", xlabel=f"heading error after {duration:.0f} s, arcmin", xlim=(0.008, 180 * 60))
        ax.set_title(f"From any azimuth, {len(next(iter(found.values()))[0])} runs; right: share below 1 deg, RMS")
    return figure
