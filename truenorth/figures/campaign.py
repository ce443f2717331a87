"""Figures of a campaign: how errors shrink, how they scatter, which method does where, and what a requirement costs."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.campaign.requirement import Requirement, heading_at_end, requirements
from truenorth.figures.style import COLOURS, REFERENCE, headed, new_figure, style

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.campaign import Campaign

Array = NDArray[np.float64]
SHOWN = {"phi_u": "heading", "level": "level"}  # quantities worth a figure, and how people call them
FANS = ((5, 95), (25, 75))  # percentiles
MOST_CASES = 12  # on one figure
SMALL = 1e-4  # arcmin: below it a logarithmic axis shows nothing


def plot_campaign(campaign: Campaign) -> dict[str, Figure]:
    """Every figure that the campaign's plan gives reason to.

    Returns
    -------
    dict of str to matplotlib.figure.Figure
        ``distribution`` and ``overview`` always; ``convergence`` where there are several times, ``requirement`` where a
        parameter of the grid has several values with numbers.
    """
    table = campaign.table
    with style():
        figures = {"distribution": plot_distribution(campaign), "overview": plot_overview(campaign)}
        if table["time_s"].nunique() > 1:
            figures["convergence"] = plot_convergence(campaign)
        for found in requirements(campaign):
            figures[f"requirement_{re.sub(r'[^A-Za-z0-9]+', '_', found.path)}"] = plot_requirement(campaign, found)
    return figures


def plot_convergence(campaign: Campaign) -> Figure:
    """Magnitude of the heading error over the length of the log: median and percentile fans, compared with the claimed sigma."""
    cases = list(campaign.case_names.items())[:MOST_CASES]
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure = new_figure(4.6 * columns + 0.4, 3.4 * rows + 0.6)
    axes = figure.subplots(rows, columns, squeeze=False, sharey=True)
    for ax, (case, name) in zip(axes.flat, cases, strict=False):
        for at, method in enumerate(campaign.plan.method_names):
            rows_of = _rows(campaign.table, case, method, "phi_u")
            if len(rows_of):
                _fan(ax, rows_of, method, *_look(at))
        _bound(ax, campaign.summary, case)
        if not ax.lines:
            _no_answer(ax)
        ax.set(yscale="log", title=name, xlabel="length of the log, s")
    for ax in axes[:, 0]:
        ax.set_ylabel("|heading error|, arcmin")
    for ax in axes.flat[len(cases) :]:
        ax.set_visible(False)
    drawn = {label: line for ax in axes.flat for line, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.legend(list(drawn.values()), list(drawn), loc="outside lower left", ncols=4)
    _title(
        figure,
        campaign,
        f"median with {FANS[1][0]}-{FANS[1][1]} % and {FANS[0][0]}-{FANS[0][1]} % of runs; dashed: claimed sigma",
    )
    return figure


def _bound(ax: Axes, summary: pd.DataFrame, case: int) -> None:
    """The Cramer-Rao bound of heading, for the figure's other lines to be held against."""
    rows = summary[(summary["case"] == case) & (summary["quantity"] == "phi_u") & summary["bound"].notna()]
    rows = rows.drop_duplicates("time_s").sort_values("time_s")
    if len(rows):
        ax.plot(rows["time_s"], rows["bound"], ":", color="black", linewidth=1.2, label="Cramer-Rao bound of one sigma")


def _no_answer(ax: Axes) -> None:
    """Say so in an empty panel, whose scale would mean nothing."""
    ax.text(0.5, 0.5, "no answer", ha="center", va="center", transform=ax.transAxes)
    ax.tick_params(axis="x", labelbottom=False)


