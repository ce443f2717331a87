"""Fusion against the joint Gaussian of both estimates, and the federated filter against the central one."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.filters.dense import random_system
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import (
    LinearSystem,
    covariance_intersection,
    cross_covariance,
    diagonal_weighted,
    federated,
    fuse,
    kalman,
)

TIGHT = {"rtol": 1e-9, "atol": 1e-9}


def joint(seed=0, n=3):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((2 * n, 2 * n))
    C = root @ root.T
    return C[:n, :n], C[n:, n:], C[:n, n:], rng.standard_normal(n), rng.standard_normal(n)


def sensors(epochs=8, m=3, **options) -> list[LinearSystem]:
    """Two filters of one process, the rows of a system shared between them."""
    whole = random_system(epochs=epochs, m=m, S=False, diagonal_R=True, **options)
    parts = [slice(0, 1), slice(1, m)]
    return [whole] + [replace(whole, H=whole.H[..., i, :], R=whole.R[..., i, i], z=whole.z[..., i]) for i in parts]


def test_fusion_is_generalised_least_squares():
    A, B, C, a, b = joint()
    fused = fuse(a, A, b, B, C)
    W = np.linalg.inv(np.block([[A, C], [C.T, B]]))
    E = np.vstack([np.eye(3), np.eye(3)])
    P = np.linalg.inv(E.T @ W @ E)
    assert_allclose(fused.P, P, **TIGHT)
    assert_allclose(fused.x, P @ E.T @ W @ np.concatenate([a, b]), **TIGHT)
    assert_allclose(fused.x, fused.weight @ a + (np.eye(3) - fused.weight) @ b, **TIGHT)


@pytest.mark.parametrize("weights", ["variances", "optimal"])
def test_diagonal_weights_and_their_true_covariance(weights):
    A, B, C, a, b = joint(1)
    fused = diagonal_weighted(a, A, b, B, C, weights)
    w = fused.weight
    V = np.eye(3) - w
    assert_allclose(fused.P, w @ A @ w + V @ B @ V + w @ C @ V + V @ C.T @ w, **TIGHT)
    assert_allclose(fused.x, w @ a + V @ b, **TIGHT)
    if weights == "optimal":
        for i in range(3):  # no other weight leaves a smaller variance
            for step in (-1e-3, 1e-3):
                u = w[i, i] + step
                assert u**2 * A[i, i] + (1 - u) ** 2 * B[i, i] + 2 * u * (1 - u) * C[i, i] > fused.P[i, i]
        assert np.all(np.diag(fused.P) <= np.diag(diagonal_weighted(a, A, b, B, C).P) + 1e-12)
    else:
        assert_allclose(np.diag(w), np.diag(B) / (np.diag(A) + np.diag(B)))
    assert np.all(np.diag(fuse(a, A, b, B, C).P) <= np.diag(fused.P) + 1e-12)


def test_intersection_is_safe_for_every_correlation():
    A, B, _, a, b = joint(2)
    fused = covariance_intersection(a, A, b, B)
    w = fused.weight
    assert 0.0 < w < 1.0
    assert_allclose(np.linalg.inv(fused.P), w * np.linalg.inv(A) + (1 - w) * np.linalg.inv(B), **TIGHT)
    for step in (-1e-3, 1e-3):
        other = (w + step) * np.linalg.inv(A) + (1 - w - step) * np.linalg.inv(B)
        assert np.linalg.det(other) < 1.0 / np.linalg.det(fused.P)
    # The true covariance of the result under any admissible correlation L1 U L2' stays below P.
    L1, L2, rng = np.linalg.cholesky(A), np.linalg.cholesky(B), np.random.default_rng(3)
    W1, W2 = w * fused.P @ np.linalg.inv(A), (1 - w) * fused.P @ np.linalg.inv(B)
    for _ in range(200):
        C = L1 @ np.linalg.qr(rng.standard_normal((3, 3)))[0] @ L2.T
        true = W1 @ A @ W1.T + W2 @ B @ W2.T + W1 @ C @ W2.T + W2 @ C.T @ W1.T
        assert np.linalg.eigvalsh(fused.P - true).min() > -1e-9
    # One estimate better in everything stands alone.
    alone = covariance_intersection(a, A, b, 4.0 * A)
    assert_allclose(alone.P, A, rtol=1e-12)
    assert_allclose(alone.x, a, rtol=1e-12)
    # Runs in front.
    many = covariance_intersection(np.stack([a, b]), np.stack([A, B]), np.stack([b, a]), np.stack([B, A]))
    assert_allclose(many.P, np.stack([fused.P, fused.P]), rtol=1e-6)


def true_covariance(whole, estimates) -> np.ndarray:
    """Covariance of the last errors of linear estimators, stacked, by their response to each unit cause.

    ``estimates(z)`` gives a list of final estimates from ``x0 = 0``.
    """
    n, m, K = whole.states, whole.rows, whole.epochs
    causes = n + K * (n + m)
    cov = np.zeros((causes, causes))
    cov[:n, :n] = whole.P0
    errors = []
    for unit in np.eye(causes):
        x, z = unit[:n], np.empty((K, m))
        for k in range(K):
            at = n + k * (n + m)
            x = whole.Phi[k] @ x + unit[at : at + n]
            z[k] = whole.H[k] @ x + unit[at + n : at + n + m]
            cov[at : at + n, at : at + n] = whole.Q[k]
            cov[at + n : at + n + m, at + n : at + n + m] = whole.R[k]
        errors.append(np.concatenate([estimate - x for estimate in estimates(z)]))
    return np.array(errors).T @ cov @ np.array(errors)


def given(system, z):
    return replace(system, z=z, x0=np.zeros(system.states))


def test_cross_covariance_is_that_of_the_filters():
    whole, one, two = sensors(epochs=3, missing=0.0, u=False)
    true = true_covariance(whole, lambda z: [kalman(given(one, z[:, :1])).x[-1], kalman(given(two, z[:, 1:])).x[-1]])
    P12 = true[:4, 4:]
    assert_allclose(cross_covariance(one, two)[-1], P12, **TIGHT)
    # A sensor that both use: with its R the two filters are one, and so are their errors.
    same = cross_covariance(one, one, R=one.R)
    assert_allclose(same, kalman(one, history="full").P, **TIGHT)
    # Fused, they are better than either and no better than the central filter.
    f1, f2 = kalman(one), kalman(two)
    fused = fuse(f1.x[-1], f1.P[-1], f2.x[-1], f2.P[-1], P12)
    central = kalman(whole).P[-1]
    for larger, smaller in ((f1.P[-1], fused.P), (f2.P[-1], fused.P), (fused.P, central)):
        assert np.linalg.eigvalsh(larger - smaller).min() > -1e-9
    # Taken for independent they would claim what they do not have.
    naive = fuse(f1.x[-1], f1.P[-1], f2.x[-1], f2.P[-1], np.zeros((4, 4)))
    assert np.linalg.eigvalsh(naive.P - fused.P).min() < -1e-3


@pytest.mark.parametrize(("every", "reset"), [(1, True), (2, True), (2, False)])
def test_federated_never_claims_too_much(every, reset):
    whole, one, two = sensors(epochs=5, missing=0.0, u=False)

    def fused(z):
        return [federated([given(one, z[:, :1]), given(two, z[:, 1:])], every=every, reset=reset).x[-1]]

    P = federated([one, two], every=every, reset=reset).P[-1]
    assert np.linalg.eigvalsh(P - true_covariance(whole, fused)).min() > -1e-9


@pytest.mark.parametrize("shares", [None, (0.2, 0.8)])
def test_federated_with_resets_is_the_central_filter(shares):
    whole, *local = sensors(epochs=8)
    central = kalman(whole, history="full")
    result = federated(local, shares=shares)
    assert_allclose(result.x, central.x, **TIGHT)
    assert_allclose(result.P, central.P, **TIGHT)
    assert_allclose(result.sigma, central.sigma, **TIGHT)
    assert result.epochs.tolist() == list(range(8))


@pytest.mark.parametrize("reset", [True, False])
def test_federated_with_rare_resets_is_an_upper_bound(reset):
    whole, *local = sensors(epochs=10, runs=(2,))
    result = federated(local, every=4, reset=reset)
    assert result.epochs.tolist() == [3, 7, 9]
    central = kalman(whole, history="full").P[:, result.epochs]
    assert np.linalg.eigvalsh(result.P - central).min() > -1e-9
    assert np.abs(result.P - central).max() > 1e-3
    alone = federated(
        [LinearSystem(**{k: None if a is None else a[1] for k, a in vars(s).items()}) for s in local],
        every=4,
        reset=reset,
    )
    assert_allclose(result.x[1], alone.x, **TIGHT)


def test_bad_input_is_said():
    A, B, C, a, b = joint()
    with pytest.raises(DataError, match="singular"):
        fuse(a, A, a, A, A)
    with pytest.raises(UsageError, match=r"P2 has shape \(2, 2\), expected \(..., 3, 3\)"):
        fuse(a, A, b, np.eye(2), C)
    with pytest.raises(UsageError, match="weights is 'some'"):
        diagonal_weighted(a, A, b, B, C, "some")
    _, *local = sensors()
    with pytest.raises(UsageError, match=r"shares are \[0.5, 0.6\]"):
        federated(local, shares=(0.5, 0.6))
    with pytest.raises(UsageError, match="every is 0"):
        federated(local, every=0)
    with pytest.raises(UsageError, match="expected two or more alike"):
        federated(local[:1])
    with pytest.raises(UsageError, match="first has run axes or S"):
        cross_covariance(random_system(), local[0])
