"""The page and the files of a campaign: tables, figures, and one HTML page that works offline."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

from truenorth.core.atomic import write_text
from truenorth.core.language import translated as _
from truenorth.core.shown import Write
from truenorth.report.campaign_charts import campaign_panels, findings
from truenorth.report.document import Table, render
from truenorth.report.numbers import short

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.campaign import Campaign

COLUMNS = {
    "name": "case",
    "method": "method",
    "time_s": "log, s",
    "runs": "runs",
    "failed": "failed",
    "rms": "RMS",
    "interval": "95 % interval",
    "median": "median",
    "p95": "95th percentile",
    "bound": "Cramer-Rao bound",
    "rms_over_bound": "RMS/bound",
    "sigma": "claimed sigma",
    "rms_over_sigma": "RMS/sigma",
    "band": "95 % band",
}


def campaign_files(campaign: Campaign) -> dict[str, Write]:
    """Tables (summary, comparison, outcomes, convergence), figures as PNG and report.html; see :func:`truenorth.save`."""
    from truenorth.campaign.summary import outcomes
    from truenorth.core.shown import can_draw

    tables = {
        "summary.csv": campaign.summary,
        "comparison.csv": campaign.comparison,
        "outcomes.csv": outcomes(campaign.table, campaign.case_names),
        "convergence.csv": campaign.convergence,
    }
    files: dict[str, Write] = {name: partial(table.to_csv, index=False) for name, table in tables.items()}
    if can_draw():
        from truenorth.figures.campaign import plot_campaign

        files |= {f"{name}.png": figure.savefig for name, figure in plot_campaign(campaign).items()}
    files["report.html"] = lambda path: write_text(path, campaign_page(campaign, tables))
    return files


def campaign_page(campaign: Campaign, tables: dict[str, pd.DataFrame]) -> str:
    """HTML text of the page; everything is inside, so that it works offline."""
    import yaml

    plan = campaign.plan
    shown, panels = _tables(campaign, tables), campaign_panels(campaign)
    mood, finding, lines = findings(campaign)
    return render(
        "campaign.html",
        interactive=bool(panels),
        plan=plan,
        mood=mood,
        finding=finding,
        lines=lines,
        panels=panels,
        tables=shown,
        resolved=yaml.safe_dump(plan.to_mapping(), sort_keys=False, allow_unicode=True, width=110),
        contents=[_("Finding"), *(p.title for p in panels), *(t.title for t in shown), _("Plan")],
    )


def _tables(campaign: Campaign, tables: dict[str, pd.DataFrame]) -> list[Table]:
    summary, comparison, outcomes = (tables[f"{name}.csv"] for name in ("summary", "comparison", "outcomes"))
    comparison = _at_the_end(comparison[comparison["quantity"] == "phi_u"])
    text = frozenset({0, 1})
    found = [
        Table(_("Heading error at the end of the log, arcmin"), *_accuracy(summary, "phi_u"), words=text),
        Table(
            _("Level error (both tilts together) at the end of the log, arcmin"),
            *_accuracy(summary, "level"),
            words=text,
        ),
        Table(
            _("Is sigma honest? NEES and NIS at the end of the log"),
            [_("case"), _("method"), _("runs"), "NEES", _("95 % band"), "NIS", _("95 % band")],
            _consistency(summary),
            _(
                "Means over components: 1 where sigma is honest, above it where sigma is too small. The band of NIS is that of "
                "independent innovations; a method that allows for a base that sways stays below it on one that does not."
            ),
            text,
        ),
        Table(
            _("Methods in pairs, heading, run by run"),
            [
                _("case"),
                _("log, s"),
                _("pair"),
                _("runs"),
                _("wins of the first"),
                _("median difference, arcmin"),
                _("ratio of RMS"),
                _("sign test p"),
            ],
            [_compared(row) for row in comparison.to_dict("records")],
            words=frozenset({0, 2}),
        ),
        Table(
            _("Length of log until heading stays within {limit:g} deg").format(
                limit=math.degrees(campaign.plan.converged)
            ),
            [_("case"), _("method"), _("runs"), _("converged"), _("median, s"), _("95 % of runs, s")],
            [_converged(row) for row in tables["convergence.csv"].to_dict("records")] if campaign.plan.times else [],
            _("Among the times of the plan."),
            text,
        ),
        _endings(_at_the_end(outcomes)),
    ]
    return [table for table in found if table.rows]


def _endings(outcomes: pd.DataFrame) -> Table:
    """How many runs ended how, and why; what is said of aligned runs are the figures of one of them, and is left out."""
    headings = [_("case"), _("method"), _("log, s"), _("status"), _("runs"), _("commonest reason")]
    rows = [
        [
            *(str(r["name"]), str(r["method"]), f"{r['time_s']:g}", str(r["status"]), str(r["runs"])),
            "" if r["status"] == "aligned" else str(r["reason"]),
        ]
        for r in outcomes.to_dict("records")
    ]
    if not any(row[-1] for row in rows):
        headings, rows = headings[:-1], [row[:-1] for row in rows]
    return Table(_("How the runs ended"), headings, rows, words=frozenset({0, 1, 3, 5}))


def _at_the_end(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of the longest log of each case."""
    return rows[rows["time_s"] == rows.groupby("case")["time_s"].transform("max")]


