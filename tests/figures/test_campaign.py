"""Figures and page of a campaign with more methods than the palette has colours."""

import io
import re
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from truenorth.figures.campaign import plot_convergence, plot_distribution
from truenorth.figures.style import new_figure, style
from truenorth.report.campaign import _endings
from truenorth.report.campaign_charts import _convergence

METHODS = [f"method {number}" for number in range(10)]


@pytest.fixture(scope="module")
def campaign():
    rng = np.random.default_rng(1)
    rows = [
        {"case": 0, "method": method, "run": run, "time_s": time, "quantity": quantity, "value": value, "sigma": 1.0}
        for method in METHODS
        for time in (60.0, 120.0)
        for run, value in enumerate(rng.standard_normal(5))
        for quantity in ("phi_u", "phi_n")
    ]
    summary = pd.DataFrame({"case": [0], "quantity": ["phi_u"], "time_s": [60.0], "bound": [np.nan]})
    plan = SimpleNamespace(name="ten", method_names=METHODS)
    return SimpleNamespace(plan=plan, case_names={0: "rest"}, table=pd.DataFrame(rows), summary=summary)


def test_every_method_is_drawn_and_looks_like_no_other(campaign):
    (ax,) = plot_convergence(campaign).axes
    looks = {
        line.get_label(): (line.get_color(), line.get_marker()) for line in ax.lines if line.get_marker() != "None"
    }
    assert list(looks) == METHODS
    assert len(set(looks.values())) == len(METHODS)
    (panel,) = _convergence(campaign)
    named = [trace for trace in panel.chart.data if trace.get("showlegend")]
    assert [trace["name"] for trace in named] == METHODS
    assert len({(trace["marker"]["color"], trace["marker"]["symbol"]) for trace in named}) == len(METHODS)


def test_a_violin_stands_over_the_name_of_its_method(campaign):
    ax = plot_distribution(campaign).axes[-1]
    assert [label.get_text() for label in ax.get_xticklabels()] == METHODS
    assert len(ax.collections) == len(METHODS)


def test_reasons_are_those_of_runs_without_an_answer():
    rows = {"name": "rest", "method": "oba", "time_s": 60.0, "runs": 3}
    good = rows | {"status": "aligned", "reason": "heading is known to 3 arcmin"}
    bad = rows | {"status": "inconsistent", "reason": "the base moves"}
    assert "commonest reason" not in _endings(pd.DataFrame([good])).headings
    both = _endings(pd.DataFrame([good, bad]))
    assert [row[-1] for row in both.rows] == ["", "the base moves"]


def test_numbers_on_logarithmic_axes_are_written_out():
    with style():
        figure = new_figure(5.0, 3.0)
        ax = figure.subplots()
        ax.plot([1.0, 500.0], [20.0, 90.0])
        ax.set(xscale="log", yscale="log")
    drawn = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "none"}):
        figure.savefig(drawn, format="svg")  # outside of `style`
    words = re.sub(r"<[^>]*>|\s", "", drawn.getvalue())
    assert "60" in words
    assert "×" not in words
