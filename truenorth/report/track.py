"""The map of a navigation: track, fixes of the receiver, gaps, error ellipses, coast lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.core.language import translated as _
from truenorth.figures.thinning import evenly
from truenorth.figures.track import ellipses, track_unit
from truenorth.report.chart import POINTS, Chart
from truenorth.report.coast import WIDE, coast_within
from truenorth.report.document import Panel

if TYPE_CHECKING:
    from truenorth.navigation.result import Navigation

Array = NDArray[np.float64]

MARGIN = 0.05  # of the track's size, around it
LEAST = 10.0  # m, so that a vehicle that stands has a map


def track_panel(result: Navigation) -> Panel:
    """East and north of the start on one scale."""
    scale, unit = track_unit(result)
    chart = Chart([_("north, {unit}").format(unit=unit)], _("east, {unit}").format(unit=unit), height=560)
    place = result.displacement
    seen = np.concatenate([place, *ellipses(result)])
    middle, half = 0.5 * (seen.max(axis=0) + seen.min(axis=0)), 0.5 * np.ptp(seen, axis=0)
    reach = (1.0 + 2.0 * MARGIN) * max(float(half.max()), LEAST)
    words = [_("East and north of the start, on one scale. The ellipses are one sigma of position.")]

    if 2.0 * reach > WIDE:
        east, north = _coast(result, middle, 2.0 * reach)
        if east.size:
            chart.limit_line(east / scale, north / scale)
            words.append(_("Coast lines: Natural Earth, true to a kilometre or two."))
    for points in ellipses(result):
        chart.limit_line(points[:, 0] / scale, points[:, 1] / scale, "c0/0.5")
    fixes = _fixes(result)
    if fixes is not None:
        for kept, colour, name in ((True, "c4", _("GNSS, used")), (False, "c1", _("GNSS, rejected"))):
            rows = fixes[1] == kept
            if rows.any():
                x, y = (fixes[0][rows] / scale).T
                chart.points(
                    0, x, y, colour, name, size=4 if kept else 7, symbol="circle-open" if kept else "x", key=True
                )
    rows = evenly(len(result.time), 2 * POINTS)
    line = place[rows] / scale
    line[_after_gaps(result, rows)] = np.nan
    chart.line(0, line[:, 0], line[:, 1], "c0", _("track"), key=True)
    for start, stop in _gap_ends(result):
        chart.limit_line(place[[start, stop], 0] / scale, place[[start, stop], 1] / scale, "c0", "dot")
    if result.gaps:
        words.append(_("Dotted: bridged gaps of the IMU's log."))
    for name, k, colour, symbol in ((_("start"), 0, "c2", "circle"), (_("end"), -1, "c1", "square")):
        chart.points(0, place[[k], 0] / scale, place[[k], 1] / scale, colour, name, size=11, symbol=symbol, key=True)
    chart.across(range=[float((middle[0] - reach) / scale), float((middle[0] + reach) / scale)])
    chart.axis(0, scaleanchor="x", range=[float((middle[1] - reach) / scale), float((middle[1] + reach) / scale)])
    chart.layout["hovermode"] = "closest"
    return Panel(_("Track"), " ".join(words), chart)


def _coast(result: Navigation, middle: Array, reach: float) -> tuple[Array, Array]:
    """East and north (m) of the coasts around; the inverse of `Navigation.displacement`."""
    lat, lon, alt = result.position[0]
    R_M, R_N = radii(lat)
    to_north, to_east = np.degrees(1.0 / (R_M + alt)), np.degrees(1.0 / ((R_N + alt) * np.cos(lat)))
    lat_0, lon_0 = float(np.degrees(lat)), float(np.degrees(lon))
    east, north = (
        (lon_0 + (middle[0] - reach) * to_east, lon_0 + (middle[0] + reach) * to_east),
        (lat_0 + (middle[1] - reach) * to_north, lat_0 + (middle[1] + reach) * to_north),
    )
    longitude, latitude = coast_within(*north, *east)
    return (longitude - lon_0) / to_east, (latitude - lat_0) / to_north


def _fixes(result: Navigation) -> tuple[Array, NDArray[np.bool_]] | None:
    """(M, 2) where the receiver said the vehicle is, m, and whether it was believed; None without a receiver of positions.

    An innovation is predicted less measured, so the fix, brought to the IMU, is the place less the innovation.
    """
    for r in result.residuals:
        if r.name == "GNSS position" and len(r.time):
            rows = evenly(len(r.time), POINTS)
            there = np.stack([np.interp(r.time[rows], result.time, x) for x in result.displacement.T], axis=1)
            return there - r.innovation[rows, :2], np.asarray(r.used[rows], dtype=bool)
    return None


def _gap_ends(result: Navigation) -> list[tuple[int, int]]:
    """Epochs before and after each bridged gap."""
    ends = []
    for time, length in result.gaps:
        stop = int(np.clip(np.searchsorted(result.time, time), 1, len(result.time) - 1))
        start = int(np.clip(np.searchsorted(result.time, time - length, side="right") - 1, 0, stop - 1))
        ends.append((start, stop))
    return ends


def _after_gaps(result: Navigation, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Places in `rows` at which the line is broken: the first one after each gap's beginning."""
    if not result.gaps:
        return np.zeros(0, dtype=np.intp)
    starts = np.array([start for start, _stop in _gap_ends(result)])
    return np.minimum(np.searchsorted(rows, starts, side="right"), len(rows) - 1)