def _accuracy(summary: pd.DataFrame, quantity: str) -> tuple[list[str], list[list[str]]]:
    """Headings and rows at the end of the log, without columns that no row fills; the earlier times stand in summary.csv."""
    chosen = summary[summary["quantity"] == quantity]
    last = _at_the_end(chosen)
    rows = []
    for row in last.to_dict("records"):
        row["interval"] = f"{short(row['rms_low'])} to {short(row['rms_high'])}" if row["runs"] > 1 else ""
        ratio = row.get("rms_over_sigma")
        row["band"] = f"{row['ratio_low']:.2f} to {row['ratio_high']:.2f}" if ratio == ratio else ""
        rows.append([_text(row.get(column)) for column in COLUMNS])
    filled = [i for i, cells in enumerate(zip(*rows, strict=True)) if any(cells)]
    headings = [_(words) for words in COLUMNS.values()]
    return [headings[i] for i in filled], [[row[i] for i in filled] for row in rows]


def _consistency(summary: pd.DataFrame) -> list[list[str]]:
    """Mean NEES and NIS with their bands at the end of the log; a dash where a method has no innovations."""
    chosen = summary[summary["quantity"].isin(["nees", "nis"])]
    last = _at_the_end(chosen)
    rows = []
    for (name, method), pair in last.groupby(["name", "method"], observed=True, sort=False):
        found = {row["quantity"]: row for row in pair.to_dict("records")}
        cells = [str(name), str(method), str(found["nees"]["runs"])]
        for quantity in ("nees", "nis"):
            row = found.get(quantity)
            cells += (
                ["–", ""]
                if row is None
                else [f"{row['mean']:.3g}", f"{row['ratio_low']:.2f} to {row['ratio_high']:.2f}"]
            )
        rows.append(cells)
    return rows


def _compared(row: dict[Any, Any]) -> list[str]:
    p = row["p_value"]
    return [
        str(row["name"]),
        f"{row['time_s']:g}",
        _("{first} against {second}").format(first=row["method"], second=row["against"]),
        str(row["runs"]),
        f"{row['win_rate']:.0%}",
        f"{row['median_difference']:+.3g}",
        f"{row['ratio']:.3g}",
        "< 0.0001" if p < 1e-4 else f"{p:.4f}",
    ]


def _converged(row: dict[Any, Any]) -> list[str]:
    share = f"{100 * row['converged']:.0f} %"
    reached = [f"{row[key]:g}" if math.isfinite(row[key]) else _("not reached") for key in ("median_s", "p95_s")]
    return [str(row["name"]), str(row["method"]), str(row["runs"]), share, *reached]


def _text(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.3g}"
    return str(value)
