"""The page of a navigation: verdict, where it ended, the track, bands, what the aiding sensors said; and its folder."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.figures.navigation import ellipses, track_unit
from truenorth.figures.style import COLOURS, evenly
from truenorth.navigation.result import mean_nis
from truenorth.report.charts import POINTS, band_trace, bound, line, new_chart, single
from truenorth.report.damping import damping_charts, damping_facts
from truenorth.report.page import CHART_OPTIONS, short

if TYPE_CHECKING:
    from truenorth.navigation.result import Navigation
    from truenorth.state.track import Residuals

Array = NDArray[np.float64]

VERDICTS = {"navigated": ("good", "Navigated"), "inconsistent": ("bad", "The measurements contradict the track")}
UNITS = {"GNSS position": "m", "barometer": "m", "zero rotation": "rad/s"}


def navigation_page(result: Navigation) -> str:
    """HTML text of the page; plotly's script is inside, so that it works offline."""
    from jinja2 import Environment, PackageLoader
    from plotly.offline import get_plotlyjs

    from truenorth.core.version import __version__

    environment = Environment(
        loader=PackageLoader("truenorth.report", "templates"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    mood, verdict = VERDICTS[result.status]
    return environment.get_template("navigation.html").render(
        result=result,
        mood=mood,
        verdict=verdict,
        numbers=_numbers(result),
        facts=_facts(result),
        aiding=[_told(r) for r in result.residuals],
        estimated=_estimated(result),
        charts=[
            (title, caption, figure.to_html(full_html=False, include_plotlyjs=False, config=CHART_OPTIONS))
            for title, caption, figure in _charts(result)
        ],
        plotly=get_plotlyjs(),
        version=__version__,
    )


def _numbers(result: Navigation) -> list[tuple[str, str, str]]:
    s = result.summary()
    sigma, v, v_sigma = s["position_sigma_m"], s["v_n_m_s"], s["v_n_sigma_m_s"]
    rows = [
        ("Latitude", f"{s['lat_deg']:.7f}°", f"{short(sigma[1])} m"),
        ("Longitude", f"{s['lon_deg']:.7f}°", f"{short(sigma[0])} m"),
        ("Height", f"{s['alt_m']:.2f} m", f"{short(sigma[2])} m"),
    ]
    rows += [
        (f"Velocity {n}", f"{x:.3f} m/s", f"{short(e)} m/s") for n, x, e in zip(("east", "north", "up"), v, v_sigma)
    ]
    rows += [
        (n.capitalize(), f"{s[f'{n}_deg']:.4f}°", f"{short(s[f'{n}_sigma_deg'])}°")
        for n in ("heading", "pitch", "roll")
    ]
    return rows


def _facts(result: Navigation) -> list[tuple[str, str]]:
    gaps = (
        "none" if not result.gaps else f"{len(result.gaps)} bridged, the longest {max(g for _, g in result.gaps):.3g} s"
    )
    return [
        ("Log", f"{result.source}, {result.time[0]:.1f} to {result.time[-1]:.1f} s"),
        ("Distance", f"{result.distance:.0f} m"),
        ("Height", result.altitude),
        ("Smoothed", "yes, over the whole log" if result.smoothed else "no"),
        ("Gaps of the IMU", gaps),
        ("Seconds at rest used", str(result.stops)),
        ("IMU", result.imu_source),
        *([] if result.damping is None else damping_facts(result.damping)),
    ]


def _told(r: Residuals) -> dict[str, str]:
    nis = mean_nis(r)
    return {
        "name": r.name,
        "count": str(len(r.time)),
        "rejected": str(r.rejected),
        "outside": str(r.outside),
        "nis": "–" if nis is None else f"{nis:.2f}",
    }


def _estimated(result: Navigation) -> list[tuple[str, str, str]]:
    return [
        (name.capitalize(), ", ".join(short(x) for x in told["value"]), ", ".join(short(x) for x in told["sigma"]))
        for name, told in result.estimated().items()
        if not name.startswith("slow")
    ]


def _charts(result: Navigation) -> list[tuple[str, str, Any]]:
    t = result.time
    shown = [
        (
            "Track",
            "East and north of the start, on one scale; the ellipses are one sigma of position.",
            _track(result),
        ),
        (
            "Height",
            f"With its one-sigma band; kept: {result.altitude}.",
            _bands(t, result.position[:, 2:], result.position_sigma[:, 2:], ["height, m"]),
        ),
        (
            "Velocity",
            "With one-sigma bands.",
            _bands(t, result.v_n, result.v_sigma, [f"{a}, m/s" for a in ("east", "north", "up")]),
        ),
        (
            "Attitude",
            "With one-sigma bands; heading goes on beyond 360°.",
            _bands(
                t,
                np.degrees(np.stack([np.unwrap(result.euler[:, 0]), result.euler[:, 1], result.euler[:, 2]], axis=1)),
                np.degrees(result.euler_sigma),
                [f"{a}, deg" for a in ("heading", "pitch", "roll")],
            ),
        ),
        ("One sigma of position", "East, north and up.", _sigmas(t, result.position_sigma, "m")),
    ]
    if result.damping is not None:
        shown += damping_charts(result.damping)
    for r in result.residuals:
        if len(r.time):
            shown.append(
                (
                    f"Innovations: {r.name}",
                    "Predicted less measured; dotted two sigma, dashed three sigma; orange: rejected.",
                    _innovations(r),
                )
            )
    return shown


def _track(result: Navigation) -> Any:
    import plotly.graph_objects as go

    scale, unit = track_unit(result)
    figure = go.Figure()
    for points in ellipses(result):
        figure.add_trace(
            go.Scatter(
                x=single(points[:, 0] / scale),
                y=single(points[:, 1] / scale),
                mode="lines",
                line={"width": 1, "color": "rgba(0,114,178,0.5)"},
                hoverinfo="skip",
                showlegend=False,
            )
        )
    rows = evenly(len(result.time), POINTS)
    east, north = (result.displacement[rows] / scale).T
    figure.add_trace(
        go.Scatter(
            x=single(east),
            y=single(north),
            mode="lines",
            line={"color": COLOURS[0], "width": 2},
            text=[f"{x:.1f} s" for x in result.time[rows]],
            name="track",
            showlegend=False,
        )
    )
    for name, k, colour in (("start", 0, COLOURS[2]), ("end", -1, COLOURS[1])):
        x, y = result.displacement[k] / scale
        figure.add_trace(go.Scatter(x=[x], y=[y], mode="markers", marker={"color": colour, "size": 10}, name=name))
    figure.update_layout(
        height=560,
        template="plotly_white",
        margin={"l": 70, "r": 16, "t": 20, "b": 60},
        xaxis_title=f"east, {unit}",
        yaxis_title=f"north, {unit}",
        yaxis_scaleanchor="x",
        font={"family": "system-ui, sans-serif", "size": 13},
    )
    return figure


def _bands(t: Array, values: Array, sigmas: Array, names: list[str]) -> Any:
    figure = new_chart(max(280, 190 * len(names)), names)
    for i, name in enumerate(names):
        band_trace(figure, i + 1, t, values[:, i], sigmas[:, i], COLOURS[i])
        line(figure, i + 1, t, values[:, i], COLOURS[i], name)
    return figure


def _sigmas(t: Array, sigmas: Array, unit: str) -> Any:
    figure = new_chart(340, [f"one sigma, {unit}"])
    for i, name in enumerate(("east", "north", "up")):
        if np.all(sigmas[:, i] > 0.0):
            line(figure, 1, t, sigmas[:, i], COLOURS[i], name)
    figure.update_yaxes(type="log")
    figure.update_layout(showlegend=True, legend={"orientation": "h", "y": 1.14})
    return figure


def _innovations(r: Residuals) -> Any:
    import plotly.graph_objects as go

    there = [i for i in range(3) if np.isfinite(r.innovation[:, i]).any()]
    names = ("right", "forward", "up") if r.name in ("odometer", "velocity log") else ("east", "north", "up")
    if r.name == "barometer":
        names = ("height", "", "")
    figure = new_chart(max(280, 170 * len(there)), [f"{names[i]}, {UNITS.get(r.name, 'm/s')}" for i in there])
    for row, i in enumerate(there, start=1):
        rows = np.flatnonzero(np.isfinite(r.innovation[:, i]))
        rows = rows[evenly(len(rows), POINTS)]
        for kept, colour in ((r.used[rows], COLOURS[0]), (~r.used[rows], COLOURS[1])):
            figure.add_trace(
                go.Scatter(
                    x=r.time[rows][kept],
                    y=single(r.innovation[rows, i][kept]),
                    mode="markers",
                    marker={"color": colour, "size": 4},
                    hovertemplate="%{y:.4g}",
                    name="used" if colour == COLOURS[0] else "rejected",
                ),
                row=row,
                col=1,
            )
        for factor, dash in ((2.0, "dot"), (3.0, "dash")):
            for sign in (1.0, -1.0):
                bound(figure, row, r.time[rows], sign * factor * r.sigma[rows, i], dash)
        limit = 4.0 * float(np.median(r.sigma[rows, i]))
        figure.update_yaxes(range=[-limit, limit], row=row, col=1)
    return figure
