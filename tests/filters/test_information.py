"""The information filter and the backward-forward smoother, against the dense joint Gaussian and least squares."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, assert_is_joint, one_run, random_system, three_states
from tests.filters.test_kalman import SYSTEMS, TIGHT
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import (
    InformationState,
    LinearSystem,
    information,
    information_behind,
    kalman,
    no_information,
    smoother,
    two_filter_smoother,
)

WITHOUT_S = {name: {**options, "S": False} for name, options in SYSTEMS.items()}


@pytest.mark.parametrize("kind", WITHOUT_S)
def test_filter_is_the_joint_gaussian(kind):
    system = random_system(**WITHOUT_S[kind])
    dense = Dense.of(system)
    estimates = information(system, history="full")
    for k in range(system.epochs):
        x, P = dense.state(k, k + 1)
        assert_allclose(estimates.x[k], x, **TIGHT)
        assert_allclose(estimates.P[k], P, **TIGHT)
        assert_allclose(estimates.sigma[k], np.sqrt(np.diag(P)), **TIGHT)
    last = information(system)
    assert_array_equal(last.x[-1], estimates.x[-1])


@pytest.mark.parametrize("kind", WITHOUT_S)
def test_two_filter_smoother_is_the_joint_gaussian(kind):
    system = random_system(**WITHOUT_S[kind])
    dense = Dense.of(system)
    smoothed, other = two_filter_smoother(system), smoother(system)
    for k in range(system.epochs):
        x, P = dense.state(k, system.epochs)
        assert_allclose(smoothed.x[k], x, **TIGHT)
        assert_allclose(smoothed.P[k], P, **TIGHT)
        assert_allclose(smoothed.sigma[k], np.sqrt(np.diag(P)), **TIGHT)
    assert_allclose(smoothed.x0, other.x0, **TIGHT)
    assert_allclose(smoothed.P0, other.P0, **TIGHT)


def least_squares(system: LinearSystem, until: int) -> tuple[np.ndarray, np.ndarray]:
    """State at epoch ``until - 1`` without a prior: all states as unknowns of one least-squares problem."""
    n, K = system.states, until
    rows, right = [], []

    def weigh(block, value, covariance):
        W = np.linalg.inv(np.linalg.cholesky(covariance))
        rows.append(W @ block)
        right.append(W @ value)

    for k in range(K):
        block = np.zeros((n, n * (K + 1)))
        block[:, n * k : n * (k + 1)] = -system.Phi[k]
        block[:, n * (k + 1) : n * (k + 2)] = np.eye(n)
        weigh(block, system.u[k], system.Q[k])
        have = np.isfinite(system.z[k])
        block = np.zeros((have.sum(), n * (K + 1)))
        block[:, n * (k + 1) : n * (k + 2)] = system.H[k][have]
        weigh(block, system.z[k][have], system.R[k][np.ix_(have, have)])
    A, b = np.vstack(rows), np.concatenate(right)
    return np.linalg.lstsq(A, b, rcond=None)[0][-n:], np.linalg.inv(A.T @ A)[-n:, -n:]


def test_nothing_known_is_least_squares():
    system = random_system(n=4, m=1, epochs=9, S=False, missing=0.0)
    estimates = information(system, no_information(system), history="full")
    # Four states and one row an epoch: nothing is determined before the fourth measurement.
    assert np.all(np.isnan(estimates.x[:3]))
    assert np.all(np.isinf(estimates.sigma[:3]))
    for k in range(3, 9):
        x, P = least_squares(system, k + 1)
        assert_allclose(estimates.x[k], x, rtol=1e-7)
        assert_allclose(estimates.P[k], P, rtol=1e-7)


def test_what_is_determined_is_shown_before_all_is():
    # Two constants; only the first is measured, the second comes with epoch 2. Units of the second: micro.
    z = np.array([[1.0, np.nan], [3.0, np.nan], [2.0, 5e-6]])
    system = LinearSystem(
        Phi=np.eye(2)[None],
        Q=np.zeros((1, 2, 2)),
        H=np.eye(2)[None],
        R=np.diag([1.0, 1e-12])[None],
        z=z,
        x0=np.zeros(2),
        P0=np.eye(2),
    )
    estimates = information(system, no_information(system), history="full")
    assert_allclose(estimates.x, [[1.0, np.nan], [2.0, np.nan], [2.0, 5e-6]], rtol=1e-12)
    assert_allclose(estimates.sigma, [[1.0, np.inf], [np.sqrt(0.5), np.inf], [np.sqrt(1 / 3), 1e-6]], rtol=1e-12)
    assert np.isnan(estimates.P[0, 0, 1])
    # Only their sum measured: neither is known, and no number says otherwise.
    total = replace(system, H=np.array([[[1.0, 1.0], [2.0, 2.0]]]), z=np.array([[1.0, 2.0]]))
    assert np.all(np.isinf(information(total, no_information(total)).sigma))


def test_partial_information_and_chunks():
    system = random_system(epochs=8, S=False)
    whole = information(system)
    first = information(system.between(0, 3))
    second = information(system.between(3, 8), first.state)
    assert_allclose(second.x, whole.x, **TIGHT)
    prior = InformationState(np.linalg.solve(system.P0, system.x0), np.linalg.inv(system.P0))
    assert_allclose(information(system, prior).P, whole.P, **TIGHT)


def test_information_behind_is_what_the_prior_does_not_hold():
    # P0 after smoothing: P0^-1 + Y.
    system = random_system(epochs=6, S=False)
    behind = information_behind(system)
    assert_allclose(np.linalg.inv(np.linalg.inv(system.P0) + behind.Y[0]), smoother(system).P0, **TIGHT)
    assert not behind.Y[-1].any()


def test_two_filter_smoother_takes_singular_covariances_and_goes_on():
    Q, H = np.outer([1.0, 2.0, 0.0], [1.0, 2.0, 0.0]), [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]]
    system = three_states(Q, H, [0.1, 0.3], [[1.0, np.nan], [1.3, 2.0], [0.4, 0.2]])
    smoothed = two_filter_smoother(system)
    assert_is_joint(system, smoothed, upto=3, **TIGHT)
    late = two_filter_smoother(system.between(1, 3), kalman(system.between(0, 1)).state)
    assert_allclose(late.x, smoothed.x[1:], **TIGHT)
    assert_allclose(late.x0, smoothed.x[0], **TIGHT)


def test_runs_are_those_alone():
    system = random_system(runs=(2, 3), epochs=4, S=False)
    together, smoothed = information(system, history="full"), two_filter_smoother(system)
    for index in np.ndindex(2, 3):
        alone = one_run(system, index)
        assert_allclose(together.P[index], information(alone, history="full").P, rtol=1e-12)
        assert_allclose(smoothed.x[index], two_filter_smoother(alone).x, **TIGHT)


def test_bad_input_is_said():
    system = random_system(epochs=3, S=False, missing=0.0)
    with pytest.raises(UsageError, match="S is given"):
        information(random_system())
    with pytest.raises(UsageError, match="history is 'sigma'"):
        information(system, history="sigma")
    Phi, R = system.Phi.copy(), system.R.copy()
    Phi[1] = 0.0
    with pytest.raises(DataError, match="Phi is singular at epoch 1"):
        information(replace(system, Phi=Phi))
    R[2] = 0.0
    with pytest.raises(DataError, match="R is singular at epoch 2"):
        information(replace(system, R=R))
    with pytest.raises(DataError, match="P0 is singular"):
        information(replace(system, P0=np.zeros((4, 4))))
