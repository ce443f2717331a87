"""Charts of damping on the page of a navigation: spectra before and after, and the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.language import translated as _
from truenorth.damping.loop import in_words
from truenorth.damping.spectrum import PADDING
from truenorth.report.chart import Chart
from truenorth.report.document import Panel

if TYPE_CHECKING:
    from truenorth.damping.result import Damping

SHORTEST_PERIOD = 120.0  # s, that is drawn


def damping_facts(damping: Damping) -> list[tuple[str, str]]:
    """Rows of the page's table: what was done, and the eigenvalues of the loop."""
    loop = (
        _("Modes of the loop") if damping.damper.method in ("internal", "external") else _("Modes of the undamped INS")
    )
    return [(_("Damping"), damping.in_words()), (loop, in_words(damping.modes))]


def damping_panels(damping: Damping) -> list[Panel]:
    """The spectrum of the velocity, where the log is long enough for one."""
    if damping.before is None or damping.after is None:
        return []
    chart = Chart([_("anticlockwise, m/s"), _("clockwise, m/s")], _("period, h"), height=460)
    for name, found, colour in ((_("undamped"), damping.before, "ref"), (_("damped"), damping.after, "c0")):
        for row, sign in ((0, 1.0), (1, -1.0)):
            f = sign * found.frequency
            one_cycle = PADDING * float(found.frequency[1] - found.frequency[0])  # in the log
            band = np.flatnonzero((f >= one_cycle) & (f < 1.0 / SHORTEST_PERIOD))
            band = band[np.argsort(-f[band])]
            chart.line(row, 1.0 / f[band] / 3600.0, found.amplitude[band], colour, name, key=row == 0)
    chart.across(type="log")
    for row in (0, 1):
        chart.axis(row, type="log")
    what = _("velocity less the log's") if damping.reference is not None else _("velocity")
    caption = _(
        "Amplitude of the {what}, east and north as one complex number, from the switch on. Foucault splits the Schuler line "
        "(1.4 h) into two that turn in opposite senses; a method that damps takes both away."
    ).format(what=what)
    return [Panel(_("Spectrum of the velocity"), caption, chart)]
