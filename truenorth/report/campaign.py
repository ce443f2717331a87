"""The page and the files of a campaign: tables, figures, and one HTML page that works offline."""

from __future__ import annotations

import base64
import io
import math
from functools import partial
from typing import TYPE_CHECKING, Any

from truenorth.core.shown import Write

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from truenorth.campaign import Campaign

CAPTIONS = {
    "convergence": "How the heading error shrinks with the length of the log. Where the dashed line lies far from the "
    "fan's middle, the claimed sigma is not honest.",
    "distribution": "Errors of all runs at the end of the log. The strokes are the root mean square of the claimed sigmas: "
    "about two thirds of each violin should lie between them.",
    "overview": "Each method in each case. Blue ratios: sigma claimed too large; red: too small.",
}
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
    from truenorth.figures.campaign import plot_campaign

    tables = {
        "summary.csv": campaign.summary,
        "comparison.csv": campaign.comparison,
        "outcomes.csv": outcomes(campaign.table, campaign.case_names),
        "convergence.csv": campaign.convergence,
    }
    figures = plot_campaign(campaign)
    files: dict[str, Write] = {name: partial(table.to_csv, index=False) for name, table in tables.items()}
    files |= {f"{name}.png": figure.savefig for name, figure in figures.items()}
    files["report.html"] = lambda path: path.write_text(campaign_page(campaign, tables, figures), encoding="utf-8")
    return files


def campaign_page(campaign: Campaign, tables: dict[str, pd.DataFrame], figures: dict[str, Figure]) -> str:
    """HTML text of the page; figures are inside, so that it works offline."""
    import yaml
    from jinja2 import Environment, PackageLoader

    from truenorth.core.version import __version__

    environment = Environment(
        loader=PackageLoader("truenorth.report", "templates"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    plan = campaign.plan
    comparison, outcomes = tables["comparison.csv"], tables["outcomes.csv"]
    comparison = comparison[comparison["quantity"] == "phi_u"]
    comparison = comparison[comparison["time_s"] == comparison.groupby("case")["time_s"].transform("max")]
    outcomes = outcomes[outcomes["time_s"] == outcomes.groupby("case")["time_s"].transform("max")]
    return environment.get_template("campaign.html").render(
        plan=plan,
        cases=len(plan.cases),
        runs=int(campaign.table["run"].nunique()),
        headings=list(COLUMNS.values()),
        heading=_accuracy(tables["summary.csv"], "phi_u"),
        level=_accuracy(tables["summary.csv"], "level"),
        consistency=_consistency(tables["summary.csv"]),
        comparison=[_compared(row) for row in comparison.to_dict("records")],
        outcomes=outcomes.to_dict("records"),
        convergence=tables["convergence.csv"].to_dict("records") if plan.times else [],
        limit=f"{math.degrees(plan.converged):g} deg",
        figures=[
            (name.replace("_", " ").capitalize(), CAPTIONS.get(name, ""), _inline(f)) for name, f in figures.items()
        ],
        resolved=yaml.safe_dump(plan.to_mapping(), sort_keys=False, allow_unicode=True, width=110),
        version=__version__,
    )


def _accuracy(summary: pd.DataFrame, quantity: str) -> list[list[str]]:
    """Rows of the table at the end of the log; the earlier times stand in summary.csv."""
    chosen = summary[summary["quantity"] == quantity]
    last = chosen[chosen["time_s"] == chosen.groupby("case")["time_s"].transform("max")]
    rows = []
    for row in last.to_dict("records"):
        row["interval"] = f"{row['rms_low']:.3g} - {row['rms_high']:.3g}" if row["runs"] > 1 else ""
        ratio = row.get("rms_over_sigma")
        row["band"] = f"{row['ratio_low']:.2f} - {row['ratio_high']:.2f}" if ratio == ratio else ""
        rows.append([_text(row.get(column)) for column in COLUMNS])
    return rows


def _consistency(summary: pd.DataFrame) -> list[list[str]]:
    """Mean NEES and NIS with their bands at the end of the log; a dash where a method has no innovations."""
    chosen = summary[summary["quantity"].isin(["nees", "nis"])]
    last = chosen[chosen["time_s"] == chosen.groupby("case")["time_s"].transform("max")]
    rows = []
    for (name, method), pair in last.groupby(["name", "method"], observed=True, sort=False):
        found = {row["quantity"]: row for row in pair.to_dict("records")}
        cells = [str(name), str(method), str(found["nees"]["runs"])]
        for quantity in ("nees", "nis"):
            row = found.get(quantity)
            cells += (
                ["–", ""]
                if row is None
                else [f"{row['mean']:.3g}", f"{row['ratio_low']:.2f} - {row['ratio_high']:.2f}"]
            )
        rows.append(cells)
    return rows


def _compared(row: dict[Any, Any]) -> dict[str, str]:
    p = row["p_value"]
    return {
        "name": str(row["name"]),
        "time": f"{row['time_s']:g}",
        "pair": f"{row['method']} against {row['against']}",
        "runs": str(row["runs"]),
        "win_rate": f"{row['win_rate']:.0%}",
        "difference": f"{row['median_difference']:+.3g}",
        "ratio": f"{row['ratio']:.3g}",
        "p": "< 0.0001" if p < 1e-4 else f"{p:.4f}",
    }


def _text(value: Any) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.3g}"
    return str(value)


def _inline(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return base64.b64encode(buffer.getvalue()).decode()
