"""Statistics of campaigns against hand-worked numbers and against chance."""

import math

import numpy as np
import pandas as pd
import pytest

from tests.runs import few_and_all
from truenorth.campaign import compare, summarise, time_to_converge
from truenorth.campaign.comparison import paired, sign_test
from truenorth.campaign.rows import Row, table_of
from truenorth.campaign.summary import bootstrap_rms


def frame(rows) -> pd.DataFrame:
    return table_of(rows).to_pandas()


def test_statistics_of_three_runs():
    rows = [Row(0, "a", k, 60.0, "phi_u", value, 2.0, "arcmin", "aligned") for k, value in enumerate((3.0, -4.0, 0.0))]
    rows.append(Row(0, "a", 3, 60.0, "outcome", status="failed", reason="x"))
    row = summarise(frame(rows), names={0: "case"}).iloc[0]
    assert (row["name"], row["runs"], row["failed"], row["unit"]) == ("case", 3, 1, "arcmin")
    assert row["rms"] == pytest.approx(math.sqrt(25 / 3))
    assert row["mean"] == pytest.approx(-1 / 3)
    assert (row["median"], row["max"], row["sigma"]) == (3.0, 4.0, 2.0)
    assert row["rms_over_sigma"] == pytest.approx(math.sqrt(25 / 3) / 2)


@pytest.mark.slow
@few_and_all(400, few=60)
def test_bands_hold_what_they_promise(runs):
    """Honest sigmas and NEES of many campaigns of 50 runs: 95 % of the ratios inside; a false alarm in a thousand."""
    rng = np.random.default_rng(3)
    inside = {"ratio": 0, "level": 0, "nees": 0, "nis": 0, "rms": 0}
    for _ in range(runs):
        x = rng.standard_normal((50, 3))
        # Every third run has its heading refused: its level is judged, and its normalised square has two components.
        rows = [Row(0, "a", k, 1.0, "phi_u", 5 * v[2], 5.0) for k, v in enumerate(x) if k % 3]
        rows += [Row(0, "a", k, 1.0, "level", 5 * math.hypot(*v[:2]), 5 * math.sqrt(2.0)) for k, v in enumerate(x)]
        for k, v in enumerate(x):
            known = v if k % 3 else v[:2]
            rows.append(Row(0, "a", k, 1.0, "nees", float(known @ known) / len(known)))
        for k in range(20):  # as many innovations as the run is long
            squares = rng.standard_normal(10 + 3 * k) ** 2
            rows.append(Row(0, "a", k, 1.0, "nis", float(squares.mean()), math.sqrt(2 / squares.size)))
        table = summarise(frame(rows)).set_index("quantity")
        nis = table.loc["nis"]
        inside["nis"] += nis["ratio_low"] < nis["mean"] < nis["ratio_high"]
        ratio, level, nees = table.loc["phi_u"], table.loc["level"], table.loc["nees"]
        inside["level"] += level["ratio_low"] < level["rms_over_sigma"] < level["ratio_high"]
        inside["ratio"] += ratio["ratio_low"] < ratio["rms_over_sigma"] < ratio["ratio_high"]
        inside["nees"] += nees["ratio_low"] < nees["mean"] < nees["ratio_high"]
        inside["rms"] += ratio["rms_low"] < 5.0 < ratio["rms_high"]
    spread = 3.3 * math.sqrt(runs * 0.95 * 0.05)
    assert abs(inside["ratio"] - 0.95 * runs) < spread
    assert abs(inside["level"] - 0.95 * runs) < spread
    assert abs(inside["nees"] - 0.95 * runs) < spread
    assert abs(inside["nis"] - 0.95 * runs) < spread
    assert inside["rms"] > 0.9 * runs - spread  # percentile intervals of 50 runs fall a few per cent short


def test_nothing_but_failures_is_a_table_without_rows():
    table = summarise(frame([Row(0, "a", 0, 1.0, "outcome", status="failed", reason="x")]), names={0: "case"})
    assert len(table) == 0
    assert list(table.columns[:5]) == ["case", "name", "method", "time_s", "quantity"]


def test_the_bootstrap_repeats():
    values = np.random.default_rng(1).standard_normal(30)
    assert bootstrap_rms(values) == bootstrap_rms(values)
    assert all(math.isnan(x) for x in bootstrap_rms(values[:1]))


def test_a_pair_by_hand():
    runs, rate, difference, ratio, p = paired([1.0, -2.0, 3.0, 1.0], [2.0, 3.0, -1.0, 1.0])
    assert (runs, rate, difference) == (4, 2.5 / 4, -0.5)
    assert ratio == pytest.approx(1.0)
    assert p == pytest.approx(1.0)
    assert sign_test(10, 0) == pytest.approx(2 / 2**10)
    assert sign_test(8, 2) == pytest.approx(2 * (1 + 10 + 45) / 2**10)


def test_methods_are_compared_where_both_answer():
    rows = [Row(0, "a", k, 60.0, "phi_u", v) for k, v in enumerate((1.0, 1.0, 1.0))]
    rows += [Row(0, "b", k, 60.0, "phi_u", -2.0) for k in (0, 2)]
    table = compare(frame(rows), methods=["a", "b"], names={0: "c"})
    assert len(table) == 1
    assert tuple(table.iloc[0][["name", "method", "against", "runs", "win_rate"]]) == ("c", "a", "b", 2, 1.0)


def test_convergence_is_from_when_it_stays():
    values = {10.0: 9.0, 20.0: 1.0, 30.0: 5.0, 40.0: -2.0, 50.0: 1.0}
    rows = [Row(0, "a", 0, t, "phi_u", v) for t, v in values.items()]
    rows += [Row(0, "a", 1, t, "phi_u", 9.0) for t in values]
    assert list(time_to_converge(frame(rows), "phi_u", 3.0)["time_s"]) == [40.0, math.inf]


def test_a_time_without_an_answer_is_not_converged():
    rows = [Row(0, "a", run, t, "outcome", status="aligned") for run in range(3) for t in (10.0, 20.0, 30.0)]
    rows += [Row(0, "a", 0, t, "phi_u", 1.0) for t in (10.0, 30.0)]  # refused at 20 s
    rows += [Row(0, "a", 1, t, "phi_u", 1.0) for t in (10.0, 20.0)]  # refused at the end
    assert list(time_to_converge(frame(rows), "phi_u", 3.0)["time_s"]) == [30.0, math.inf, math.inf]
