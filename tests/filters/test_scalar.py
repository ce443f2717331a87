"""The restricted likelihood of a series against the dense joint Gaussian."""

import numpy as np
import pytest
import scipy.linalg

from truenorth.filters.scalar import deviance

K = 40
PHI = np.array([[0.9, 0.3, 0.0, 0.0], [-0.3, 0.9, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
Q = np.diag([0.2, 0.1, 0.05, 0.01])
P0 = np.zeros((4, 4))
P0[:2, :2] = scipy.linalg.solve_discrete_lyapunov(PHI[:2, :2], Q[:2, :2])
H = np.array([1.0, 0.0, 1.0, 0.0])


def dense(y, B, r):
    """``log|V| + log|B' V^-1 B| + y' (V^-1 - V^-1 B (B' V^-1 B)^-1 B' V^-1) y``."""
    P, V = P0.copy(), np.zeros((K, K))
    for k in range(K):
        if k:
            P = PHI @ P @ PHI.T + Q
        cross = P
        for j in range(k, K):
            V[k, j] = V[j, k] = H @ cross.T @ H if j == k else H @ cross @ H
            cross = PHI @ cross
    V += r * np.eye(K)
    W = np.linalg.inv(V)
    N = B.T @ W @ B
    rest = W - W @ B @ np.linalg.inv(N) @ B.T @ W
    return np.linalg.slogdet(V)[1] + np.linalg.slogdet(N)[1] + y @ rest @ y


@pytest.mark.parametrize("r", [0.5, 1e-3])
def test_against_the_dense_gaussian(r):
    y = np.random.default_rng(3).standard_normal(K)
    B = np.polynomial.legendre.legvander(np.linspace(-1, 1, K), 2)
    assert deviance(PHI, Q, P0, H, r, np.column_stack([y, B]), 2) == pytest.approx(dense(y, B, r), rel=1e-10)


def test_what_is_linear_is_free():
    """Anything added along the columns changes nothing."""
    y = np.random.default_rng(4).standard_normal(K)
    B = np.polynomial.legendre.legvander(np.linspace(-1, 1, K), 2)
    one, two = (deviance(PHI, Q, P0, H, 0.1, np.column_stack([x, B]), 2) for x in (y, y + B @ [3.0, -2.0, 5.0]))
    assert two == pytest.approx(one, rel=1e-9)
