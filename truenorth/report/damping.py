"""Charts of damping on the page of a navigation: spectra before and after, and the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.damping.loop import in_words
from truenorth.damping.spectrum import PADDING
from truenorth.figures.style import COLOURS
from truenorth.report.charts import new_chart, single

if TYPE_CHECKING:
    from truenorth.damping.result import Damping

SHORTEST_PERIOD = 120.0  # s, that is drawn


def damping_facts(damping: Damping) -> list[tuple[str, str]]:
    """Rows of the page's table: what was done, and the eigenvalues of the loop."""
    loop = "Modes of the loop" if damping.damper.method in ("internal", "external") else "Modes of the undamped INS"
    return [("Damping", damping.in_words()), (loop, in_words(damping.modes))]


def damping_charts(damping: Damping) -> list[tuple[str, str, Any]]:
    """Title, caption and plotly figure of each chart."""
    if damping.before is None or damping.after is None:
        return []
    import plotly.graph_objects as go

    figure = new_chart(460, ["anticlockwise, m/s", "clockwise, m/s"], over="period, min")
    for name, found, colour in (("undamped", damping.before, "#999999"), ("damped", damping.after, COLOURS[0])):
        for row, sign in ((1, 1.0), (2, -1.0)):
            f = sign * found.frequency
            one_cycle = PADDING * float(found.frequency[1] - found.frequency[0])  # in the log
            band = np.flatnonzero((f >= one_cycle) & (f < 1.0 / SHORTEST_PERIOD))
            band = band[np.argsort(-f[band])]
            figure.add_trace(
                go.Scatter(
                    x=single(1.0 / f[band] / 60.0),
                    y=single(found.amplitude[band]),
                    mode="lines",
                    line={"color": colour, "width": 1.5},
                    name=name,
                    showlegend=row == 1,
                ),
                row=row,
                col=1,
            )
    figure.update_xaxes(type="log")
    figure.update_yaxes(type="log")
    figure.update_layout(showlegend=True, legend={"orientation": "h", "y": 1.1})
    what = "velocity less the log's" if damping.reference is not None else "velocity"
    caption = (
        f"Amplitude of the {what}, east and north as one complex number, from the switch on. Foucault splits the Schuler line "
        "(84 min) into two that turn in opposite senses; a method that damps takes both away."
    )
    return [("Spectrum of the velocity", caption, figure)]
