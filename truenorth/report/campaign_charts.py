"""What a campaign found, in sentences, and its interactive charts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.requirement import Requirement, heading_at_end, requirements
from truenorth.core.language import translated as _
from truenorth.report.chart import Chart
from truenorth.report.document import Panel
from truenorth.report.numbers import short

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.campaign import Campaign

Array = NDArray[np.float64]

FAN = (5, 95)  # percentiles
MOST_CASES = 12  # with charts of their own
SMALL = 1e-4  # arcmin: below it a logarithmic axis says nothing
MUCH_TOO_SMALL = 2.0  # RMS over sigma, above which a claimed sigma misleads
CHANCE = 0.05  # of a sign test


def findings(campaign: Campaign) -> tuple[str, str, list[str]]:
    """Mood, the finding in a sentence, and what else there is to say of the heading at the end of the log."""
    plan = campaign.plan
    last = heading_at_end(campaign)
    lines = [
        _(
            "Cases: {cases}; methods: {methods}; runs of each: {runs}; seed: {seed}. Every method meets the same data."
        ).format(
            cases=len(plan.cases), methods=len(plan.methods), runs=int(campaign.table["run"].nunique()), seed=plan.seed
        )
    ]
    if last.empty:
        return "bad", _("No run has an answer for the heading."), lines
    best = last.loc[last.groupby("case")["rms"].idxmin()]
    wins = best["method"].astype(str).value_counts()
    winner, first = str(wins.index[0]), best.iloc[0]
    low, high = float(best["rms"].min()), float(best["rms"].max())
    if len(best) == 1 and len(plan.methods) == 1:
        finding = _("“{method}” finds the heading to {rms} arcmin (RMS of {runs} runs).").format(
            method=winner, rms=short(low), runs=int(first["runs"])
        )
    elif len(best) == 1:
        finding = _("“{method}” has the smallest heading error: {rms} arcmin (RMS of {runs} runs).").format(
            method=winner, rms=short(low), runs=int(first["runs"])
        )
    elif len(plan.methods) == 1:
        finding = _("“{method}” finds the heading to {low} to {high} arcmin (RMS), depending on the case.").format(
            method=winner, low=short(low), high=short(high)
        )
    else:
        finding = _(
            "“{method}” has the smallest heading error in {wins} of {cases} cases. The best of each case is {low} to {high} "
            "arcmin (RMS)."
        ).format(method=winner, wins=int(wins.iloc[0]), cases=len(best), low=short(low), high=short(high))
    wanted = 60.0 * float(np.degrees(plan.converged))
    met = best[best["rms"] <= wanted]
    lines.append(
        _("The wanted {wanted} arcmin (RMS) is met in {count} of {all} cases.").format(
            wanted=short(wanted), count=len(met), all=len(best)
        )
    )
    if len(plan.methods) > 1:
        lines.append(_sure(campaign, best))
    mood, honesty = _honesty(last)
    lines.append(honesty)
    failed = int(last["failed"].sum())
    if failed:
        lines.append(_("Runs without an answer: {count}; the last table says why.").format(count=failed))
        mood = "fair" if mood == "good" else mood
    return mood, finding, lines


def _sure(campaign: Campaign, best: pd.DataFrame) -> str:
    """In how many cases the best method wins against every other by more than chance."""
    pairs = campaign.comparison
    pairs = pairs[
        (pairs["quantity"] == "phi_u") & (pairs["time_s"] == pairs.groupby("case")["time_s"].transform("max"))
    ]
    sure = 0
    for case, method in zip(best["case"], best["method"].astype(str), strict=True):
        own = pairs[(pairs["case"] == case) & ((pairs["method"] == method) | (pairs["against"] == method))]
        sure += bool(len(own) and (own["p_value"] < CHANCE).all())
    return _("The best method leads every other by more than chance in {count} of {all} (sign test, 5 %).").format(
        count=sure, all=len(best)
    )


def _honesty(last: pd.DataFrame) -> tuple[str, str]:
    """Mood, and a sentence on whether the errors are as large as claimed."""
    ratio = last["rms_over_sigma"].to_numpy(float)
    small, large = ratio > last["ratio_high"].to_numpy(float), ratio < last["ratio_low"].to_numpy(float)
    if not small.any() and not large.any():
        return "good", _("Sigma is honest: the errors are as large as claimed in every case, within the 95 % band.")
    worst = last.iloc[int(np.nanargmax(np.where(small, ratio, -1.0)))] if small.any() else None
    if worst is not None:
        words = _(
            "Sigma is too small in {count} of {all}: {method} in {case} has errors {ratio} times what it claims."
        ).format(
            count=int(small.sum()),
            all=len(last),
            method=worst["method"],
            case=worst["name"],
            ratio=short(float(ratio.max())),
        )
        return ("bad" if float(ratio.max()) > MUCH_TOO_SMALL else "fair"), words
    return "good", _("Sigma is larger than the errors in {count} of {all}: safe, but wider than it need be.").format(
        count=int(large.sum()), all=len(last)
    )


def campaign_panels(campaign: Campaign) -> list[Panel]:
    """Convergence over the length of the log, errors at its end, and what a requirement costs: where the plan has them."""
    shown = []
    if campaign.table["time_s"].nunique() > 1:
        shown += _convergence(campaign)
    shown.append(_distribution(campaign))
    return shown + [_requirement(campaign, found) for found in requirements(campaign)]


def _convergence(campaign: Campaign) -> list[Panel]:
    caption = _(
        "Magnitude of the heading error over the length of the log: median, with 5 to 95 % of the runs. Dashed: the claimed sigma; "
        "dotted: the Cramer-Rao bound. Where the dashed line lies far from the band's middle, the claimed sigma is not honest."
    )
    panels = []
    for case, name in list(campaign.case_names.items())[:MOST_CASES]:
        chart = Chart([_("heading error, arcmin")], _("length of the log, s"), height=360)
        for number, method in enumerate(campaign.plan.method_names):
            rows = _rows(campaign.table, case, method)
            if len(rows):
                _fan(chart, rows, method, *_look(number))
        bound = campaign.summary
        bound = bound[(bound["case"] == case) & (bound["quantity"] == "phi_u") & bound["bound"].notna()]
        bound = bound.drop_duplicates("time_s").sort_values("time_s")
        if len(bound):
            chart.line(0, bound["time_s"], bound["bound"], "ref", _("Cramer-Rao bound"), dash="dot", key=True)
        chart.axis(0, type="log")
        panels.append(Panel(_("Convergence: {case}").format(case=name), caption, chart))
    return panels


def _look(number: int) -> tuple[str, str]:
    """Colour and marker of a method: the six colours again with another marker."""
    return f"c{number % 6}", ("circle", "square", "triangle-up", "x")[number // 6 % 4]


def _fan(chart: Chart, rows: pd.DataFrame, method: str, colour: str, symbol: str) -> None:
    groups = [(float(str(time)), group) for time, group in rows.groupby("time_s")]
    times = np.array([time for time, _group in groups])
    errors = [np.maximum(np.abs(group["value"].to_numpy(float)), SMALL) for _time, group in groups]
    sigma = np.array([np.sqrt(np.mean(group["sigma"].to_numpy(float) ** 2)) for _time, group in groups])
    low, high = (np.array([np.percentile(e, q) for e in errors]) for q in FAN)
    chart.band(0, times, low, high, colour)
    chart.points(0, times, [np.median(e) for e in errors], colour, method, size=6, symbol=symbol, key=True, joined=True)
    chart.line(0, times, sigma, colour, _("{method}, claimed sigma").format(method=method), dash="dash")


def _distribution(campaign: Campaign) -> Panel:
    """One row a case, one violin a method."""
    cases = list(campaign.case_names.items())[:MOST_CASES]
    chart = Chart([_folded(name) for _case, name in cases], _("method"), height=110 + 150 * len(cases))
    for row, (case, _name) in enumerate(cases):
        for number, method in enumerate(campaign.plan.method_names):
            rows = _rows(campaign.table, case, method)
            rows = rows[rows["time_s"] == rows["time_s"].max()]
            if len(rows):
                sigma = float(np.sqrt(np.mean(rows["sigma"].to_numpy(float) ** 2)))
                chart.violin(row, method, rows["value"].to_numpy(float), sigma, f"c{number % 6}")
    return Panel(
        _("Errors at the end of the log"),
        _(
            "Heading error of all runs, estimated minus true, arcmin. The bars are plus and minus one claimed sigma: about two "
            "thirds of each shape should lie between them."
        ),
        chart,
    )


def _requirement(campaign: Campaign, found: Requirement) -> Panel:
    path, values = found.path, found.values
    chart = Chart([_("heading RMS, arcmin")], found.words, height=400)
    for number, line in enumerate(found.lines):
        colour, symbol = _look(number)
        chart.points(
            0, values, line.rms, colour, line.name, size=6, symbol=symbol, key=True, error=line.bars, joined=True
        )
        chart.line(0, values, line.sigma, colour, _("{method}, claimed sigma").format(method=line.name), dash="dash")
    wanted = 60.0 * float(np.degrees(campaign.plan.converged))
    chart.line(
        0,
        values[[0, -1]],
        np.full(2, wanted),
        "ref",
        _("wanted: {limit} arcmin").format(limit=short(wanted)),
        dash="dot",
        key=True,
    )
    chart.axis(0, type="log")
    chart.across(type="log", tickvals=values.tolist(), ticktext=[f"{value:g}" for value in values])
    return Panel(
        _("What {path} costs").format(path=path.rpartition(".")[2].replace("_", " ")),
        _("RMS of the heading error with its 95 % interval. Dashed: the claimed sigma."),
        chart,
    )


def _rows(table: pd.DataFrame, case: int, method: str) -> pd.DataFrame:
    return table[(table["case"] == case) & (table["method"] == method) & (table["quantity"] == "phi_u")]


def _folded(name: str) -> str:
    return name.replace(", ", "<br>")
