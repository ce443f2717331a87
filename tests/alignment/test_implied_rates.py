"""What the rates of a log say of gyro biases: by a filter with a prior, and by the scatter of a few means."""

import math

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


def test_the_scatter_of_ten_means_is_no_known_sigma():
    """Of a sound IMU on a base that turns a little to and fro: beyond 2.5 sigmas once in 80 logs, not once in 29."""
    rng = np.random.default_rng(4)
    blocks = rng.standard_normal((4_000, 10, 2))
    noise = blocks.std(axis=1, ddof=1) / math.sqrt(10)
    checks = [LogCheck(mean, s, 0.0, 1.0, np.full(2, 9.0)) for mean, s in zip(blocks.mean(axis=1), noise, strict=True)]
    share = np.mean([check.rate_misses(1e-6) > 2.5 for check in checks])
    assert share == pytest.approx(math.erfc(2.5 / math.sqrt(2.0)), abs=0.005)  # 4 sigmas of 8,000 draws
    assert np.mean(np.abs(blocks.mean(axis=1)) / noise > 2.5) > 0.03


def test_a_sigma_that_is_known_stays_normal():
    """Where the bias that may be is large compared with the scatter, or the filter says how sure it is."""
    assert LogCheck(np.array([6.0, 6.0]), np.full(2, 1e-3), 0.0, 1.0, np.full(2, 9.0)).rate_misses(
        1.0
    ) == pytest.approx(6.0, rel=1e-3)
    assert LogCheck(np.array([3.0, 4.0]), np.ones(2), -3.0, 1.0).rate_misses(0.0) == pytest.approx([3.0, 4.0])
    assert LogCheck(np.zeros(2), np.ones(2), -3.0, 1.0).force_misses(0.0) == pytest.approx(3.0)
    assert LogCheck(np.zeros(2), np.ones(2), 0.0, 0.0).force_misses(0.0) == 0.0
