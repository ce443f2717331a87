"""Charts of a transfer alignment: delay, lever arm and mounting as they are found, and what each matched quantity was off by."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.language import translated as _
from truenorth.figures.convergence import settled_limits
from truenorth.figures.units import Clock
from truenorth.report.chart import Chart
from truenorth.report.charts import over_time
from truenorth.report.document import Panel
from truenorth.report.residuals import innovation_panels

if TYPE_CHECKING:
    from truenorth.alignment.transfer_result import Transfer


def transfer_panels(transfer: Transfer | None, shown: str) -> list[Panel]:
    """Delay, arm and mounting on the way, where they were not given; innovations of the sources but the one `shown` already."""
    if transfer is None or transfer.course is None:
        return []
    h = transfer.course
    clock = Clock.of(h.time)
    ways = (
        (_("Delay of the master"), "ms", 1e3, h.delay[:, None], h.delay_sigma[:, None], (_("Delay of the master"),)),
        (_("Lever arm"), "m", 1.0, h.lever_arm, h.lever_arm_sigma, (_("right"), _("forward"), _("up"))),
        (
            _("Mounting"),
            "deg",
            float(np.degrees(1.0)),
            h.mounting,
            h.mounting_sigma,
            (_("heading"), _("pitch"), _("roll")),
        ),
    )
    found: list[Panel] = []
    for title, unit, factor, value, sigma, names in ways:
        if not np.any(sigma[-1] > 0.0):
            continue  # it was given
        chart = Chart([f"{name}, {unit}" for name in names], over_time(clock), height=340 if len(names) == 1 else None)
        for i, name in enumerate(names):
            middle, half = factor * value[:, i], factor * sigma[:, i]
            chart.band(i, clock(h.time), middle - half, middle + half, f"c{i}")
            chart.line(i, clock(h.time), middle, f"c{i}", name)
            chart.axis(i, range=list(settled_limits(middle, half)))
        found.append(
            Panel(title, _("With one-sigma bands. A band as wide as at the start means: not estimated."), chart)
        )
    new = [r for r in transfer.residuals if len(r.time) and shown != f"{r.name.removeprefix('master ')} of the master"]
    return found + innovation_panels(new, clock)