def _look(at: int) -> tuple[str, str]:
    """Colour and marker of a method: the palette's colours again with another marker."""
    return COLOURS[at % len(COLOURS)], "os^D"[at // len(COLOURS) % 4]


def _fan(ax: Axes, rows: pd.DataFrame, method: str, colour: str, marker: str) -> None:
    groups = [(float(str(time)), group) for time, group in rows.groupby("time_s")]
    times = np.array([time for time, _ in groups])
    errors = [np.maximum(np.abs(group["value"].to_numpy(float)), SMALL) for _, group in groups]
    sigma = np.array([np.sqrt(np.mean(group["sigma"].to_numpy(float) ** 2)) for _, group in groups])
    for low, high in FANS:
        below, above = (np.array([np.percentile(e, q) for e in errors]) for q in (low, high))
        ax.fill_between(times, below, above, color=colour, alpha=0.16, linewidth=0)
    ax.plot(times, [np.median(e) for e in errors], "-", marker=marker, color=colour, markersize=3, label=method)
    ax.plot(times, sigma, "--", color=colour, linewidth=1.0)


def plot_distribution(campaign: Campaign) -> Figure:
    """Errors of heading and north tilt at the end of the log, a violin for each method, a column for each case."""
    methods, cases = campaign.plan.method_names, list(campaign.case_names.items())[:MOST_CASES]
    figure = new_figure(max(6.0, 1.0 + len(cases) * (0.7 + 0.75 * len(methods))), 7.0)
    axes = figure.subplots(2, len(cases), squeeze=False, sharex=True)
    for row, (quantity, label) in enumerate((("phi_u", "heading"), ("phi_n", "north tilt"))):
        for ax, (case, name) in zip(axes[row], cases, strict=True):
            found = [_last(_rows(campaign.table, case, method, quantity)) for method in methods]
            if not any(map(len, found)):
                ax.set_yticks([])
            for at, rows in enumerate(found):
                _violin(
                    ax, at, rows["value"].to_numpy(float), rows["sigma"].to_numpy(float), COLOURS[at % len(COLOURS)]
                )
            ax.axhline(0.0, color=REFERENCE, linewidth=0.8)
            ax.set(xlim=(-0.6, len(methods) - 0.4))
            ax.set_xticks(range(len(methods)), methods, rotation=30, ha="right")
            ax.tick_params(axis="x", labelbottom=row == 1)
            if row == 0:
                ax.set_title(_folded(name), fontsize=9)
        axes[row, 0].set_ylabel(f"{label} error, arcmin")
    key = axes[0, 0]
    key.plot([], [], color="black", marker="_", linestyle="none", markersize=12, label="± claimed sigma")
    figure.legend(*key.get_legend_handles_labels(), loc="outside lower left", ncols=4)
    _title(figure, campaign, "errors at the end of the log, estimated minus true; each panel to its own scale")
    return figure


def _violin(ax: Axes, at: int, values: Array, sigmas: Array, colour: str) -> None:
    if values.size == 0:
        across = ax.get_xaxis_transform()  # x of the data, y of the panel
        ax.text(at, 0.5, "no answer", ha="center", va="center", fontsize=8, rotation=90, transform=across)
        return
    if values.size > 3 and np.ptp(values) > 0:
        for body in ax.violinplot(values, [at], widths=0.85, showextrema=False)["bodies"]:  # type: ignore[attr-defined]
            body.set(facecolor=colour, alpha=0.5)
    else:
        ax.plot(np.full(values.size, at), values, "o", color=colour, markersize=4)
    sigma = float(np.sqrt(np.mean(sigmas**2)))
    ax.plot([at, at], [-sigma, sigma], color="black", marker="_", markersize=12, linestyle="none")


def plot_overview(campaign: Campaign) -> Figure:
    """Heading RMS, and RMS over the claimed sigma, of each method in each case, as a map with its numbers."""
    methods, cases = campaign.plan.method_names, campaign.case_names
    last = heading_at_end(campaign).set_index(["case", "method"])
    rms, ratio, answers = (
        np.array([[_cell(last, case, method, column) for method in methods] for case in cases])
        for column in ("rms", "rms_over_sigma", "runs")
    )
    runs = campaign.table["run"].nunique()
    figure = new_figure(4.5 + 1.9 * len(methods), 1.9 + 0.55 * len(cases))
    left, right = figure.subplots(1, 2, sharey=True)
    finite = rms[np.isfinite(rms) & (rms > 0)]
    norm = LogNorm(finite.min(), max(finite.max(), 1.001 * finite.min())) if finite.size else None
    left.imshow(rms, aspect="auto", cmap="viridis_r", norm=norm)
    right.imshow(ratio, aspect="auto", cmap="RdBu_r", norm=LogNorm(1 / 3, 3))
    for ax, values, title in ((left, rms, "Heading RMS, arcmin"), (right, ratio, "Heading RMS / claimed sigma")):
        ax.set_xticks(range(len(methods)), methods, rotation=20, ha="right")
        ax.set_title(title)
        ax.grid(False)
        for (i, j), value in np.ndenumerate(values):
            known = int(np.nan_to_num(answers[i, j]))
            text = f"{value:.3g}" if np.isfinite(value) else "no answer"
            text += f"\n{known} of {runs} runs" if 0 < known < runs else ""
            ax.text(
                j,
                i,
                text,
                ha="center",
                va="center",
                fontsize=9,
                bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 1.5},
            )
    left.set_yticks(range(len(cases)), [_folded(name) for name in cases.values()])
    _title(figure, campaign, "at the end of the log; a ratio of 1 is an honest sigma")
    return figure


def plot_requirement(campaign: Campaign, found: Requirement) -> Figure:
    """What heading error a value of a parameter leads to: RMS with its interval, the claimed sigma, and what is wanted."""
    values, lines = found.values, found.lines
    figure = new_figure(7.5, 5.0)
    ax = figure.subplots()
    for at, line in enumerate(lines):
        colour, marker = _look(at)
        ax.errorbar(values, line.rms, line.bars, fmt=f"{marker}-", color=colour, capsize=3, label=line.name)
        ax.plot(values, line.sigma, "--", color=colour, linewidth=1.0)
    wanted = np.degrees(campaign.plan.converged)
    ax.axhline(60 * wanted, color=REFERENCE, linestyle=":", linewidth=1.2, label=f"wanted: {wanted:g} deg")
    ax.set_xscale("log")
    ax.set_xticks(values, [f"{value:g}" for value in values])
    ax.minorticks_off()
    ax.margins(x=0.08)
    ax.set(yscale="log", xlabel=found.words, ylabel="heading RMS, arcmin")
    ax.legend()
    _title(figure, campaign, "with its 95 % interval; dashed: claimed sigma")
    return figure


def _rows(table: pd.DataFrame, case: int, method: str, quantity: str) -> pd.DataFrame:
    return table[(table["case"] == case) & (table["method"] == method) & (table["quantity"] == quantity)]


def _last(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["time_s"] == rows["time_s"].max()]


def _cell(summary: pd.DataFrame, case: int, method: str, column: str) -> float:
    if (case, method) not in summary.index:
        return np.nan
    return float(np.asarray(summary.loc[(case, method), column]))


def _folded(name: str) -> str:
    return name.replace(", ", "\n")


def _title(figure: Figure, campaign: Campaign, what: str) -> None:
    runs = campaign.table["run"].nunique()
    headed(figure, f"{campaign.plan.name}: {what}; {runs} runs")
