"""Interactive charts of an alignment: convergence with bands, sigma against time, biases, innovations, NIS."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment, History
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.convergence import NIS_BLOCK, Course, averaged_nis, courses, settled_limits
from truenorth.figures.style import COLOURS, REFERENCE, evenly, thin

Array = NDArray[np.float64]

POINTS = 1500  # of a line; more than a screen shows
BOUND_POINTS = 300  # of a limit, which is smooth
MILLI = 1e3  # mm in a metre


def charts(result: Alignment) -> list[tuple[str, str, Any]]:
    """Title, caption and plotly figure of each chart; none without a history."""
    h = result.history
    if h is None:
        return []
    angles = courses(result)
    return [
        (
            "Convergence",
            "The attitude at the answer's epoch, as each earlier time would have told it, the base's own motion taken out. "
            "Light band: one sigma. Dark band: its floor, which waiting does not improve. Axes are scaled to the last three "
            "quarters of the log." + ("" if result.heading_known else " The heading is refused, and not drawn."),
            _convergence(h.time, angles, result.heading_known),
        ),
        (
            "How the uncertainty falls",
            "One sigma of each angle; dotted, its floor. Where a line has met its floor, more time does not pay.",
            _sigmas(h.time, angles),
        ),
        (
            "Gyro bias",
            "With one-sigma bands; a band as wide as at the start means not estimated.",
            _biases(h.time, h.gyro_bias / DEG_PER_HOUR, h.gyro_bias_sigma / DEG_PER_HOUR, "deg/h"),
        ),
        (
            "Accelerometer bias",
            "With one-sigma bands; a band as wide as at the start means not estimated.",
            _biases(h.time, h.accel_bias / MICRO_G, h.accel_bias_sigma / MICRO_G, "µg"),
        ),
        (
            "Innovations",
            "Velocity of the base as seen, less as predicted; dotted two sigma, dashed three sigma. They should look like "
            "noise and stay inside.",
            _innovations(h),
        ),
        (
            "Normalised innovation squared",
            f"Mean of {NIS_BLOCK} epochs, with the 95 % band of such a mean; 3 is expected, the mean over the log is "
            f"{np.mean(h.nis):.2f}. The band is that of independent innovations: where the base's own motion makes neighbours "
            "alike, more means fall outside.",
            _nis(h),
        ),
    ]


def new_chart(height: int, titles: list[str], over: str = "time, s") -> Any:
    """Rows of axes over one axis, as a rule time, in the pages' look."""
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=len(titles), cols=1, shared_xaxes=True, vertical_spacing=0.05, x_title=over)
    figure.update_layout(
        height=height,
        template="plotly_white",
        margin={"l": 70, "r": 16, "t": 20, "b": 60},
        showlegend=False,
        font={"family": "system-ui, sans-serif", "size": 13},
        hovermode="x unified",
    )
    for row, title in enumerate(titles, start=1):
        figure.update_yaxes(title_text=title, exponentformat="power", automargin=True, row=row, col=1)
    return figure


def band_trace(figure: Any, row: int, t: Array, middle: Array, half: Array, colour: str) -> None:
    """A filled band of this half width."""
    import plotly.graph_objects as go

    rows = evenly(len(t), POINTS)
    t, low, high = t[rows], single(middle - half)[rows], single(middle + half)[rows]
    rgba = f"rgba({int(colour[1:3], 16)},{int(colour[3:5], 16)},{int(colour[5:7], 16)},0.18)"
    figure.add_trace(
        go.Scatter(
            x=np.concatenate([t, t[::-1]]),
            y=np.concatenate([high, low[::-1]]),
            fill="toself",
            fillcolor=rgba,
            mode="none",
            hoverinfo="skip",
        ),
        row=row,
        col=1,
    )


def single(y: Array) -> NDArray[np.float32]:
    """Seven digits, which no eye exhausts, at half the bytes; time keeps all of its own."""
    return y.astype(np.float32)


def line(figure: Any, row: int, t: Array, y: Array, colour: str, name: str, dash: str = "solid") -> None:
    """A line thinned to what the eye can tell."""
    import plotly.graph_objects as go

    rows = thin(t, y, POINTS)
    figure.add_trace(
        go.Scatter(
            x=t[rows],
            y=single(y)[rows],
            mode="lines",
            line={"color": colour, "width": 1.4, "dash": dash},
            name=name,
            hovertemplate="%{y:.5g}",
        ),
        row=row,
        col=1,
    )


