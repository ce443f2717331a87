"""The page of a navigation: verdict, where it ended, the map, bands, and the innovations of the aiding sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.language import translated as _
from truenorth.figures.units import Clock, angle_unit, length_unit, speed_unit
from truenorth.quality.innovations import mean_nis
from truenorth.report.chart import Chart
from truenorth.report.charts import over_time
from truenorth.report.damping import damping_facts, damping_panels
from truenorth.report.document import Panel, Table, render
from truenorth.report.estimated import estimated_rows
from truenorth.report.numbers import short
from truenorth.report.page import head_of
from truenorth.report.residuals import innovation_panels
from truenorth.report.track import track_panel
from truenorth.report.words import clauses

if TYPE_CHECKING:
    from truenorth.navigation.result import Navigation
    from truenorth.state.track import Residuals

Array = NDArray[np.float64]


def navigation_page(result: Navigation) -> str:
    """HTML text of the page; everything is inside, so that it works offline."""
    tables, panels = _tables(result), _panels(result)
    return render(
        "navigation.html",
        interactive=True,
        **head_of(result, "Navigated, with warnings"),
        numbers=_numbers(result),
        facts=_facts(result),
        tables=tables,
        panels=panels,
        contents=[_("Verdict"), _("At the end"), *(t.title for t in tables), *(p.title for p in panels)],
    )


def _numbers(result: Navigation) -> list[tuple[str, str, str]]:
    s = result.summary()
    sigma, v, v_sigma = s["position_sigma_m"], s["v_n_m_s"], s["v_n_sigma_m_s"]
    rows = [
        (_("Latitude"), f"{s['lat_deg']:.7f}°", f"{short(sigma[1])} m"),
        (_("Longitude"), f"{s['lon_deg']:.7f}°", f"{short(sigma[0])} m"),
        (_("Height"), f"{s['alt_m']:.2f} m", f"{short(sigma[2])} m"),
    ]
    rows += [
        (name, f"{x:.3f} m/s", "–" if e is None else f"{short(e)} m/s")
        for name, x, e in zip((_("Velocity east"), _("Velocity north"), _("Velocity up")), v, v_sigma)
    ]
    rows += [
        (_(n).capitalize(), f"{s[f'{n}_deg']:.4f}°", f"{short(s[f'{n}_sigma_deg'])}°")
        for n in ("heading", "pitch", "roll")
    ]
    return rows


def _facts(result: Navigation) -> list[tuple[str, str]]:
    clock = Clock.of(result.time)
    scale, unit = length_unit([result.distance])
    bridged = _("{count} bridged, the longest {longest:.3g} s")
    gaps = bridged.format(count=len(result.gaps), longest=max((g for _t, g in result.gaps), default=0.0))
    return [
        (
            _("Log"),
            _("{source}, {start:.9g} to {stop:.9g} {unit}").format(
                source=result.source,
                start=round(float(clock(result.time[0])), 9),  # the start less a step may leave 1e-15
                stop=clock(result.time[-1]),
                unit=clock.label,
            ),
        ),
        (_("Distance"), f"{short(result.distance / scale)} {unit}"),
        (_("Height kept by"), _(result.altitude)),
        (_("Smoothed"), _("yes, over the whole log") if result.smoothed else _("no")),
        (_("Gaps of the IMU"), gaps if result.gaps else _("none")),
        (_("Seconds at rest used"), str(result.stops)),
        ("IMU", clauses(result.imu_source)),
        *([] if result.damping is None else damping_facts(result.damping)),
    ]


def _tables(result: Navigation) -> list[Table]:
    tables = []
    if result.residuals:
        headings = [_("Sensor"), _("Measurements"), _("Rejected"), _("Outside the log"), _("NIS over rows")]
        tables.append(
            Table(
                _("Aiding sensors"),
                headings,
                [_counted(r) for r in result.residuals],
                _(
                    "The normalised innovation squared (NIS) over its number of rows is 1 where sigmas are right. Below 1 they "
                    "are too large, above 1 too small."
                ),
            )
        )
    rows = estimated_rows(result)
    if rows:
        tables.append(Table(_("Estimated on the way"), [_("Quantity"), _("Value at the end"), _("One sigma")], rows))
    return tables


def _counted(r: Residuals) -> list[str]:
    nis = mean_nis(r)
    return [_(r.name), str(len(r.time)), str(r.rejected), str(r.outside), "–" if nis is None else f"{nis:.2f}"]


def _panels(result: Navigation) -> list[Panel]:
    clock = Clock.of(result.time)
    angles = np.stack([np.unwrap(result.euler[:, 0]), result.euler[:, 1], result.euler[:, 2]], axis=1)
    directions = (_("east"), _("north"), _("up"))
    band = _("With one-sigma bands.")
    shown = [
        track_panel(result),
        Panel(
            _("Height"),
            _("With its one-sigma band; kept by: {how}.").format(how=_(result.altitude)),
            _bands(result, clock, result.position[:, 2:], result.position_sigma[:, 2:], [_("height")], "m"),
        ),
        Panel(_("Velocity"), band, _bands(result, clock, result.v_n, result.v_sigma, directions, "m/s")),
        Panel(
            _("Attitude"),
            _("With one-sigma bands; heading goes on beyond 360°."),
            _bands(
                result,
                clock,
                np.degrees(angles),
                np.degrees(result.euler_sigma),
                [_(name) for name in ("heading", "pitch", "roll")],
                "deg",
            ),
        ),
        Panel(
            _("One sigma of position"),
            _("East, north and up."),
            _sigmas(result, clock, result.position_sigma, length_unit, directions),
        ),
        Panel(
            _("One sigma of velocity"),
            _("East, north and up."),
            _sigmas(result, clock, result.v_sigma, speed_unit, directions),
        ),
        Panel(
            _("One sigma of attitude"),
            _("Heading, pitch and roll."),
            _sigmas(result, clock, result.euler_sigma, angle_unit, [_(n) for n in ("heading", "pitch", "roll")]),
        ),
    ]
    if result.damping is not None:
        shown += damping_panels(result.damping)
    return shown + innovation_panels(result.residuals, clock)


def _bands(
    result: Navigation, clock: Clock, values: Array, sigmas: Array, names: list[str] | tuple[str, ...], unit: str
) -> Chart:
    """Lines with bands; a gap of the IMU's log is a gap of the line, and shaded."""
    chart = Chart([f"{name}, {unit}" for name in names], over_time(clock))
    t = clock(result.time)
    for i, name in enumerate(names):
        chart.band(i, t, values[:, i] - sigmas[:, i], values[:, i] + sigmas[:, i], f"c{i}")
        chart.line(i, t, values[:, i], f"c{i}", name)
    for time, length in result.gaps:
        chart.shade(float(clock(time - length)), float(clock(time)))
    return chart


def _sigmas(
    result: Navigation, clock: Clock, sigmas: Array, fitting: object, names: list[str] | tuple[str, ...]
) -> Chart:
    scale, unit = fitting(sigmas[len(sigmas) // 2 :])  # type: ignore[operator]
    chart = Chart([_("one sigma, {unit}").format(unit=unit)], over_time(clock), height=340)
    for i, name in enumerate(names):
        if np.all(sigmas[:, i] > 0.0):
            chart.line(0, clock(result.time), sigmas[:, i] / scale, f"c{i}", name, key=True)
    chart.axis(0, type="log")
    return chart
