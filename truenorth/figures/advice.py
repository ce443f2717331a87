"""How heading comes down with time in each scheme of positions, and what is left in the way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from truenorth.figures.style import COLOURS, REFERENCE, new_figure, style

if TYPE_CHECKING:
    from truenorth.advice.manoeuvres import ManoeuvreAdvice
    from truenorth.advice.positions import Advice

SMALL = 0.03  # sources with a smaller part of the variance in all schemes are drawn together


def plot_advice(advice: Advice) -> Figure:
    """Draw sigma of heading over the length of data, and the parts of its variance."""
    with style():
        figure = new_figure(12.0, 5.0)
        left, right = figure.subplots(1, 2, width_ratios=(1.2, 1.0))
        for number, scheme in enumerate(advice.schemes):
            left.plot(
                scheme.time, np.degrees(scheme.sigma) * 60, "o-", markersize=3, color=COLOURS[number], label=scheme.name
            )
            if scheme.reached is not None:
                left.plot(scheme.reached, np.degrees(advice.wanted) * 60, "D", markersize=7, color=COLOURS[number])
        left.axhline(np.degrees(advice.wanted) * 60, color=REFERENCE, linestyle="--", linewidth=1.0, label="wanted")
        left.set(xscale="log", yscale="log", xlabel="length of data, turns included, s", ylabel="one sigma, arcmin")
        left.set_title(f"Heading, IMU {advice.imu.name}, latitude {np.degrees(advice.position.lat):.1f} deg")
        left.margins(x=0.04)
        left.legend()

        names = list(dict.fromkeys(name for scheme in advice.schemes for name in scheme.share))
        large = [name for name in names if max(scheme.share.get(name, 0.0) for scheme in advice.schemes) >= SMALL]
        rows = np.arange(len(advice.schemes))
        start = np.zeros(len(rows))
        for number, name in enumerate([*large, "all others"]):
            part = np.array(
                [
                    1.0 - sum(scheme.share.get(n, 0.0) for n in large)
                    if name == "all others"
                    else scheme.share.get(name, 0.0)
                    for scheme in advice.schemes
                ]
            )
            colour = "#BBBBBB" if name == "all others" else COLOURS[number % len(COLOURS)]
            right.barh(rows, 100 * part, left=100 * start, height=0.6, color=colour, label=name)
            start += part
        at = [f"at {s.reached or s.least[0]:.0f} s" for s in advice.schemes]
        right.set_yticks(rows, [f"{s.name.split(',')[0]}\n{when}" for s, when in zip(advice.schemes, at, strict=True)])
        right.invert_yaxis()
        right.grid(axis="y", visible=False)
        right.set(xlabel="part of the variance of heading, %", title="What it is made of", xlim=(0, 100))
        right.legend(loc="upper center", bbox_to_anchor=(0.4, -0.16), ncols=2)
    return figure


def plot_manoeuvres(advice: ManoeuvreAdvice) -> Figure:
    """Draw heading's sigma over time in each manoeuvre, and the wanted one."""
    with style():
        figure = new_figure(8.0, 4.5)
        ax = figure.subplots()
        for (name, sigma), colour in zip(advice.heading_sigma.items(), COLOURS * 2):
            ax.plot(advice.time, 60 * np.degrees(sigma), color=colour, label=name)
        ax.axhline(60 * np.degrees(advice.wanted), color=REFERENCE, linestyle="--", label="wanted")
        ax.axvline(advice.begun, color=REFERENCE, linestyle=":", linewidth=1.0)
        ax.set(yscale="log", xlabel="time, s", ylabel="heading, one sigma, arcmin")
        ax.set_title(f"Heading by transfer alignment; each manoeuvre begins at {advice.begun:.0f} s")
        ax.margins(x=0.0)
        figure.legend(*ax.get_legend_handles_labels(), loc="outside lower left", ncols=4)
    return figure
