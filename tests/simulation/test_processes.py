"""Gauss-Markov processes have the covariance that theory gives them, from the first sample on."""

import numpy as np
import pytest

from truenorth.simulation.processes import gauss_markov, second_order_gauss_markov

RUNS = (
    20_000  # a covariance of unit variables is then known to 1 % of the variance (sigma), times sqrt(1 + r^2)/sqrt(2)
)
TOLERANCE = 5.0  # sigmas of the estimate; with the 40 checks here a false alarm in 1 of 40,000 seeds


def close(x, y, wanted, scale):
    """Mean of x y over runs against theory, within the tolerance."""
    product = x * y
    assert abs(product.mean() - wanted) < TOLERANCE * product.std() / np.sqrt(RUNS), (
        product.mean() / scale,
        wanted / scale,
    )


@pytest.mark.parametrize("interval", [0.1, 3.0])
def test_first_order(interval):
    x = gauss_markov(0.3, 2.0, interval, 41, np.random.default_rng(1), RUNS)
    for k in (0, 1, 40):
        close(x[k], x[k], 0.09, 0.09)
    for k, lag in ((0, 1), (0, 20), (15, 5)):
        close(x[k], x[k + lag], 0.09 * np.exp(-lag * interval / 2.0), 0.09)


@pytest.mark.parametrize("interval", [0.05, 2.0])
def test_second_order(interval):
    beta = 0.7
    x, v = second_order_gauss_markov(0.3, beta, interval, 41, np.random.default_rng(2), RUNS)
    for k in (0, 1, 40):
        close(x[k], x[k], 0.09, 0.09)
        close(v[k], v[k], 0.09 * beta**2, 0.09 * beta**2)
        close(x[k], v[k], 0.0, 0.09 * beta)
    for k, lag in ((0, 1), (0, 20), (15, 5)):
        t = lag * interval
        fall = 0.09 * np.exp(-beta * t)
        close(x[k], x[k + lag], fall * (1 + beta * t), 0.09)
        close(x[k], v[k + lag], -fall * beta**2 * t, 0.09 * beta)
        close(v[k], v[k + lag], fall * beta**2 * (1 - beta * t), 0.09 * beta**2)


def test_the_derivative_is_one():
    """Position changes by the integral of the rate; white acceleration leaves sigma (beta h)^1.5 / sqrt(3) of it."""
    h, beta = 1e-3, 0.5
    x, v = second_order_gauss_markov(1.0, beta, h, 5001, np.random.default_rng(3), 50)
    left = np.diff(x, axis=0) - 0.5 * h * (v[1:] + v[:-1])
    assert left.std() == pytest.approx(
        np.sqrt(4 * beta**3 * h**3 / 12), rel=0.02
    )  # 250,000 samples: .14 % is one sigma
