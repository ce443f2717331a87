"""The inspection figure draws what was found; thinning and bands keep the data."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest

from truenorth.figures.style import band, new_figure, style
from truenorth.figures.thinning import POINTS, thin
from truenorth.quality import inspect
from truenorth.records import ImuRecord


def record(duration=60.0, rows=None) -> ImuRecord:
    rng = np.random.default_rng(0)
    n = rows or int(duration * 100)
    return ImuRecord(
        np.arange(1, n + 1) * 0.01,
        1e-4 * rng.standard_normal((n, 3)),
        [0.0, 0.0, 9.8] + 1e-3 * rng.standard_normal((n, 3)),
        source="log.csv",
    )


@pytest.mark.slow
def test_the_page_shows_source_regimes_and_units(tmp_path):
    figure = inspect(record()).plot()
    figure.savefig(tmp_path / "log.png")
    assert (tmp_path / "log.png").stat().st_size > 20_000
    title = figure.get_suptitle()
    assert "log.csv" in title
    assert "still 100%" in title
    assert [ax.get_ylabel() for ax in figure.axes] == ["deg/s", "m/s²", "arcsec", "deg/h", "µg"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["x", "y", "z", "still"]


def test_gaps_are_marked_and_findings_named():
    whole = record()
    keep = np.ones(len(whole), bool)
    keep[1000:1100] = False
    figure = inspect(ImuRecord(whole.time[keep], whole.gyro[keep], -whole.accel[keep])).plot()
    assert "axes down, gaps" in figure.get_suptitle()
    assert "gap" in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.slow
@pytest.mark.parametrize("rows", [2, 50, 700])
def test_short_records_have_a_page_too(rows, tmp_path):
    inspect(record(rows=rows)).plot().savefig(tmp_path / "short.svg")


def test_style_leaves_the_session_alone():
    before = dict(mpl.rcParams)
    with style():
        new_figure().add_subplot().plot([0, 1], [0, 1])
    assert dict(mpl.rcParams) == before


def test_thinning_keeps_ends_and_peaks():
    time = np.arange(60_000) * 0.01
    values = np.sin(time)
    values[31_234] = 7.0
    rows = thin(time, values)
    assert len(rows) <= POINTS
    assert rows[0] == 0
    assert rows[-1] == 59_999
    assert 31_234 in rows
    assert np.all(np.diff(rows) > 0)
    assert len(thin(time[:100], values[:100])) == 100
    values[5] = np.nan
    assert len(thin(time, values)) <= POINTS


def test_the_band_is_as_wide_as_it_says():
    with style():
        ax = new_figure().add_subplot()
        band(ax, [0.0, 1.0, 2.0], [1.0, 2.0, 3.0], [0.5, 0.5, 0.5], factor=3.0, label="heading")
    extent = ax.collections[0].get_paths()[0].get_extents()
    assert (extent.ymin, extent.ymax) == (-0.5, 4.5)
    assert ax.get_legend_handles_labels()[1] == ["heading", "heading ± 3σ"]
