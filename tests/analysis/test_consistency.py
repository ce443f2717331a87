"""NEES, NIS and whiteness: against tables, against simulated runs of a matched filter, and against wrong ones.

Statistical tests use bands of probability 1 - 1e-6 each: with the right code, one of a million seeds fails.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from truenorth.analysis.consistency import (
    chi_square_band,
    chi_square_quantile,
    consistency,
    nees,
    nis,
    sigma_ratio,
    standardised,
    whiteness,
)
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem, kalman

SURE = 1.0 - 1e-6


def simulated(runs: int, epochs: int, seed: int = 0) -> tuple[LinearSystem, np.ndarray]:
    """A correlated second-order system, its measurements drawn run by run, and the true states."""
    rng = np.random.default_rng(seed)
    Phi, H = np.array([[1.0, 0.1], [-0.2, 0.95]]), np.array([[1.0, 0.0], [1.0, 1.0]])
    joint = np.array([[0.2, 0.05, 0.03, 0.0], [0.05, 0.1, 0.0, -0.02], [0.03, 0.0, 0.5, 0.1], [0.0, -0.02, 0.1, 0.3]])
    P0 = np.array([[2.0, 0.5], [0.5, 1.0]])
    x = rng.multivariate_normal(np.zeros(2), P0, runs)
    truth, z = np.empty((runs, epochs, 2)), np.empty((runs, epochs, 2))
    for k in range(epochs):
        noise = rng.multivariate_normal(np.zeros(4), joint, runs)
        x = x @ Phi.T + noise[:, :2]
        truth[:, k] = x
        z[:, k] = x @ H.T + noise[:, 2:]
    z[rng.random(z.shape) < 0.1] = np.nan
    Q, S, R = joint[:2, :2], joint[:2, 2:], joint[2:, 2:]
    return LinearSystem(Phi[None], Q[None], H[None], R[None], z, np.zeros(2), P0, S=S[None]), truth


def test_quantiles_are_those_of_the_tables():
    # Abramowitz and Stegun, table 26.8.
    assert_allclose(chi_square_quantile(0.95, [1, 2, 10, 100]), [3.84146, 5.99146, 18.3070, 124.342], rtol=1e-5)
    assert_allclose(chi_square_quantile(0.005, [1, 10]), [3.92704e-5, 2.15586], rtol=1e-5)
    assert chi_square_quantile(0.95, 0) == 0.0


def test_band_of_a_mean():
    low, high = chi_square_band(3, runs=50, level=0.95)  # Bar-Shalom's way: chi-square of 150 over 50
    assert_allclose([low, high], [117.985 / 50, 185.800 / 50], rtol=1e-5)


def test_nees_is_the_quadratic_form():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((5, 3, 3)) * [1.0, 1e-6, 1e4]  # whatever the units
    P, e = np.swapaxes(root, -1, -2) @ root, rng.standard_normal((5, 3)) * [1.0, 1e-6, 1e4]
    assert_allclose(nees(e, P), np.einsum("ki,kij,kj->k", e, np.linalg.inv(P), e), rtol=1e-7)


def test_nis_is_the_filters_own():
    system, _ = simulated(runs=3, epochs=20)
    estimates = kalman(system, history="sigma")
    value, dof = nis(estimates.innovation, estimates.innovation_covariance)
    assert_allclose(value, estimates.nis, rtol=1e-9, atol=1e-12)
    assert np.array_equal(dof, estimates.nis_rows)


def test_a_matched_filter_is_consistent():
    system, truth = simulated(runs=300, epochs=40)
    estimates = kalman(system, history="full")
    errors = estimates.x - truth
    for result in (
        consistency(nees(errors, estimates.P), 2, SURE),
        consistency(nees(errors, estimates.P).reshape(1, -1)[:, :1], 2, SURE),
    ):
        assert result.inside == 1.0
    # NIS of different epochs is independent: one figure for all.
    low, high = chi_square_band(estimates.nis_rows.sum(), level=SURE)
    assert low < estimates.nis.sum() < high
    ratio, low, high = sigma_ratio(errors[:, -1], estimates.sigma[:, -1], SURE)
    assert np.all((low < ratio) & (ratio < high))


@pytest.mark.parametrize(("factor", "beyond"), [(0.3, "above"), (3.0, "below")])
def test_a_boastful_and_a_shy_filter_are_found(factor, beyond):
    system, truth = simulated(runs=300, epochs=40)
    wrong = replace(system, Q=factor * system.Q, R=factor * system.R, S=factor * system.S)
    estimates = kalman(wrong, history="full")
    result = consistency(nees(estimates.x - truth, estimates.P)[:, 20:], 2)
    assert np.all(result.mean > result.high if beyond == "above" else result.mean < result.low)
    assert result.inside == 0.0
    ratio, low, high = sigma_ratio(estimates.x[:, -1] - truth[:, -1], estimates.sigma[:, -1])
    assert np.all(ratio > high if beyond == "above" else ratio < low)


def test_the_wrong_sign_of_a_correlation_is_found():
    system, _ = simulated(runs=200, epochs=40)
    assert system.S is not None
    right, wrong = (kalman(replace(system, S=sign * system.S), innovations=True) for sign in (1.0, -1.0))
    # If the wrong sign were the true one, a lead of 14 in log-likelihood had a chance below e^-14 (Markov).
    assert right.log_likelihood.sum() > wrong.log_likelihood.sum() + 14.0


def test_white_innovations_pass_at_the_stated_rate():
    rng = np.random.default_rng(2)
    eye = np.broadcast_to(np.eye(2), (400, 2, 2))
    failed = 0
    for _ in range(400):
        nu = rng.standard_normal((400, 2))
        nu[rng.random(nu.shape) < 0.2] = np.nan
        failed += not whiteness(nu, eye).white
    # 20 of 400 expected, sigma 4.4; the band is that of five sigma.
    assert 1 <= failed <= 42


@pytest.mark.parametrize("fault", ["low pass", "over-correction", "bias"])
def test_coloured_innovations_are_found(fault):
    rng = np.random.default_rng(3)
    nu = rng.standard_normal((500, 2))
    if fault == "bias":
        nu += 0.5
    else:
        nu[1:] += (0.4 if fault == "low pass" else -0.4) * nu[:-1]
    result = whiteness(nu, np.broadcast_to(np.eye(2), (500, 2, 2)))
    assert not result.white
    assert result.p_value < 1e-6
    sign = -1.0 if fault == "over-correction" else 1.0
    assert np.all(sign * result.autocorrelation[0] > result.band[0])


def test_whiteness_of_a_matched_and_a_wrong_filter():
    system, _ = simulated(runs=1, epochs=2000, seed=4)
    right, wrong = (
        kalman(system, innovations=True),
        kalman(replace(system, Q=0.05 * system.Q, S=None), innovations=True),
    )
    assert whiteness(right.innovation[0], right.innovation_covariance[0]).p_value > 1e-6
    assert whiteness(wrong.innovation[0], wrong.innovation_covariance[0]).p_value < 1e-6


def test_bad_input_is_said():
    with pytest.raises(DataError, match="not positive definite"):
        nees(np.ones(2), np.ones((2, 2)))
    with pytest.raises(UsageError, match=r"covariance has shape \(3, 3\)"):
        standardised(np.ones(2), np.eye(3))
    with pytest.raises(UsageError, match=r"values have shape \(5,\)"):
        consistency(np.ones(5), 1)
    with pytest.raises(UsageError, match="level is 95"):
        chi_square_band(2, level=95)
    with pytest.raises(UsageError, match="10 epochs are too few for 20 lags"):
        whiteness(np.ones((10, 1)), np.ones((10, 1, 1)))
