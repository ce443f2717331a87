"""Groups of error states: how they run by themselves, what they do to the INS, and states that are only considered."""

import numpy as np
import pytest
from scipy.linalg import expm

from truenorth.core.errors import UsageError
from truenorth.core.linalg import load, padded
from truenorth.errors.dynamics import dynamics_of, noise_of_pairs, second_order
from truenorth.errors.group import Group
from truenorth.estimate.correct import update_held
from truenorth.filters.recursion import workspace
from truenorth.state.layout import STATES


@pytest.mark.parametrize("zeta", [0.0, 0.3, 1.0])
def test_a_process_of_second_order_is_its_matrix_exponential(zeta):
    omega, T, sigma = 0.7, 0.9, 2.0
    A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])
    Phi = np.array(second_order(omega, zeta, T)).reshape(2, 2)
    np.testing.assert_allclose(Phi, expm(A * T), atol=1e-14)
    d = dynamics_of([Group("sway", [sigma], frequency=omega, damping=zeta)], np.zeros(STATES))
    n = STATES + 2
    whole, Q = np.eye(n), np.zeros((n, n))
    whole[STATES:, STATES:] = Phi
    noise_of_pairs(d, whole, Q)
    still = sigma**2 * np.diag([1.0, omega**2])
    np.testing.assert_allclose(Phi @ still @ Phi.T + Q[STATES:, STATES:], still, atol=1e-13)
    if zeta == 0.0:  # an oscillator has no noise
        np.testing.assert_allclose(Q, 0.0, atol=1e-13)


def test_a_considered_state_counts_and_stays():
    """Joseph's form with a gain of zero for it, on random numbers; without considered states the optimal update."""
    rng = np.random.default_rng(1)
    n = 6
    A = rng.standard_normal((n, n))
    P, h, r, nu = A @ A.T, rng.standard_normal(n), 0.7, 1.3
    held = np.array([False, False, True, False, True, False])
    for mask in (held, np.zeros(n, bool)):
        w = workspace(padded(n), 1)
        load(padded(n), P, w.P)
        w.H[0, :n], w.R[0, 0], w.z[0] = h, r, nu
        assert update_held(padded(n), w, mask) == 0
        k = np.where(mask, 0.0, P @ h / (h @ P @ h + r))
        J = np.eye(n) - np.outer(k, h)
        np.testing.assert_allclose(w.P[:n, :n], J @ P @ J.T + r * np.outer(k, k), rtol=1e-12)
        np.testing.assert_allclose(w.x[:n], k * nu)
        np.testing.assert_allclose(np.diag(w.P)[:n][mask], np.diag(P)[mask])


def test_contradictions_are_refused():
    with pytest.raises(UsageError, match="three of a rotation"):
        Group("mounting", [1.0], rotation=True)
    with pytest.raises(UsageError, match="damping"):
        Group("sway", [1.0], frequency=1.0, damping=2.0)
