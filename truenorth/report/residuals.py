"""Charts of innovations, source by source."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.language import translated as _
from truenorth.figures.thinning import evenly
from truenorth.figures.units import Clock, unit_of
from truenorth.report.chart import POINTS, Chart
from truenorth.report.charts import limits, over_time
from truenorth.report.document import Panel

if TYPE_CHECKING:
    from truenorth.state.track import Residuals


def innovation_panels(residuals: Iterable[Residuals], clock: Clock) -> list[Panel]:
    """One for each source that has any."""
    explained = _("Predicted less measured. Dotted: two sigma; dashed: three sigma; crosses: rejected.")
    return [
        Panel(_("Innovations: {sensor}").format(sensor=_(r.name)), explained, _innovations(r, clock))
        for r in residuals
        if len(r.time)
    ]


def _innovations(r: Residuals, clock: Clock) -> Chart:
    there = [i for i in range(3) if np.isfinite(r.innovation[:, i]).any()]
    scale, unit = unit_of(r.unit, r.sigma)
    chart = Chart([f"{_(r.axes[i])}, {unit}" for i in there], over_time(clock))
    for row, i in enumerate(there):
        rows = np.flatnonzero(np.isfinite(r.innovation[:, i]))
        rows = rows[evenly(len(rows), POINTS)]
        for kept, colour, name, symbol in (
            (r.used[rows], "c0", _("used"), "circle"),
            (~r.used[rows], "c1", _("rejected"), "x"),
        ):
            if kept.any():
                x, y = clock(r.time[rows][kept]), r.innovation[rows, i][kept] / scale
                chart.points(row, x, y, colour, name, symbol=symbol, key=row == 0)
        limits(chart, row, clock(r.time[rows]), r.sigma[rows, i] / scale)
        reach = 4.0 * float(np.median(r.sigma[rows, i])) / scale
        chart.axis(row, range=[-reach, reach])
    return chart
