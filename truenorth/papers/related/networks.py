"""`truenorth reproduce networks`: internal networks designed to overshoot and time, and damping that follows the ship.

Related work of system 3: networks of second and third order, and a fuzzy, adaptive damping ratio.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.damping.adaptive import FuzzyDamping
from truenorth.damping.course import errors_of
from truenorth.damping.design import SPAN, Design, design, step_response
from truenorth.damping.loop import Loop, network_correction
from truenorth.damping.networks import SCHULER_RATE
from truenorth.errors.marine import DV
from truenorth.figures.style import COLOURS, REFERENCE
from truenorth.papers.damping.truth import HOUR, drawn, sail
from truenorth.papers.drawing import sheet
from truenorth.papers.study import Study
from truenorth.papers.table import Table
from truenorth.papers.texts import read_texts

Array = NDArray[np.float64]

RUNS = 20
OVERSHOOT, SETTLING = 0.4, 90.0 * 60.0
EPOCH = 10.0  # s
ON = 2.5 * HOUR
CALM = ((6.5, 8.0), (11.5, 12.0), (15.5, 16.0), (21.0, 24.0))  # h: three hours and more after a change of speed
AFTER = ((8.3, 10.3), (12.3, 14.3), (16.3, 18.3))  # h: two hours from each
NAMES = {"undamped": "undamped", "second": "second order", "third": "third order", "fuzzy": "second order, fuzzy"}

TEXTS = read_texts(__file__)
RULES = TEXTS.rules


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count, table = runs or RUNS, Table()
    progress("design")
    designs = {name: design(order, OVERSHOOT, SETTLING) for name, order in (("second", 2), ("third", 3))}
    for name, found in designs.items():
        table.value("design", name, "overshoot", "value", found.overshoot, "1")
        table.value("design", name, "settling", "value", found.settling / 60.0, "min")
        table.value("design", name, "leak", "value", found.leak, "1")
    voyage = sail(EPOCH, seed, scenario="marine_manoeuvres")
    time, left = voyage.truth.time, {}
    sizes: dict[str, dict[str, list[float]]] = {name: {"calm": [], "manoeuvre": []} for name in NAMES}
    for run in range(count):
        progress(f"voyage {run + 1} of {count}")
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(6, run)))
        course = voyage.navigate(voyage.paper_errors() * drawn(rng.choice([-1.0, 1.0], 13)))
        free = errors_of(course, voyage.truth)[:, DV]
        second = designs["second"].network
        mu = FuzzyDamping().of_course(course, second)
        left = {
            "undamped": free,
            "second": free - network_correction(course, Loop(second), start=ON)[:, DV],
            "third": free - network_correction(course, Loop(designs["third"].network), start=ON)[:, DV],
            "fuzzy": free - network_correction(course, Loop(second), start=ON, mu=mu)[:, DV],
        }
        for name, v in left.items():
            size = np.linalg.norm(v, axis=1)
            sizes[name]["calm"].append(math.sqrt(np.mean(size[_within(time, CALM)] ** 2)))
            sizes[name]["manoeuvre"].append(float(size[_within(time, AFTER)].max()))
    for name, kinds in sizes.items():
        for quantity, values in kinds.items():
            table.errors("voyage", name, quantity, np.array(values), "m/s", statistics=("rms", "max"))
    drawings = {"networks": draw_networks(designs), "voyage": draw_voyage(time, left)}
    return TEXTS.study(table, drawings, overshoot=OVERSHOOT, settling=SETTLING / 60)


def _within(time: Array, spans: tuple[tuple[float, float], ...]) -> NDArray[np.bool_]:
    inside = [(time >= a * HOUR) & (time < b * HOUR) for a, b in spans]
    return np.asarray(np.any(inside, axis=0))


def draw_networks(designs: Mapping[str, Design]) -> Figure:
    """Step responses with their overshoot, and the amplitude of H and of 1 - H."""
    time, rate = np.arange(0.0, SPAN / 2, 60.0), SCHULER_RATE * np.geomspace(0.02, 50.0, 300)
    with sheet(12.0, 4.2, 1, 3, legend=2) as (figure, (step, bode, leak)):
        for (name, found), colour in zip(designs.items(), COLOURS, strict=False):
            y = step_response(found.network, time)
            words = f"{NAMES[name]}: overshoot {found.overshoot:.0%}, settled in {found.settling / 60.0:.0f} min"
            step.plot(time / 60.0, y, color=colour, label=words)
            H = found.network.response(1j * rate)
            bode.plot(rate, np.abs(H), color=colour)
            leak.plot(rate, np.abs(1.0 - H), color=colour)
        step.axhline(1.0, color=REFERENCE, linewidth=0.8)
        step.axvline(SETTLING / 60.0, color=REFERENCE, linewidth=0.8, linestyle="--")
        step.set(
            xlabel="time, min", title="Step response, final value 1", ylim=(0.0, None), xlim=(0.0, time[-1] / 60.0)
        )
        for ax, title in ((bode, "|H|"), (leak, "|1 - H|, the leak")):
            ax.axvline(SCHULER_RATE, color=REFERENCE, linewidth=0.8, linestyle=":")
            ax.set(xscale="log", yscale="log", xlabel="rad/s", title=title)
        bode.set_yticks([0.5, 1.0, 2.0, 5.0], ["0.5", "1", "2", "5"])
        leak.set_yticks([0.03, 0.1, 0.3, 1.0, 3.0], ["0.03", "0.1", "0.3", "1", "3"])
        for ax in (bode, leak):
            ax.tick_params(axis="y", which="minor", left=False, labelleft=False)
    return figure


def draw_voyage(time: Array, left: Mapping[str, Array]) -> Figure:
    """Size of the velocity error of one voyage."""
    with sheet(10.0, 4.2, legend=4) as (figure, ax):
        for (name, v), colour in zip(left.items(), ("#BBBBBB", *COLOURS), strict=False):
            ax.plot(time / HOUR, np.linalg.norm(v, axis=1), color=colour, linewidth=1.0, label=NAMES[name])
        for a, b in AFTER:
            ax.axvspan(a, b, color=REFERENCE, alpha=0.08, linewidth=0.0)
        ax.set(xlabel="time, h", ylabel="velocity error, m/s", yscale="log", ylim=(0.05, None), xlim=(0.0, 24.0))
        ax.set_xticks(range(0, 25, 4))
    return figure
