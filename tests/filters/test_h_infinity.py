"""The H-infinity filter keeps its bound against every disturbance, and knows when it cannot."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import random_system
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem, h_infinity, kalman, smallest_bound

L = np.array([[1.0, 0.5, 0.0], [0.0, 0.0, 2.0]])


def base(**options) -> LinearSystem:
    return random_system(n=3, m=2, epochs=5, S=False, u=False, missing=0.0, **options)


def worst_gain(system: LinearSystem, estimate) -> float:
    """Largest ratio of error energy to disturbance energy, over all disturbances: the norm of a matrix.

    Each disturbance of unit energy (initial error, w, v in units of their covariances) is one run of the filter.
    """
    n, m, K = system.states, system.rows, system.epochs
    count = n + K * (n + m)
    d = np.eye(count)
    error = d[:, :n] @ np.linalg.cholesky(system.P0).T
    x, truth, z = system.x0 + error, np.empty((count, K, n)), np.empty((count, K, m))
    for k in range(K):
        at = n + k * (n + m)
        w = d[:, at : at + n] @ np.linalg.cholesky(system.Q[k]).T
        v = d[:, at + n : at + n + m] @ np.linalg.cholesky(system.R[k]).T
        x = x @ system.Phi[k].T + w
        truth[:, k], z[:, k] = x, x @ system.H[k].T + v
    errors = (estimate(replace(system, z=z)).x - truth) @ L.T
    return float(np.linalg.norm(errors.reshape(count, -1), 2))


@pytest.mark.parametrize("seed", range(4))
def test_the_bound_holds_against_the_worst_disturbance(seed):
    # x0 = 0, so that errors are linear in the disturbances.
    system = replace(base(seed=seed), x0=np.zeros(3))
    least = smallest_bound(system, L=L)
    gains = [
        worst_gain(system, lambda s, g=g: h_infinity(s, bound=g, L=L, history="sigma")) for g in (least, 1.3 * least)
    ]
    gain_kf = worst_gain(system, lambda s: kalman(s, history="sigma"))
    assert 0.9 * least < gains[0] <= least * (1.0 + 1e-5)
    assert gains[1] < 1.3 * least
    assert gain_kf > least  # or the Kalman filter would keep a bound that no filter keeps


def test_it_becomes_the_kalman_filter():
    system = random_system(epochs=6)
    plain = kalman(system, history="full")
    for bound, close in ((1e4, 1e-5), (1e9, 1e-12)):
        estimates = h_infinity(system, bound=bound, history="full")
        assert_allclose(estimates.x, plain.x, rtol=close, atol=close)
        assert_allclose(estimates.P, plain.P, rtol=close, atol=close)


def test_information_form():
    # P^-1 = P_pred^-1 + H' R^-1 H - L' L / g^2; the gain is the Kalman filter's of P_pred.
    system = base()
    bound = 1.5 * smallest_bound(system, L=L)
    estimates = h_infinity(system, bound=bound, L=L, history="full")
    x, P = system.x0, system.P0
    for k in range(5):
        Phi, H, R = system.Phi[k], system.H[k], system.R[k]
        x, P = Phi @ x, Phi @ P @ Phi.T + system.Q[k]
        P_kf = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.inv(R) @ H)
        P = np.linalg.inv(np.linalg.inv(P_kf) - L.T @ L / bound**2)
        x = x + P_kf @ H.T @ np.linalg.inv(R) @ (system.z[k] - H @ x)
        assert_allclose(estimates.x[k], x, rtol=1e-8)
        assert_allclose(estimates.P[k], P, rtol=1e-8)
        margins = np.linalg.eigvalsh(np.eye(2) - L @ P_kf @ L.T / bound**2)
        assert estimates.adaptation[k, 0] >= margins.min() - 1e-12
        assert 0.0 < estimates.adaptation[k, 0] < 1.0
    assert_allclose(estimates.state.memory[0], estimates.adaptation.min())


def test_an_impossible_bound_is_refused_with_its_epoch():
    system = base()
    least = smallest_bound(system, L=L)
    h_infinity(system, bound=least, L=L)
    with pytest.raises(DataError, match=r"no H-infinity filter keeps this bound: at epoch \d"):
        h_infinity(system, bound=least * (1.0 - 2e-6), L=L)


def test_chunks_give_the_bits_of_the_batch():
    system = random_system(epochs=10)
    bound = 2.0 * smallest_bound(system)
    batch = h_infinity(system, bound=bound, history="full")
    first = h_infinity(system.between(0, 4), bound=bound)
    second = h_infinity(system.between(4, 10), first.state, bound=bound, history="full")
    assert_array_equal(second.x, batch.x[4:])
    assert_array_equal(second.state.memory, batch.state.memory)


def test_options_are_checked():
    with pytest.raises(UsageError, match="bound is 0"):
        h_infinity(base(), bound=0)
    with pytest.raises(UsageError, match=r"L has shape \(2, 2\)"):
        h_infinity(base(), bound=1.0, L=np.eye(2))
    with pytest.raises(UsageError, match="L x is known exactly"):
        smallest_bound(base(), L=np.zeros((1, 3)))
