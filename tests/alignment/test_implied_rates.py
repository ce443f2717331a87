"""What a filter with a prior implies of a gyro bias: what the data alone say, and only where they say more than the prior."""

import numpy as np
import pytest

from truenorth.alignment.check import LogCheck, implied

PRIOR = 5e-8  # rad/s


@pytest.mark.parametrize("noise", [0.1 * PRIOR, 0.9 * PRIOR])
def test_it_is_what_the_data_alone_say(noise):
    before = PRIOR**2 * np.eye(3)
    seen = np.array([3.0, -4.0, 6.0]) * noise
    after = np.linalg.inv(np.linalg.inv(before) + np.eye(3) / noise**2)
    bias = after @ seen / noise**2
    check = implied(LogCheck(np.zeros(2), np.full(2, np.inf), 0.0, 1.0), bias, after, before)
    np.testing.assert_allclose(check.rate_residual, seen[1:])
    np.testing.assert_allclose(check.rate_noise, noise)


def test_where_the_prior_says_more_the_check_stays_as_it_was():
    before = PRIOR**2 * np.eye(3)
    noise = np.array([1.0, 0.5, 12.0]) * PRIOR  # of the data alone
    after = np.diag(1.0 / (1.0 / PRIOR**2 + 1.0 / noise**2))
    own = LogCheck(np.array([7.0, 8.0]) * PRIOR, np.array([900.0, 900.0]) * PRIOR, 0.0, 1.0)
    check = implied(own, np.array([0.0, 0.1, 0.034]) * PRIOR, after, before)
    assert check.rate_noise[0] == pytest.approx(0.5 * PRIOR)
    assert check.rate_residual[1] == own.rate_residual[1]
    assert check.rate_noise[1] == own.rate_noise[1]