def bound(figure: Any, row: int, t: Array, y: Array, dash: str) -> None:
    """A limit: seen, but not in the way of the pointer."""
    rows = evenly(len(t), BOUND_POINTS)
    line(figure, row, t[rows], y[rows], REFERENCE, "", dash)
    figure.data[-1].update(hoverinfo="skip", hovertemplate=None, line={"width": 1.0})


def _convergence(t: Array, angles: list[Course], heading_known: bool) -> Any:
    shown = list(zip(COLOURS, angles, strict=False))[0 if heading_known else 1 :]
    figure = new_chart(220 * len(shown), [f"{course.name}, deg" for _, course in shown])
    for row, (colour, course) in enumerate(shown, start=1):
        value, sigma, floor = (np.degrees(x) for x in (course.value, course.sigma, course.floor))
        band_trace(figure, row, t, value, sigma, colour)
        band_trace(figure, row, t, value, floor, colour)
        line(figure, row, t, value, colour, course.name)
        figure.update_yaxes(range=settled_limits(value, sigma), row=row, col=1)
    return figure


def _sigmas(t: Array, angles: list[Course]) -> Any:
    figure = new_chart(380, ["one sigma, arcmin"], over="time since the first epoch, s")
    t, angles = t[1:] - t[0], [_later(course) for course in angles]  # zero has no logarithm
    for colour, course in zip(COLOURS, angles):
        line(figure, 1, t, 60 * np.degrees(course.sigma), colour, course.name)
        line(figure, 1, t, 60 * np.degrees(course.floor), colour, f"{course.name}, floor", "dot")
    lowest = 0.5 * 60 * np.degrees(min(course.floor[-1] for course in angles))
    highest = 2.0 * 60 * np.degrees(max(course.sigma.max() for course in angles))
    figure.update_yaxes(type="log", dtick=1, range=[np.log10(lowest), np.log10(highest)])
    figure.update_xaxes(type="log")
    figure.update_layout(showlegend=True, legend={"orientation": "h", "y": 1.14})
    return figure


def _later(course: Course) -> Course:
    return Course(course.name, course.value[1:], course.sigma[1:], course.floor[1:])


def _biases(t: Array, bias: Array, sigma: Array, unit: str) -> Any:
    figure = new_chart(560, [f"{axis}, {unit}" for axis in "xyz"])
    for i, axis in enumerate("xyz"):
        band_trace(figure, i + 1, t, bias[:, i], sigma[:, i], COLOURS[i])
        line(figure, i + 1, t, bias[:, i], COLOURS[i], axis)
        figure.update_yaxes(range=settled_limits(bias[:, i], sigma[:, i]), row=i + 1, col=1)
    return figure


def _innovations(h: History) -> Any:
    figure = new_chart(560, [f"{axis}, mm/s" for axis in ("east", "north", "up")])
    for i, axis in enumerate(("east", "north", "up")):
        sigma = MILLI * h.innovation_sigma[:, i]
        line(figure, i + 1, h.time, MILLI * h.innovation[:, i], COLOURS[i], axis)
        for factor, dash in ((2.0, "dot"), (3.0, "dash")):
            for sign in (1.0, -1.0):
                bound(figure, i + 1, h.time, sign * factor * sigma, dash)
        figure.update_yaxes(range=settled_limits(np.zeros_like(sigma), 4.0 * sigma), row=i + 1, col=1)
    return figure


def _nis(h: History) -> Any:
    t, mean, low, high = averaged_nis(h)
    figure = new_chart(320, ["NIS"])
    line(figure, 1, t, mean, COLOURS[0], "NIS")
    ends = h.time[[0, -1]]
    band_trace(figure, 1, ends, np.full(2, 0.5 * (low + high)), np.full(2, 0.5 * (high - low)), REFERENCE)
    bound(figure, 1, ends, np.full(2, 3.0), "dash")
    top = max(1.3 * high, float(np.quantile(mean, 0.98)) if mean.size else 0.0)
    figure.update_yaxes(range=[0.0, top])
    figure.update_xaxes(range=list(ends))
    return figure
