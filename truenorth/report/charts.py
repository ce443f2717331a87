"""Interactive charts of an alignment: convergence with bands, sigma against time, biases, innovations, NIS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import DEG_PER_HOUR, MICRO_G, Alignment, History
from truenorth.figures.style import COLOURS, REFERENCE, evenly

Array = NDArray[np.float64]

ANGLES = ("heading", "pitch", "roll")
POINTS = 2000  # of a line; more than a screen shows
SETTLED_FROM = 0.25  # of the log: vertical axes are scaled to what comes after
SIGMA_FACTOR = 2.0


def charts(result: Alignment) -> list[tuple[str, str, Any]]:
    """Title, caption and plotly figure of each chart; none without a history."""
    h = result.history
    if h is None:
        return []
    rows = evenly(len(h.time), POINTS)
    t = h.time[rows]
    return [
        (
            "Convergence",
            "Heading, pitch and roll at the answer's epoch, as each earlier time would have told them: with one-sigma "
            "bands, the base's own motion taken out. Axes are scaled to the last three quarters of the log.",
            _convergence(result, rows, t),
        ),
        (
            "How the uncertainty falls",
            "One-sigma of each angle; dotted, the part that sensor bias makes and waiting does not improve.",
            _sigmas(h, rows, t),
        ),
        (
            "Gyro bias",
            "With one-sigma bands; a band as wide as at the start means not estimated.",
            _biases(h, rows, t, 0),
        ),
        ("Accelerometer bias", "With one-sigma bands.", _biases(h, rows, t, 1)),
        (
            "Innovations",
            "Velocity of the base as seen, less as predicted: with two-sigma bounds. They should look like noise.",
            _innovations(h, rows, t),
        ),
        (
            "Normalised innovation squared",
            f"Mean over ten epochs; it should stay about 3. Its mean over the log is {np.mean(h.nis):.2f}. On a base that "
            "sways or wanders the filter allows for more than the innovations show, and it is lower.",
            _nis(h),
        ),
    ]


def _figure(rows: int, height: int, titles: list[str]) -> Any:
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=rows, cols=1, shared_xaxes=True, vertical_spacing=0.05, x_title="time, s")
    figure.update_layout(
        height=height,
        template="plotly_white",
        margin={"l": 80, "r": 20, "t": 20, "b": 60},
        showlegend=False,
        font={"family": "system-ui, sans-serif", "size": 13},
        hovermode="x unified",
    )
    for row, title in enumerate(titles, start=1):
        figure.update_yaxes(title_text=title, row=row, col=1, automargin=True)
    return figure


def _band(figure: Any, row: int, t: Array, middle: Array, half: Array, colour: str, name: str) -> None:
    import plotly.graph_objects as go

    rgba = f"rgba({int(colour[1:3], 16)},{int(colour[3:5], 16)},{int(colour[5:7], 16)},0.18)"
    figure.add_trace(
        go.Scatter(
            x=np.concatenate([t, t[::-1]]),
            y=np.concatenate([middle + half, (middle - half)[::-1]]),
            fill="toself",
            fillcolor=rgba,
            line={"width": 0},
            hoverinfo="skip",
        ),
        row=row,
        col=1,
    )
    figure.add_trace(
        go.Scatter(x=t, y=middle, line={"color": colour, "width": 1.6}, name=name, hovertemplate="%{y:.5g}"),
        row=row,
        col=1,
    )


def _line(figure: Any, row: int, t: Array, y: Array, colour: str, name: str, dash: str = "solid") -> None:
    import plotly.graph_objects as go

    figure.add_trace(
        go.Scatter(x=t, y=y, line={"color": colour, "width": 1.3, "dash": dash}, name=name, hovertemplate="%{y:.4g}"),
        row=row,
        col=1,
    )


def _limits(middle: Array, half: Array) -> list[float]:
    """Vertical limits that show the settled part well."""
    late = slice(int(SETTLED_FROM * len(middle)), None)
    low, high = float(np.min((middle - half)[late])), float(np.max((middle + half)[late]))
    margin = 0.15 * max(high - low, 1e-9)
    return [low - margin, high + margin]


def _convergence(result: Alignment, rows: NDArray[np.intp], t: Array) -> Any:
    figure = _figure(3, 640, [f"{angle}, deg" for angle in ANGLES])
    values, sigmas = (np.degrees(x) for x in result.convergence)
    for i, angle in enumerate(ANGLES):
        _band(figure, i + 1, t, values[rows, i], sigmas[rows, i], COLOURS[i], angle)
        figure.update_yaxes(range=_limits(values[:, i], sigmas[:, i]), row=i + 1, col=1)
    return figure


def _sigmas(h: History, rows: NDArray[np.intp], t: Array) -> Any:
    from truenorth.alignment.result import euler_sigma

    floor = euler_sigma(h.C_nb, h.phi_floor)
    figure = _figure(1, 380, ["one-sigma, arcmin"])
    for i, angle in enumerate(ANGLES):
        _line(figure, 1, t, 60 * np.degrees(h.euler_sigma[rows, i]), COLOURS[i], angle)
        _line(figure, 1, t, 60 * np.degrees(floor[rows, i]), COLOURS[i], f"{angle}, bias", "dot")
    figure.update_yaxes(type="log")
    figure.update_layout(showlegend=True, legend={"orientation": "h", "y": 1.12})
    return figure


def _biases(h: History, rows: NDArray[np.intp], t: Array, sensor: int) -> Any:
    value, sigma, unit, name = (
        (h.gyro_bias, h.gyro_bias_sigma, DEG_PER_HOUR, "deg/h"),
        (h.accel_bias, h.accel_bias_sigma, MICRO_G, "ug"),
    )[sensor]
    figure = _figure(3, 560, [f"{axis}, {name}" for axis in "xyz"])
    for i, axis in enumerate("xyz"):
        _band(figure, i + 1, t, value[rows, i] / unit, sigma[rows, i] / unit, COLOURS[i], axis)
    return figure


def _innovations(h: History, rows: NDArray[np.intp], t: Array) -> Any:
    figure = _figure(3, 560, [f"{axis}, m/s" for axis in ("east", "north", "up")])
    for i, axis in enumerate(("east", "north", "up")):
        bound = SIGMA_FACTOR * h.innovation_sigma[:, i]
        _line(figure, i + 1, t, h.innovation[rows, i], COLOURS[i], axis)
        for sign in (1, -1):
            _line(figure, i + 1, t, sign * bound[rows], REFERENCE, "two sigma", "dot")
        figure.update_yaxes(range=_limits(np.zeros_like(bound), 1.6 * bound), row=i + 1, col=1)
    return figure


def _nis(h: History) -> Any:
    block = 10
    count = len(h.nis) // block
    figure = _figure(1, 300, ["NIS, mean of 10"])
    if count == 0:
        return figure
    mean = h.nis[: count * block].reshape(count, block).mean(axis=1)
    t = h.time[: count * block].reshape(count, block).mean(axis=1)
    # A mean of 10 values with 3 degrees of freedom each is chi-square with 30, over 10.
    low, high = 16.79 / block, 46.98 / block
    _line(figure, 1, t, mean, COLOURS[0], "NIS")
    for level in (low, 3.0, high):
        _line(figure, 1, t[[0, -1]], np.full(2, level), REFERENCE, "95 % band", "dot" if level != 3.0 else "dash")
    return figure
