"""The figure of a search for a specification: what each trial's errors were, and whether its sigmas were honest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.units import parse
from truenorth.figures.style import COLOURS, REFERENCE, headed, new_figure, style
from truenorth.records.spec_keys import KEYS

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from truenorth.campaign.tuning import Tuned

DECADES = 30.0  # from so large a ratio of the values on, they are drawn on a logarithmic scale
MARKS = {True: (COLOURS[0], "o", "honest"), False: (COLOURS[1], "x", "not honest")}


def plot_tuning(result: Tuned) -> Figure:
    """Draw RMS with its 95 % interval and RMS over sigma of all trials, over each term that was searched."""
    terms, search = list(result.search.search), result.search
    with style():
        figure = new_figure(max(6.0, 4.2 * len(terms)), 6.5)
        axes = figure.subplots(2, len(terms), squeeze=False, sharex="col", sharey="row")
        answered = result.trials[np.isfinite(result.trials["rms"])]
        for (above, below), term in zip(axes.T, terms, strict=True):
            group, key = term.split(".")
            entry = KEYS[group][key]
            unit = parse(f"1 {entry.unit}", entry.dimension)
            for honest in MARKS:
                rows = answered[answered["in_band"] == honest]
                _trials(above, below, rows[term] / unit, rows, honest)
            low, high = (parse(text, entry.dimension) / unit for text in search.search[term])
            below.set(xscale="log", xlim=(low, high), xlabel=f"{term}, {entry.unit}")
            below.axhline(1.0, color=REFERENCE, linestyle="--", linewidth=1.0)
            chosen = getattr(result.spec, f"{group}_{key}") / unit
            for ax in (above, below):
                ax.axvline(chosen, color=COLOURS[2], linewidth=1.5, label="chosen")
        axes[0, 0].set_ylabel(f"RMS of {search.quantity}, arcmin")
        axes[1, 0].set_ylabel("RMS / sigma")
        for ax, column in ((axes[0, 0], "rms"), (axes[1, 0], "rms_over_sigma")):
            if answered[column].max() > DECADES * answered[column].min():
                ax.set_yscale("log")
            else:
                ax.set_ylim(bottom=0.0)
        axes[0, 0].legend()
        headed(figure, f"{search.name}: {search.method}, {len(result.trials)} trials of {search.runs} runs; bars: 95 %")
    return figure


def _trials(above: Axes, below: Axes, values: pd.Series, rows: pd.DataFrame, honest: bool) -> None:
    colour, mark, label = MARKS[honest]
    if rows.empty:
        return
    bars = np.maximum([rows["rms"] - rows["rms_low"], rows["rms_high"] - rows["rms"]], 0.0)
    above.errorbar(values, rows["rms"], bars, fmt=mark, color=colour, capsize=2, linewidth=0.8, label=label)
    below.plot(values, rows["rms_over_sigma"], linestyle="", marker=mark, color=colour)
