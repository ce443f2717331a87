"""The rate at an epoch, for lever arms: exact while the body shakes, and of two noises."""

import numpy as np
import pytest

from truenorth.estimate import predict
from truenorth.estimate.memory import Samples
from truenorth.state.now import NOW_LENGTH, NOW_OTHER_RATE, NOW_RATE


@pytest.fixture
def described(monkeypatch):
    """Both rates about x at a part of sample 5, of increments (N,) at 50 Hz; by the sources of the kernels."""
    monkeypatch.setattr(predict, "_slope_weight", predict._slope_weight.py_func)

    class Plain:
        sensors = (-1, -1)

    def rates(turned, done):
        step, zeros = np.full(len(turned), 0.02), np.zeros((len(turned), 3))
        dtheta = np.column_stack([turned, turned, turned])
        now = np.zeros(NOW_LENGTH)
        samples = Samples(step, np.cumsum(step), dtheta, zeros)
        predict.describe_instant.py_func(samples, 5, done, Plain(), np.zeros(15), now)
        return now[NOW_RATE], now[NOW_OTHER_RATE]

    return rates


@pytest.mark.parametrize("done", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_the_rate_of_a_body_that_shakes(described, done):
    """4 Hz at 50 Hz: to 2 % of the amplitude, where a line through four samples takes a sixth off."""
    w = 2.0 * np.pi * 4.0
    t = 0.02 * np.arange(13)
    for phase in np.linspace(0.0, np.pi, 7):
        rate, _ = described(np.diff(-np.cos(w * t + phase) / w), done)
        assert rate == pytest.approx(np.sin(w * 0.02 * (5 + done) + phase), abs=0.02)


@pytest.mark.parametrize("done", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_both_rates_have_noises_of_their_own(described, done):
    """By the weight of each sample in both: their product is the covariance; a constant rate is the same in both."""
    weights = np.array([described(row, done) for row in np.eye(12)])
    rate, other = weights.T
    assert abs(rate @ other) < 1e-9 * (rate @ rate)
    assert 0.02 * np.sum(rate) == pytest.approx(1.0)
    assert 0.02 * np.sum(other) == pytest.approx(1.0)
    assert 0.02**2 * rate @ rate < 1.2
    assert 0.02**2 * other @ other < 0.55
