"""A quantum coarser than the noise: what rounding leaves in a mean, by Monte Carlo, and what is none of it."""

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES
from truenorth.quality.quantum import mean_error
from truenorth.records import ImuRecord

ROWS, RUNS = 4000, 400


@pytest.mark.parametrize("noise", [0.02, 0.15, 0.25, 0.3])
def test_the_error_of_a_rounded_mean_is_what_is_claimed(noise: float) -> None:
    """Over means drawn anywhere between two steps; a channel of one level claims nothing and is left out."""
    rng = np.random.default_rng(7)
    error, claimed = [], []
    for mean in rng.uniform(0.0, 1.0, RUNS):
        rounded = np.round(mean + noise * rng.standard_normal(ROWS))
        if len(np.unique(rounded)) > 1:
            error.append(rounded.mean() - mean)
            claimed.append(mean_error(rounded)[1])
    rms = np.sqrt(np.mean(np.square(error)))
    assert len(error) > 15
    # Of two levels that toggle anything between nothing and the distance from one half may be the error.
    assert 0.55 * rms < np.sqrt(np.mean(np.square(claimed))) < 1.7 * rms


def test_noise_wider_than_a_step_leaves_nothing() -> None:
    rng = np.random.default_rng(8)
    assert mean_error(np.round(0.3 + rng.standard_normal(ROWS)))[1] == 0.0
    assert mean_error(0.3 + rng.standard_normal(ROWS)) == (0.0, 0.0)


def test_remainders_that_are_carried_on_leave_nothing() -> None:
    rng = np.random.default_rng(9)
    whole = np.cumsum(0.3 + 0.05 * rng.standard_normal(ROWS))
    assert mean_error(np.diff(np.round(whole)))[1] == 0.0


def test_a_log_with_few_digits_says_so() -> None:
    """Accelerometers rounded to .01 m/s^2, .06 deg: a navigation-grade level of arcseconds is not believed."""
    inputs, _ = BENCHES["still"].draw(11, 0)
    record = inputs["record"]
    rates = ImuRecord(record.time, record.gyro / record.interval, record.accel / record.interval, "rates")
    rng = np.random.default_rng(3)
    accel = rates.accel + 0.003 * rng.standard_normal(rates.accel.shape)  # so that not all rows are alike
    coarse = ImuRecord(rates.time, rates.gyro, 0.01 * np.round(accel / 0.01), "rates")
    answer = align(coarse, inputs["place"], inputs["imu"])
    assert any(item.key == "record.coarse" for item in answer.evidence)
