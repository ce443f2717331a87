"""Sums of neighbours, from which the kind of motion is found, against their definitions."""

import numpy as np
import pytest
from numpy.lib.stride_tricks import sliding_window_view

from truenorth.core.errors import DataError
from truenorth.quality.signals import _neighbours, angle_wander, box_mean, even_rates, offset, rate_bias
from truenorth.records import ImuRecord


@pytest.mark.parametrize("width", [1, 2, 3, 10, 21, 31, 40])
def test_means_over_neighbours(width):
    signal = np.random.default_rng(1).standard_normal((3, 40))
    windows = sliding_window_view(signal, width, axis=1)
    np.testing.assert_allclose(_neighbours(signal, width), windows.sum(axis=2), rtol=0.0, atol=1e-13)
    expected = windows.mean(axis=2)[:, offset(40, width)]
    np.testing.assert_allclose(box_mean(signal, width), expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize(("seconds", "per_second"), [(60, 10), (4, 10), (30, 3)])
def test_wander_is_the_angle_about_its_straight_line(seconds, per_second):
    rates = np.random.default_rng(2).standard_normal((3, seconds * per_second)) + 0.3
    interval, length = 1.0 / per_second, min(10, seconds) * per_second
    windows = sliding_window_view(np.cumsum(rates * interval, axis=1), length, axis=1)[:, ::per_second]
    line = np.polynomial.Polynomial.fit
    t = np.arange(length, dtype=np.float64)
    left = np.array([[w - line(t, w, 1)(t) for w in axis] for axis in windows])
    wander = angle_wander(rates, interval, per_second)
    np.testing.assert_allclose(wander, np.sqrt(np.mean(left**2, axis=2)), rtol=1e-9)


def test_the_rate_of_a_still_base_is_found_in_its_quiet_windows():
    rates = 1e-6 * np.random.default_rng(3).standard_normal((3, 600)) + np.array([[1e-4], [-2e-4], [5e-5]])
    rates[:, 100:200] += 1e-3
    wander = angle_wander(rates, 0.1, 10)
    bias = rate_bias(rates, wander, 10, np.full(3, 1e-6))
    np.testing.assert_allclose(bias, [1e-4, -2e-4, 5e-5], atol=5e-7)


def test_rows_that_arrived_in_blocks_are_named():
    """Stamped .1 ms apart, ten at a time: an error with its cause, where the grid had no cell."""
    time = 0.2 * (1 + np.arange(2000) // 10) + 1e-4 * (np.arange(2000) % 10)
    record = ImuRecord(time, np.zeros((2000, 3)), np.full((2000, 3), 9.8), "rates")
    with pytest.raises(DataError, match="arrive in blocks"):
        even_rates(record)
