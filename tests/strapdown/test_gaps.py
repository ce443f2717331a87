"""Gaps of a log: what they held is found where rates change evenly, and can be taken out again."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.records import ImuRecord
from truenorth.strapdown.increments import across_gaps, without_gaps

T, ROWS = 0.01, 400


def ramp() -> ImuRecord:
    """Increments of rates and forces that are straight lines."""
    time = T * np.arange(1, ROWS + 1)
    slopes = np.array([0.3, -0.1, 0.2])
    middle = time - 0.5 * T
    return ImuRecord(time, T * (0.2 + np.outer(middle, slopes)), T * (9.8 - np.outer(middle, slopes)), "increments")


@pytest.mark.parametrize("lost", [[100], [50, 51, 52], [10, 12, 200, 201]])
def test_what_a_gap_held_is_there_again(lost):
    """To rounding, of straight lines."""
    whole = ramp()
    kept = np.setdiff1d(np.arange(ROWS), lost)
    cut = ImuRecord(whole.time[kept], whole.gyro[kept], whole.accel[kept], "increments")
    bridged = across_gaps(cut)
    assert bridged.gyro.sum(axis=0) == pytest.approx(whole.gyro.sum(axis=0), rel=1e-12)
    assert bridged.accel.sum(axis=0) == pytest.approx(whole.accel.sum(axis=0), rel=1e-12)
    again = without_gaps(bridged)
    np.testing.assert_allclose(again.gyro, cut.gyro, rtol=1e-13)
    np.testing.assert_allclose(again.time, whole.time[: len(cut)], rtol=1e-12)
    assert not again.gaps.size


def test_rates_and_even_clocks_stay_as_they_are():
    rates = replace(ramp(), kind="rates")
    assert across_gaps(rates) is rates
    np.testing.assert_array_equal(across_gaps(ramp()).gyro, ramp().gyro)
