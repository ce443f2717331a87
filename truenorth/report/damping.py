"""Charts of damping on the page of a navigation: errors of the log, weights of a fusion, switches, spectra, modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.language import translated as _
from truenorth.damping.loop import in_words
from truenorth.damping.spectrum import PADDING
from truenorth.errors.log import BIAS
from truenorth.errors.marine import DP, DV, PHI
from truenorth.figures.units import Clock
from truenorth.report.chart import Chart
from truenorth.report.charts import over_time
from truenorth.report.document import Panel

if TYPE_CHECKING:
    from truenorth.damping.result import Damping, LogHistory

SHORTEST_PERIOD = 120.0  # s, that is drawn
SHOWN = {"m/s": (1.0, "m/s"), "rad": (np.radians(1.0 / 60.0), "arcmin"), "1": (0.01, "%")}


def damping_facts(damping: Damping) -> list[tuple[str, str]]:
    """Rows of the page's table: what was done, and the eigenvalues of a network's loop or of the undamped INS."""
    facts = [(_("Damping"), damping.in_words())]
    if damping.modes:
        network = damping.damper.method in ("internal", "external")
        name = _("Modes of the loop") if network else _("Modes of the undamped INS")
        facts.append((name, in_words(damping.modes)))
    return facts


def damping_panels(damping: Damping) -> list[Panel]:
    """What the method has of these: errors of the log, weights of the fusion, switches; and the velocity's spectrum."""
    clock = Clock.of(damping.time)
    shown = (_log(damping, clock), _weights(damping, clock), _switches(damping, clock), _spectrum(damping))
    return [panel for panel in shown if panel is not None]


def _log(damping: Damping, clock: Clock) -> Panel | None:
    """Errors of the log as the filter finds them on the way."""
    log = damping.log
    if log is None or not log.names:
        return None
    chart = Chart([f"{_(name)}<br>{SHOWN[unit][1]}" for name, unit in _unique(log)], over_time(clock))
    row, t = {name: i for i, (name, _unit) in enumerate(_unique(log))}, clock(log.time)
    for i, (name, unit) in enumerate(zip(log.names, log.units, strict=True)):
        scale, number = SHOWN[unit][0], log.names[:i].count(name)
        x, sigma = log.x[:, i] / scale, log.sigma[:, i] / scale
        chart.band(row[name], t, x - sigma, x + sigma, f"c{number}")
        alone = log.names.count(name) == 1
        axes = (_("right"), _("forward")) if name == BIAS else (_("east"), _("north"))
        chart.line(row[name], t, x, f"c{number}", _(name) if alone else axes[number], key=row[name] == 0)
    caption = _("As the filter finds them on the way, with one-sigma bands. A current shows with the opposite sign.")
    return Panel(_("Errors of the log"), caption, chart)


def _unique(log: LogHistory) -> list[tuple[str, str]]:
    return list(dict.fromkeys(zip(log.names, log.units, strict=True)))


def _weights(damping: Damping, clock: Clock) -> Panel | None:
    """Of filter 1 in the fusion of two filters."""
    if damping.weight is None:
        return None
    chart = Chart([_("weight of filter 1")], over_time(clock), height=340)
    for number, (name, state) in enumerate(
        ((_("velocity north"), DV.stop - 1), (_("latitude"), DP.stop - 1), (_("heading"), PHI.stop - 1))
    ):
        chart.line(0, clock(damping.time), damping.weight[:, state], f"c{number}", name, key=True)
    chart.axis(0, range=[0.0, 1.0])
    caption = _(
        "1: the filter of the velocity alone; 0: that of its changes alone, which a constant error of the log does not touch."
    )
    return Panel(_("Weights of the fusion"), caption, chart)


def _switches(damping: Damping, clock: Clock) -> Panel | None:
    """What manoeuvres let into the loop; undamped spans are shaded."""
    found = damping.switching
    if found is None:
        return None
    own = slice(-len(damping.time), None)
    chart = Chart([_("let into the loop, m/s")], over_time(clock), height=340)
    chart.line(0, clock(damping.time), found.leak[own], "c0", _("by manoeuvres"), key=True)
    chart.line(0, clock(damping.time), found.allowed[own], "ref", _("allowed"), dash="dash", key=True)
    off = np.flatnonzero(np.diff(np.concatenate([[1.0], found.mu[own], [1.0]])))
    for first, last in zip(off[::2], off[1::2], strict=True):
        chart.shade(*(float(clock(damping.time[min(k, len(damping.time) - 1)])) for k in (first, last)))
    caption = _(
        "Of the velocity that manoeuvres change, what the network lets into the loop. Shaded: switched off, until half of what "
        "is allowed."
    )
    return Panel(_("Switched off in manoeuvres"), caption, chart)


def _spectrum(damping: Damping) -> Panel | None:
    """The velocity's, where the log is long enough for one."""
    if damping.before is None or damping.after is None:
        return None
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
    return Panel(_("Spectrum of the velocity"), caption, chart)
