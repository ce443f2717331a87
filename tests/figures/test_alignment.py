"""The alignment figure draws what the result holds: last values, bands, floors, biases, innovations, NIS."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.core.position import Position
from truenorth.figures.convergence import NIS_BLOCK, averaged_nis, courses, settled_limits
from truenorth.figures.units import Clock
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(40.0, 118.0)


def aligned(pitch: float = 0.02):
    motion = rest(PLACE, 1.0, pitch, -0.3)
    log = simulate(motion, rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=3).record
    return align(log, PLACE, "navigation")


@pytest.fixture(scope="module")
def still():
    return aligned()


def test_courses_end_at_the_answer(still):
    found = courses(still)
    assert [c.name for c in found] == ["heading", "pitch", "roll"]
    np.testing.assert_allclose([c.value[-1] for c in found], still.euler, rtol=0, atol=1e-9)
    np.testing.assert_allclose([c.sigma[-1] for c in found], still.euler_sigma, rtol=1e-6)
    np.testing.assert_allclose([c.floor[-1] for c in found], still.euler_sigma_floor, rtol=1e-6)
    for c in found:
        assert np.all(c.floor <= c.sigma * (1 + 1e-9))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_near_the_vertical_the_combination_is_drawn(sign):
    """A wrong sign of phi_U, or heading alone, would not follow the attitudes of the history."""
    answer = aligned(sign * np.radians(89.0))
    found = courses(answer)
    assert [c.name for c in found] == ["heading minus roll" if sign > 0 else "heading plus roll", "pitch"]
    assert found[0].sigma[-1] == pytest.approx(answer.azimuth[2], rel=1e-6)
    assert found[0].value[-1] == pytest.approx(answer.azimuth[1], abs=1e-9)
    # The base is still, so that the attitude of each epoch tells the combination by itself.
    heading, _, roll = answer.history.euler.T
    said = heading - sign * roll
    late = slice(len(said) // 4, None)
    difference = (found[0].value - said + np.pi) % (2 * np.pi) - np.pi
    scatter = np.ptp(found[0].value[late])
    assert np.max(np.abs(difference[late])) < 0.05 * scatter


@pytest.mark.slow
def test_every_panel_has_its_unit(still, tmp_path):
    figure = still.plot()
    assert [ax.get_ylabel() for ax in figure.axes] == [
        "heading, deg",
        "pitch, deg",
        "roll, deg",
        "NIS",
        "arcmin",
        "deg/h",
        "µg",
        "sigmas",
    ]
    heading = figure.axes[0].lines[0]
    assert heading.get_ydata()[-1] == pytest.approx(np.degrees(still.heading), abs=1e-7)
    outer, inner = (c.get_paths()[0].get_extents() for c in figure.axes[0].collections)
    assert outer.y0 <= inner.y0
    assert outer.y1 >= inner.y1
    assert "aligned" in figure.get_suptitle()
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000


def test_averaged_nis_and_its_band(still):
    """Band of a mean of ten: chi-square with 30 degrees of freedom over 10 (tables: 16.791, 46.979)."""
    t, mean, low, high = averaged_nis(still.history)
    np.testing.assert_allclose([low, high], [1.6791, 4.6979], atol=1e-4)
    np.testing.assert_allclose(mean[0], np.mean(still.history.nis[:NIS_BLOCK]))
    assert still.history.time[0] < t[0] < still.history.time[NIS_BLOCK]
    assert len(t) == len(still.history.nis) // NIS_BLOCK


def test_limits_look_at_the_settled_part():
    middle = np.r_[np.full(25, 1000.0), np.zeros(75)]
    assert settled_limits(middle, np.ones(100)) == pytest.approx((-1.3, 1.3))


def test_limits_of_a_band_that_is_not_known_everywhere():
    """A receiver that finds its satellites late has no innovations before, and one that never does has none."""
    late = np.r_[np.full(40, np.nan), np.full(25, 1000.0), np.zeros(75)]
    assert settled_limits(late, np.ones(140)) == pytest.approx((-1.3, 1.3))
    assert settled_limits(np.full(9, np.nan), np.ones(9)) == (-1.0, 1.0)


def test_averaged_nis_is_that_of_epochs_that_have_one(still):
    nis = still.history.nis.copy()
    nis[: 2 * NIS_BLOCK - 3] = np.nan
    t, mean, *_ = averaged_nis(replace(still.history, nis=nis))
    assert np.isfinite(mean).all()
    np.testing.assert_allclose(mean[0], np.mean(nis[2 * NIS_BLOCK - 3 : 3 * NIS_BLOCK - 3]))
    assert t[0] > still.history.time[2 * NIS_BLOCK - 3]


def test_without_a_history_there_is_nothing_to_draw(still):
    with pytest.raises(ValueError, match="no history"):
        replace(still, history=None).plot()


def test_a_clock_that_counts_from_a_date_is_drawn_from_the_first_second_of_the_log():
    """Ticks of 1.710773355e9 s could not be read."""
    clock = Clock.of(1710773350.4 + np.arange(31.0))
    assert clock.label == "s since 1710773350 s"
    np.testing.assert_allclose(clock([1710773350.4, 1710773352.0]), [0.4, 2.0], atol=1e-6)
    assert clock.lasting(30.0) == 30.0
    days = Clock.of(np.array([2e9, 2e9 + 86400.0]))
    assert (float(days(2e9 + 7200.0)), days.label) == (2.0, "h since 2000000000 s")
    of_the_week = Clock.of(np.array([345600.0, 345700.0]))
    assert (float(of_the_week(345600.0)), of_the_week.label) == (345600.0, "s")
