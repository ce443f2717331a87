"""Fixes of a vehicle that stands on the date line."""

import numpy as np
import pytest

from truenorth.live import GnssFeed

ACROSS = 1e-7  # rad on both sides: .6 m


@pytest.mark.parametrize("count", [8, 9])
def test_fixes_on_both_sides_of_the_date_line_are_of_one_place(count):
    """The place was at longitude 0, and the vehicle seemed to have left it."""
    time = np.arange(float(count))
    lon = np.where(time % 2 == 0, np.pi - ACROSS, ACROSS - np.pi)
    feed, inland = GnssFeed(), GnssFeed()
    feed.push(time, np.full(count, 0.3), lon, np.zeros(count))
    inland.push(time, np.full(count, 0.3), lon - np.sign(lon) * np.pi + 0.5, np.zeros(count))
    assert feed.place is not None
    assert abs(abs(feed.place.lon) - np.pi) <= ACROSS
    np.testing.assert_array_equal(feed.speed_of(feed.rows), np.zeros(count))
    assert inland.place is not None
    assert inland.place.lon == pytest.approx(0.5, abs=2 * ACROSS)
    lon[-1] = 20.0 / 6.371e6 - np.pi  # 20 m, 19 along the parallel: it has moved
    feed = GnssFeed()
    feed.push(time, np.full(count, 0.3), lon, np.zeros(count), position_sigma=np.full((count, 3), 0.5))
    assert feed.speed_of(feed.rows)[-1] == np.inf
