"""Covariances that are put together of groups of states."""

import numpy as np

from truenorth.state.prior import joined


def test_groups_are_uncorrelated_and_stand_in_order():
    full = np.array([[4.0, 1.0], [1.0, 9.0]])
    expected = np.zeros((6, 6))
    expected[0, 0], expected[3, 3], expected[4, 4], expected[5, 5] = 4.0, 0.25, 0.0, 9.0
    expected[1:3, 1:3] = full
    np.testing.assert_array_equal(joined([2.0], full, [0.5, 0.0, 3.0]), expected)
