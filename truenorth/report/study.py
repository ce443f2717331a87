"""The page of a reproduced study: the paper's figures next to ours, drawings, claims with their verdicts, every figure."""

from __future__ import annotations

import io
from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from truenorth.core.language import translated as _
from truenorth.report.document import render

if TYPE_CHECKING:
    import pandas as pd

MANY_A_ROW = 4  # quantities of one case, method and time, from which each has a column
BEST_FIRST = ("holds", "holds in part", "does not hold", "too few runs")


def study_page(
    study: Any, compared: pd.DataFrame, of_paper: Sequence[str], more: Sequence[str], table: pd.DataFrame
) -> str:
    """HTML text of the page; drawings are inside, so that it works offline.

    Parameters
    ----------
    study : Study
        Title, claims, drawings, captions, remarks.
    compared : DataFrame
        The paper's figures, ours next to them.
    of_paper, more : sequences of str
        Names of the drawings that are the paper's own, and of the others.
    table : DataFrame
        Every figure.
    """

    def drawn(names: Sequence[str]) -> list[tuple[str, str, str]]:
        return [(n.replace("_", " "), study.captions.get(n, ""), _inline(study.drawings[n])) for n in names]

    contents = [_("Verdict")] if compared.empty else [_("Verdict"), _("The paper's figures, ours next to them")]
    contents += [_spelt(name) for name in of_paper]
    contents += [_("Claims"), *(_spelt(name) for name in more)] + ([_("Remarks")] if study.remarks else [])
    return render(
        "study.html",
        interactive=False,
        study=study,
        of_a_paper=any(claim.by == "paper" for claim in study.claims),
        summary=_summary(study.claims),
        compared="" if compared.empty else _html(across(compared)),
        of_paper=drawn(of_paper),
        more=drawn(more),
        table=_html(at_the_end(table)),
        contents=[*contents, _("Figures at the end")],
    )


def index_page(studies: Mapping[str, Any]) -> str:
    """HTML text of one page with every claim of every study, each linked to ``NAME/report.html``."""
    contents = [_("Verdict"), *(study.title for study in studies.values())]
    summaries = {name: _summary(study.claims) for name, study in studies.items()}
    every = _summary([claim for study in studies.values() for claim in study.claims])
    return render(
        "studies.html", interactive=False, studies=studies, contents=contents, summary=every, summaries=summaries
    )


def at_the_end(table: pd.DataFrame) -> pd.DataFrame:
    """Figures of the latest time of each quantity: a browser has no room for those of all times, tens of thousands of rows."""
    keys = [name for name in table.columns if name in ("case", "method", "noise", "quantity", "statistic")]
    if "time_s" not in table.columns or not keys:
        return table
    latest = table.groupby(keys, dropna=False, sort=False)["time_s"].transform("max")
    return table[table["time_s"].isna() | (table["time_s"] == latest)]


def across(compared: pd.DataFrame) -> pd.DataFrame:
    """The paper's figures as its tables have them: a column for each quantity, ``ours (the paper's)``.

    Of few quantities the list stays as it is: case by case and quantity by quantity.
    """
    keys = ["case", "method", "statistic", "time_s"]
    rows = compared.drop_duplicates(keys)
    if len(compared) < MANY_A_ROW * len(rows) or compared.duplicated([*keys, "quantity"]).any():
        return compared
    cells = compared.assign(
        quantity=[
            f"{name}, {unit}: ours (the paper's)"
            for name, unit in zip(compared["quantity"], compared["unit"], strict=True)
        ],
        time_s=compared["time_s"].map("{:g}".format),
        cell=[f"{a:.4g} ({b:.4g})" for a, b in zip(compared["ours"], compared["the paper's"], strict=True)],
    )
    table = cells.pivot_table(index=keys, columns="quantity", values="cell", aggfunc="first", sort=False)
    return table[list(dict.fromkeys(cells["quantity"]))].reset_index().rename_axis(None, axis=1)


def _summary(claims: Sequence[Any]) -> str:
    """How many of the claims have which verdict."""
    settled = Counter(claim.verdict for claim in claims)
    verdicts = ", ".join(f"{settled[verdict]} × {_(verdict)}" for verdict in BEST_FIRST if settled[verdict])
    return _("Of {count} claims: {verdicts}.").format(count=len(claims), verdicts=verdicts)


def _spelt(name: str) -> str:
    return name.replace("_", " ").capitalize()


def _html(frame: pd.DataFrame) -> str:
    return str(frame.to_html(index=False, na_rep="", float_format="{:.4g}".format, border=0))


def _inline(drawing: Any) -> str:
    buffer = io.BytesIO()
    drawing.savefig(buffer, format="png")
    return b64encode(buffer.getvalue()).decode()
