"""Measurements at irregular times: one epoch each, or a regular grid on which most are absent, say the same."""

import numpy as np
from numpy.testing import assert_allclose

from truenorth.filters import LinearSystem, information, kalman, smoother, square_root


def walk(dt: np.ndarray, z: np.ndarray) -> LinearSystem:
    """Position and velocity under white acceleration, over intervals `dt`; a push of .3 m/s^2 is known."""
    K = len(dt)
    Phi, Q, u = np.tile(np.eye(2), (K, 1, 1)), np.empty((K, 2, 2)), np.empty((K, 2))
    Phi[:, 0, 1] = dt
    Q[:, 0, 0], Q[:, 1, 1] = dt**3 / 3.0, dt
    Q[:, 0, 1] = Q[:, 1, 0] = dt**2 / 2.0
    u[:, 0], u[:, 1] = 0.3 * dt**2 / 2.0, 0.3 * dt
    return LinearSystem(
        Phi, Q, np.array([[[1.0, 0.0]]]), np.array([[[0.5]]]), z[:, None], np.zeros(2), np.diag([4.0, 1.0]), u=u
    )


def test_irregular_epochs_are_a_grid_with_gaps():
    rng = np.random.default_rng(0)
    ticks = np.sort(rng.choice(np.arange(1, 200), 25, replace=False))
    values = rng.standard_normal(25)
    irregular = walk(0.1 * np.diff(ticks, prepend=0), values)
    z = np.full(ticks[-1], np.nan)
    z[ticks - 1] = values
    grid = walk(np.full(ticks[-1], 0.1), z)
    for call in (kalman, square_root, information):
        few, many = call(irregular, history="full"), call(grid, history="full")
        assert_allclose(many.x[ticks - 1], few.x, rtol=1e-9, atol=1e-9)
        assert_allclose(many.P[ticks - 1], few.P, rtol=1e-9, atol=1e-9)
    assert_allclose(kalman(irregular).log_likelihood, kalman(grid).log_likelihood, rtol=1e-9)
    assert_allclose(smoother(grid).x[ticks - 1], smoother(irregular).x, rtol=1e-9, atol=1e-9)
