"""Sage-Husa and variational Bayes: step by step against NumPy, and against simulated noise.

The statistical bands are several times the scatter over seeds, so that they fail for wrong code, not for a seed.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import random_system
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, kalman, sage_husa, variational

BOTH = [sage_husa, variational]


def simple(epochs=30, **options) -> LinearSystem:
    return random_system(S=False, diagonal_R=True, epochs=epochs, **options)


def kf_step(x, P, H, R, z):
    here = np.isfinite(z)
    H, R, z = H[here], R[np.ix_(here, here)], z[here]
    W = H @ P @ H.T + R
    K = np.linalg.solve(W, H @ P).T
    return x + K @ (z - H @ x), P - K @ W @ K.T


def predictions(system, k, x, P):
    return system.Phi[k] @ x + system.u[k], system.Phi[k] @ P @ system.Phi[k].T + system.Q[k]


@pytest.mark.slow
def test_sage_husa_step_by_step():
    system, b, low, high = simple(), 0.9, 0.5, 3.0
    estimates = sage_husa(system, b=b, smallest=low, largest=high, history="full")
    x, P, r, count = system.x0, system.P0, np.diag(system.R[0]).copy(), np.zeros(3)
    touched = 0
    for k in range(system.epochs):
        x, P = predictions(system, k, x, P)
        given = np.diag(system.R[k])
        for j in np.flatnonzero(np.isfinite(system.z[k])):
            count[j] += 1
            d = (1 - b) / (1 - b ** count[j])
            h = system.H[k, j]
            r[j] = np.clip(
                (1 - d) * r[j] + d * ((system.z[k, j] - h @ x) ** 2 - h @ P @ h), low * given[j], high * given[j]
            )
            touched += r[j] in (low * given[j], high * given[j])
        x, P = kf_step(x, P, system.H[k], np.diag(r), system.z[k])
        assert_allclose(estimates.adaptation[k], r, rtol=1e-9)
        assert_allclose(estimates.x[k], x, rtol=1e-8, atol=1e-9)
        assert_allclose(estimates.P[k], P, rtol=1e-8, atol=1e-9)
    assert 0 < touched < 60


@pytest.mark.slow
def test_variational_step_by_step():
    system, rho, worth = simple(), 0.9, 4.0
    estimates = variational(system, rho=rho, worth=worth, iterations=4, history="full")
    x, P = system.x0, system.P0
    alpha, beta = np.full(3, worth / 2), worth / 2 * np.diag(system.R[0])
    for k in range(system.epochs):
        x_p, P_p = predictions(system, k, x, P)
        here = np.isfinite(system.z[k])
        alpha, before = rho * alpha + 0.5 * here, rho * beta
        beta = before.copy()
        x, P = x_p, P_p
        for _ in range(4):
            x, P = kf_step(x_p, P_p, system.H[k], np.diag(beta / alpha), system.z[k])
            residual = system.z[k] - system.H[k] @ x
            more = 0.5 * residual**2 + 0.5 * np.einsum("ji,ik,jk->j", system.H[k], P, system.H[k])
            beta = np.where(here, before + more, before)
        assert_allclose(estimates.adaptation[k], beta / alpha, rtol=1e-9)
        assert_allclose(estimates.x[k], x, rtol=1e-8, atol=1e-9)
        assert_allclose(estimates.P[k], P, rtol=1e-8, atol=1e-9)


def drifting(noise: np.ndarray, seed: int = 0) -> tuple[LinearSystem, np.ndarray]:
    """A random walk seen through noise whose variance over time is given; the filter is given 1."""
    rng = np.random.default_rng(seed)
    truth = np.cumsum(0.3 * rng.standard_normal((200, len(noise))), axis=1)
    z = truth + np.sqrt(noise) * rng.standard_normal(truth.shape)
    one = np.ones((1, 1, 1))
    return LinearSystem(one, 0.09 * one, one, one, z[..., None], np.zeros(1), one[0]), truth


@pytest.mark.slow
@pytest.mark.parametrize("filter_", BOTH)
@pytest.mark.parametrize("variance", [0.3, 1.0, 20.0])
def test_the_noise_is_found(filter_, variance):
    # Last estimate of 200 runs with a memory of 100: scatter of one about 20 %, of the mean 1.5 %, and some bias.
    system, _ = drifting(np.full(600, variance))
    found = filter_(system, innovations=True).adaptation[:, -1, 0]
    assert_allclose(found.mean(), variance, rtol=0.12)
    assert np.std(found / variance) < 0.6


@pytest.mark.slow
@pytest.mark.parametrize("filter_", BOTH)
def test_a_change_of_noise_is_followed_and_pays(filter_):
    noise = np.where(np.arange(800) < 400, 1.0, 25.0)
    system, truth = drifting(noise, seed=1)
    estimates = filter_(system, history="sigma")
    plain, said = kalman(system, history="sigma"), kalman(replace(system, R=noise[:, None, None]), history="sigma")
    rms = [float(np.sqrt(np.mean((e.x[..., 0] - truth)[:, 550:] ** 2))) for e in (said, estimates, plain)]
    assert rms[0] < rms[1] < 1.1 * rms[0] < rms[2]
    ratio = np.sqrt(np.mean(((estimates.x[..., 0] - truth) / estimates.sigma[..., 0])[:, 550:] ** 2))
    assert 0.85 < ratio < 1.2  # and its sigma is honest, where the plain filter's is twice too small
    assert np.sqrt(np.mean(((plain.x[..., 0] - truth) / plain.sigma[..., 0])[:, 550:] ** 2)) > 1.5


@pytest.mark.parametrize("filter_", BOTH)
def test_chunks_give_the_bits_of_the_batch(filter_):
    system = simple(20)
    batch = filter_(system, history="full")
    first = filter_(system.between(0, 6), history="full")
    second = filter_(system.between(6, 20), first.state, history="full")
    for name in ("x", "P", "adaptation", "nis", "innovation_covariance"):
        assert_array_equal(np.concatenate([getattr(first, name), getattr(second, name)]), getattr(batch, name))
    assert_array_equal(second.log_likelihood, batch.log_likelihood)


def test_noise_known_for_certain_is_the_kalman_filter():
    system = replace(simple(), R=2.0 * np.eye(3)[None])
    plain = kalman(system, history="full")
    assert_array_equal(sage_husa(system, smallest=1.0, largest=1.0, history="full").P, plain.P)
    assert_allclose(variational(system, worth=1e12, rho=1.0, history="full").P, plain.P, rtol=1e-9, atol=1e-12)


def test_options_are_checked():
    system = simple()
    for filter_, options, message in (
        (sage_husa, {"b": 1.0}, "b is 1.0"),
        (sage_husa, {"smallest": 2.0}, "smallest is 2.0"),
        (variational, {"rho": 0.0}, "rho is 0.0"),
        (variational, {"worth": 0.0}, "worth is 0.0"),
        (variational, {"iterations": 0}, "iterations is 0"),
    ):
        with pytest.raises(UsageError, match=message):
            filter_(system, **options)
    for filter_ in BOTH:
        with pytest.raises(UsageError, match="R is not diagonal"):
            filter_(random_system(S=False))
        with pytest.raises(UsageError, match="S is given"):
            filter_(replace(system, S=np.full((1, 4, 3), 1e-3)))
    with pytest.raises(UsageError, match="R has a zero"):
        variational(replace(system, R=np.zeros((1, 3, 3))))
