"""The inferred size of an unseen bias, against the distribution it claims."""

import math

import numpy as np

from truenorth.alignment.inference import predictive_sigma


def test_two_noiseless_residuals_give_students_t():
    """68.27 % of Student's t with two degrees of freedom lies within t / sqrt(2 + t^2) = .6827."""
    p = math.erf(math.sqrt(0.5))
    t = math.sqrt(2 * p**2 / (1 - p**2))
    residuals = np.array([3e-6, 4e-6])
    rms = math.sqrt(np.mean(residuals**2))
    assert math.isclose(predictive_sigma(residuals, np.zeros(2), 1e-12, 1e3), t * rms, rel_tol=2e-3)


def test_one_noiseless_residual_gives_cauchy():
    p = math.erf(math.sqrt(0.5))
    expected = 2e-4 * math.tan(math.pi * p / 2)
    assert math.isclose(predictive_sigma(np.array([2e-4]), np.zeros(1), 1e-14, 1e6), expected, rel_tol=2e-3)


def test_noise_alone_proves_no_bias():
    """Residuals well inside their noise leave every scale below the noise open; far above it they exclude it."""
    noise = np.full(2, 1e-6)
    quiet = predictive_sigma(np.zeros(2), noise, 1e-9, 1.0)
    assert quiet < 1e-6
    assert predictive_sigma(np.array([1e-4, 1e-4]), noise, 1e-9, 1.0) > 1e-4


def test_covers_the_unseen_component():
    """Over populations of every scale the interval holds the third draw in 68 % of 4000 cases (4 sigma: 2.9 %)."""
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(4000):
        s = 10 ** rng.uniform(-7, -3)
        a, b, unseen = s * rng.standard_normal(3)
        noise = np.full(2, 1e-9)
        inside += abs(unseen) < predictive_sigma(np.array([a, b]), noise, 1e-9, 1e-1)
    assert abs(inside / 4000 - 0.6827) < 0.03
