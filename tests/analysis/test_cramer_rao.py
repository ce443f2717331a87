"""The Cramer-Rao bound: the Kalman filter's P where all is linear, and below every estimator's errors where it is not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.filters.dense import random_system
from tests.filters.nonlinear_models import tracking
from truenorth.analysis.cramer_rao import cramer_rao, linearised_at
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem, extended, kalman

RUNS, EPOCHS, LANDMARKS = 4000, 30, np.array([[0.0, 0.0], [40.0, 10.0]])
Q = np.diag([1e-2, 1e-2, 1e-4])
P0 = np.diag([4.0, 4.0, 0.04])
R = np.array([[0.25]])


@pytest.mark.parametrize("constant", [False, True])
def test_of_a_linear_system_it_is_the_kalman_filters(constant):
    system = random_system(epochs=10, S=False, constant=constant)
    bound = cramer_rao(system)
    assert_allclose(bound.P, kalman(system, history="full").P, rtol=1e-9, atol=1e-11)
    assert_allclose(bound.sigma, kalman(system, history="sigma").sigma, rtol=1e-9)


def test_without_process_noise_and_with_micro_units():
    units = np.array([1.0, 1e-7, 1e4, 1e-3])
    system = random_system(epochs=10, S=False)
    quiet = replace(system, Q=np.zeros((1, 4, 4)))
    scaled = replace(
        quiet, Phi=quiet.Phi * units[:, None] / units, H=quiet.H / units, P0=quiet.P0 * np.outer(units, units)
    )
    assert_allclose(cramer_rao(scaled).sigma / units, kalman(quiet, history="sigma").sigma, rtol=1e-8)


def test_the_general_recursion_is_the_linear_one_in_the_limit():
    # Runs whose Phi differ by next to nothing take Tichavsky's general form.
    system = random_system(epochs=10, S=False)
    rng = np.random.default_rng(0)
    many = replace(system, Phi=system.Phi + 1e-9 * rng.standard_normal((50, *system.Phi.shape)))
    assert_allclose(cramer_rao(many).P, kalman(system, history="full").P, rtol=1e-6, atol=1e-9)


def walk(rng) -> tuple[np.ndarray, np.ndarray]:
    """A walker who turns: x, y, heading; truths and ranges to two landmarks in turn."""
    x = rng.multivariate_normal([10.0, -15.0, 0.5], P0, RUNS)
    truth, z = np.empty((RUNS, EPOCHS, 3)), np.empty((RUNS, EPOCHS, 1))
    for k in range(EPOCHS):
        x = move(x, k) + rng.multivariate_normal(np.zeros(3), Q, RUNS)
        truth[:, k] = x
        z[:, k, 0] = np.linalg.norm(x[:, :2] - LANDMARKS[k % 2], axis=1) + 0.5 * rng.standard_normal(RUNS)
    return truth, z


def move(x: np.ndarray, k: int) -> np.ndarray:
    heading = x[:, 2] + 0.05 * k
    return x + np.stack([np.cos(heading), np.sin(heading), np.zeros(len(x))], axis=1)


def jacobians(before: np.ndarray, after: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
    F, H = np.tile(np.eye(3), (len(before), 1, 1)), np.zeros((len(before), 1, 3))
    heading = before[:, 2] + 0.05 * k
    F[:, 0, 2], F[:, 1, 2] = -np.sin(heading), np.cos(heading)
    away = after[:, :2] - LANDMARKS[k % 2]
    H[:, 0, :2] = away / np.linalg.norm(away, axis=1, keepdims=True)
    return F, H


def test_no_estimator_is_better_than_the_bound():
    # Range-only localisation of a walker, 4000 runs. The estimator is an extended Kalman filter over all runs at once;
    # it is near the bound at the end and never significantly below it: the sigma of a measured variance that meets the
    # bound is sqrt(2 / 4000) = 2.2 %; 5 of these in some 50 distinct directions of 30 epochs: p < 5e-4.
    rng = np.random.default_rng(1)
    truth, z = walk(rng)
    start = rng.multivariate_normal([10.0, -15.0, 0.5], P0, RUNS)  # another draw: the expectation has its own data
    Phi, H = np.empty((RUNS, EPOCHS, 3, 3)), np.empty((RUNS, EPOCHS, 1, 3))
    x = start
    for k in range(EPOCHS):
        after = move(x, k) + rng.multivariate_normal(np.zeros(3), Q, RUNS)
        Phi[:, k], H[:, k] = jacobians(x, after, k)
        x = after
    bound = cramer_rao(LinearSystem(Phi, Q[None], H, R[None], np.zeros((EPOCHS, 1)), np.zeros(3), P0))

    x, P = np.tile([10.0, -15.0, 0.5], (RUNS, 1)), np.tile(P0, (RUNS, 1, 1))
    measured = np.empty((EPOCHS, 3, 3))
    for k in range(EPOCHS):
        after = move(x, k)
        F, H_k = jacobians(x, after, k)
        P = F @ P @ np.swapaxes(F, 1, 2) + Q
        W = H_k @ P @ np.swapaxes(H_k, 1, 2) + R
        K = P @ np.swapaxes(H_k, 1, 2) / W
        nu = z[:, k, 0] - np.linalg.norm(after[:, :2] - LANDMARKS[k % 2], axis=1)
        x = after + K[..., 0] * nu[:, None]
        P = P - K @ W @ np.swapaxes(K, 1, 2)
        e = x - truth[:, k]
        measured[k] = e.T @ e / RUNS
    # In the axes in which the bound is unity, no direction's measured variance falls below 1.
    L = np.linalg.cholesky(bound.P)
    half = np.linalg.solve(L, measured)
    ratio = np.linalg.eigvalsh(np.linalg.solve(L, np.swapaxes(half, 1, 2)))
    assert ratio.min() > 1.0 - 5.0 * np.sqrt(2.0 / RUNS)
    assert ratio[-1].max() < 1.3  # and it is a bound that can nearly be met


def test_a_nonlinear_system_enters_by_its_tangent_at_the_truth():
    # Targets by range and bearing: 300 trajectories for the bound, 2000 others for the extended filter's error. Their
    # variance scatters by sqrt(2 / 2000) = 3.2 %; five of these below the bound in 12 directions: p < 1e-5.
    rng = np.random.default_rng(4)
    drawn, truth = tracking(300, 12, rng)
    one = replace(drawn, z=np.zeros((12, 2)))
    before = truth[:, :1]  # the motion is linear: its tangent is the same anywhere
    bound = cramer_rao(linearised_at(one, np.concatenate([before, truth], axis=1)))
    system, truth = tracking(2000, 12, rng)
    e = extended(system, history="full").x - truth
    L = np.linalg.cholesky(bound.P[-1])
    ratio = np.linalg.eigvalsh(np.linalg.solve(L, np.linalg.solve(L, e[:, -1].T @ e[:, -1] / len(e)).T))
    assert ratio.min() > 1.0 - 5.0 * np.sqrt(2.0 / len(e))
    assert ratio.max() < 1.0 + 8.0 * np.sqrt(2.0 / len(e))  # nearly linear: the filter all but meets it
    with pytest.raises(UsageError, match=r"truth has shape \(300, 12, 4\)"):
        linearised_at(one, truth[:300])


def test_bad_input_is_said():
    system = random_system(epochs=3, S=False)
    many = replace(system, Phi=np.stack([system.Phi, 2.0 * system.Phi]))
    with pytest.raises(DataError, match="Q is singular at epoch 0 while Phi differs"):
        cramer_rao(replace(many, Q=np.zeros((1, 4, 4))))
    with pytest.raises(DataError, match="P0 is singular"):
        cramer_rao(replace(system, P0=np.zeros((4, 4))))
    with pytest.raises(UsageError, match="P0 differs from run to run"):
        cramer_rao(replace(system, P0=np.stack([system.P0, 2.0 * system.P0])))
    with pytest.raises(UsageError, match="S is given"):
        cramer_rao(random_system())
