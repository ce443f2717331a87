"""Figures of the study: the paper's four, and level over time in every manoeuvre, by what is matched and when it comes late."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.units import DEG_PER_HOUR
from truenorth.figures.style import COLOURS, REFERENCE
from truenorth.papers.drawing import marked, sheet
from truenorth.papers.transfer.filtering import EPOCHS, Errors
from truenorth.papers.transfer.truth import ARCMIN, BEGIN, STOP

Array = NDArray[np.float64]
SINGLE = 10  # runs drawn one by one
STATES = {"states12": "12 states", "states13": "13 states", "states16": "16 states", "oracle": "delay and arm known"}


def draw_misalignment(errors: Errors, title: str) -> Figure:
    """The paper's figures 1 and 3: misalignment east, north and up over time."""
    names = ("phi E (tilt)", "phi N (tilt)", "phi U (heading)")
    phi, sigma = errors.phi / ARCMIN, errors.sigma / ARCMIN
    return _draw(phi[0], None, phi, sigma, names, "arcmin", (60.0, 60.0, 120.0), (4.0, 4.0, 10.0), title)


def draw_biases(errors: Errors, title: str) -> Figure:
    """The paper's figures 2 and 4: gyro biases over time."""
    names = ("x gyro", "y gyro", "z gyro")
    error, sigma, true = (x / DEG_PER_HOUR for x in (errors.gyro, errors.gyro_sigma, errors.gyro_bias))
    return _draw(error[0] + true[0], true[0], error, sigma, names, "deg/h", (3.0,) * 3, (3.0,) * 3, title)


def _draw(
    one: Array,
    true: Array | None,
    values: Array,
    sigmas: Array,
    names: Sequence[str],
    unit: str,
    wide: Sequence[float],
    narrow: Sequence[float],
    title: str,
) -> Figure:
    """Left the paper's kind of curve, one run, signed; right all runs: errors, their RMS, and the filter's sigma; axes linear."""
    with sheet(12.0, 7.5, 3, 2, sharex=True, heading=title, legend=5) as (figure, axes):
        for i in range(3):
            left, right = axes[i]
            marked(left, EPOCHS, one[:, i], (-wide[i], wide[i]), color=COLOURS[0], label="one run, as in the paper")
            if true is not None:
                left.axhline(true[0, i], color=REFERENCE, linestyle=":", linewidth=1.2, label="truth")
            for k, run in enumerate(values[:SINGLE, :, i]):
                label = "errors of single runs" if k == 0 else None
                right.plot(EPOCHS, run, color=COLOURS[0], linewidth=0.5, alpha=0.5, label=label)
            rms, sigma = (np.sqrt(np.mean(x[:, :, i] ** 2, axis=0)) for x in (values, sigmas))
            limits = (-narrow[i], narrow[i])
            marked(right, EPOCHS, rms, limits, color=COLOURS[1], label=f"RMS of {len(values)} runs")
            for sign in (1.0, -1.0):
                label = "sigma" if sign > 0 else None
                right.plot(EPOCHS, sign * sigma, "--", color=REFERENCE, linewidth=1.0, label=label)
            right.set_ylim(*limits)
            left.set_ylabel(f"{names[i]}, {unit}")
            for ax in axes[i]:
                _turn(ax)
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
    return figure


def _turn(ax: Any) -> None:
    ax.axvspan(BEGIN, STOP, color=REFERENCE, alpha=0.08, linewidth=0.0)
    ax.margins(x=0.0)


class Panel(NamedTuple):
    """Curves of one axis: RMS over the runs of level or heading."""

    title: str
    case: str
    methods: Mapping[str, str]  # and what each is called
    heading: bool = False


def draw_panels(found: Mapping[tuple[str, str], Errors], rows: Sequence[Sequence[Panel]], title: str) -> Figure:
    """RMS over time, arcmin, on axes that a row shares."""
    with sheet(
        3.0 * len(rows[0]) + 0.6,
        3.2 * len(rows) + 0.4,
        len(rows),
        len(rows[0]),
        sharex=True,
        sharey="row",
        squeeze=False,
        heading=title,
        legend=6,
    ) as (figure, axes):
        for row, panels in zip(axes, rows, strict=True):
            for ax, panel in zip(row, panels, strict=True):
                for (method, label), colour in zip(panel.methods.items(), COLOURS, strict=False):
                    phi = found[panel.case, method].phi
                    phi = phi[..., 2:] if panel.heading else phi[..., :2]
                    rms = np.sqrt(np.mean(phi**2, axis=(0, 2))) / ARCMIN
                    known = method.startswith("oracle")
                    ax.plot(
                        EPOCHS, rms, "--" if known else "-", color=REFERENCE if known else colour, label=label, lw=1.2
                    )
                _turn(ax)
                ax.set(yscale="log", ylim=(0.5, 120.0) if panel.heading else (0.08, 30.0))
                ax.set_title(panel.title)
            row[0].set_ylabel(f"{'heading' if panels[0].heading else 'level'}, arcmin")
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
    return figure


def draw_level(found: Mapping[tuple[str, str], Errors], cases: Sequence[str]) -> Figure:
    """Level in every manoeuvre, velocity matching above, with attitude below."""
    rows = [
        [
            Panel(case.replace("_", " ") + words, case, {m + suffix: label for m, label in STATES.items()})
            for case in cases
        ]
        for suffix, words in (("", ""), ("_att", ", attitude too"))
    ]
    return draw_panels(found, rows, "Level error, RMS over the runs (grey: manoeuvre)")
