"""Charts as plain data: bands, a heading only where there is one, gaps, units that fit, the coast."""

import base64
import json
from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.alignment.transfer_result import Relation
from truenorth.core.units import significant
from truenorth.figures.convergence import Course
from truenorth.figures.units import Clock, angle_unit, length_unit, speed_unit
from truenorth.report.chart import Chart
from truenorth.report.charts import _convergence, _sigmas
from truenorth.report.coast import coast_within
from truenorth.report.transfer import transfer_panels
from truenorth.state.track import Residuals

T = np.arange(20.0)
ANGLES = [Course(name, 0.1 / (1 + T), 0.2 / (1 + T), np.full(20, 0.005)) for name in ("heading", "pitch", "roll")]
SECONDS = Clock(1.0, "s")


def decoded(spec):
    ((kind, text),) = spec.items()
    return np.frombuffer(base64.b64decode(text), dtype=f"<{kind}")


@pytest.mark.parametrize(
    ("low", "high", "tick"), [(2.0, 6.0, "D1"), (0.9, 11.0, "D2"), (0.1, 1e4, 1.0), (1e-3, 1e5, 2.0)]
)
def test_numbers_on_a_logarithmic_axis_do_not_run_into_each_other(low, high, tick):
    chart = Chart(["sigma, m"], "time, s")
    chart.line(0, T, np.geomspace(low, high, len(T)), "c0", "east")
    chart.axis(0, type="log")
    assert json.loads(chart.to_json())["layout"]["yaxis"]["dtick"] == tick


@pytest.mark.parametrize("known", [True, False])
def test_a_refused_heading_is_not_drawn(known):
    chart = _convergence(T, ANGLES, known, SECONDS)
    assert ("heading" in {trace.get("name") for trace in chart.data}) == known
    bands = [trace for trace in chart.data if trace.get("fill") == "toself"]
    assert len(bands) == (6 if known else 4)
    assert {trace["mode"] for trace in bands} == {"none"}


def test_sigmas_are_drawn_over_the_logarithm_of_time():
    chart = _sigmas(T, ANGLES, SECONDS)
    assert chart.layout["xaxis"]["type"] == "log"
    assert all(decoded(trace["x"]).min() > 0 for trace in chart.data)


def test_arrays_arrive_as_they_left():
    chart = Chart(["m"], "s")
    x, y = np.array([0.0, 1e5 + 1e-6, 2e5]), np.array([1.0, np.nan, -3.25])
    chart.line(0, x, y, "c0", "one")
    sent = json.loads(chart.to_json())["data"][0]
    np.testing.assert_array_equal(decoded(sent["x"]), x)
    np.testing.assert_array_equal(decoded(sent["y"]), y.astype(np.float32))


def test_text_of_a_chart_cannot_end_its_element():
    chart = Chart(["m"], "s")
    chart.line(0, [0.0], [1.0], "c0", "</script><b>")
    assert "</" not in chart.to_json()
    assert json.loads(chart.to_json())["data"][0]["name"] == "</script><b>"


def test_a_long_log_is_drawn_in_hours():
    assert Clock.of(np.array([0.0, 7199.0])).unit == "s"
    clock = Clock.of(np.array([100.0, 7300.0]))
    assert clock.unit == "h"
    assert clock(7200.0) == 2.0


@pytest.mark.parametrize(
    ("unit", "value", "name"),
    [
        (length_unit, 0.09, "mm"),
        (length_unit, 0.4, "m"),
        (length_unit, 6000.0, "km"),
        (speed_unit, 0.05, "mm/s"),
        (speed_unit, 10.0, "m/s"),
        (angle_unit, 1e-5, "arcsec"),
        (angle_unit, 0.001, "arcmin"),
        (angle_unit, 0.5, "deg"),
        (length_unit, np.nan, "mm"),
    ],
)
def test_units_fit_the_size(unit, value, name):
    assert unit([value])[1] == name


def test_the_coast_is_where_it_is():
    """Cape Finisterre is Spain's western end; Lake Geneva's surroundings have no sea."""
    lon, lat = coast_within(42.0, 44.0, -11.0, -7.0)
    there = np.isfinite(lon)
    west = np.argmin(np.where(there, lon, np.inf))
    assert (lon[west], lat[west]) == (pytest.approx(-9.25, abs=0.1), pytest.approx(43.0, abs=0.3))
    assert np.isfinite(coast_within(46.0, 46.8, 5.5, 7.5)[0]).sum() == 0


def test_the_coast_crosses_the_date_line():
    lon, _ = coast_within(64.0, 69.0, 175.0, 192.0)
    lon = lon[np.isfinite(lon)]
    assert lon.min() < 178.0
    assert lon.max() > 188.0


def test_numbers_for_people_have_no_exponent():
    assert [significant(x) for x in (1000.0, 0.0123456, 123456.0)] == ["1000", "0.0123", "123000"]


def test_no_coast_jumps():
    """A line that leaves the window and comes back elsewhere is two lines."""
    lon, lat = coast_within(44.0, 60.0, 117.0, 164.0)
    steps = np.hypot(np.diff(lon), np.diff(lat))
    assert np.nanmax(steps) < 1.5


def test_a_transfer_shows_what_it_found_on_the_way():
    """Delay and arm with bands, no mounting where it was given, innovations of what the page does not show already."""
    one, three = np.full(20, 0.02), np.full((20, 3), 0.5)
    course = Relation(T, one, one / 4.0, three, three, three, np.zeros((20, 3)))
    axes = ("east", "north", "up")
    sources = [
        Residuals(name, T, three, three, one, one > 0.0, 0, T, one < 0.0, unit, axes)
        for name, unit in (("master velocity", "m/s"), ("master attitude", "rad"))
    ]
    panels = transfer_panels(SimpleNamespace(course=course, residuals=sources), "velocity of the master")
    assert [panel.title for panel in panels] == ["Delay of the master", "Lever arm", "Innovations: master attitude"]
    delay = panels[0].chart.data
    assert [trace.get("fill") for trace in delay] == ["toself", None]
    np.testing.assert_allclose(decoded(delay[1]["y"]), 20.0)  # ms
    assert transfer_panels(None, "") == []
