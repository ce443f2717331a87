"""Groups of error states: how they run by themselves, what they do to the INS, and states that are only considered."""

import numpy as np
import pytest
from scipy.linalg import expm

from truenorth.core.errors import UsageError
from truenorth.core.linalg import load, padded
from truenorth.errors.dynamics import couple_pairs, dynamics_of, noise_of_pairs, second_order
from truenorth.errors.group import Group
from truenorth.estimate.correct import touched, update_held
from truenorth.estimate.predict import propagate_errors
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


def test_what_grows_at_a_steady_rate_is_its_matrix_exponential():
    """Value and rate, and what both do to the INS; without noise."""
    sigma, rate, T = 0.2, 1e-4, 0.9
    group = Group("lag", [sigma], drift=rate)
    np.testing.assert_array_equal(group.prior, [sigma, rate])
    d = dynamics_of([group], np.zeros(STATES))
    n = STATES + 2
    A, F = np.zeros((n, n)), np.zeros((n, n))
    F[:9, STATES:] = np.random.default_rng(2).standard_normal((9, 2))
    A[:9, STATES:], A[STATES, STATES + 1] = F[:9, STATES:], 1.0
    Phi, Q = np.eye(n) + T * F, np.ones((n, n))
    couple_pairs(d, F, T, Phi, Phi.T.copy())
    np.testing.assert_allclose(Phi, expm(A * T), atol=1e-14)
    noise_of_pairs(d, Phi, Q)
    np.testing.assert_array_equal(Q[STATES:, STATES:], 0.0)


@pytest.mark.parametrize("more", [{"walk": 1.0}, {"correlation_time": 9.0}, {"frequency": 1.0}])
def test_only_a_constant_grows(more):
    with pytest.raises(UsageError, match="drift"):
        Group("lag", [0.2], drift=1e-4, **more)


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


@pytest.mark.parametrize("reach", [15, 18, 21])
def test_a_covariance_carried_as_far_as_states_act_is_that_of_the_whole_transition(reach):
    """Nine full rows up to `reach`, a diagonal, and two states of second order that act on the INS or do not."""
    rng = np.random.default_rng(reach)
    n = 21
    pair = np.full(n, -1)
    pair[16], pair[19] = 19, -2
    Phi = np.diag(rng.uniform(0.5, 1.0, n))
    Phi[:9, :reach] = rng.standard_normal((9, reach))
    Phi[np.ix_([16, 19], [16, 19])] = rng.standard_normal((2, 2))
    P, Q = (A @ A.T for A in rng.standard_normal((2, n, n)))
    w, size = workspace(padded(n), 1), padded(n)
    for source, place in ((Phi, w.Phi), (Phi.T.copy(), w.Phi_t), (P, w.P), (Q, w.Q)):
        load(size, source, place)
    propagate_errors(max(reach, 20) if reach > 15 else 15, pair, w.Phi, w.Phi_t, w.Q, w.P, w.temporary, w.t)
    np.testing.assert_allclose(w.P[:n, :n], Phi @ P @ Phi.T + Q, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(w.P, w.P.T)
    assert not w.P[n:].any()


def test_rows_know_the_columns_they_touch():
    """To the bit as with all of them."""
    rng = np.random.default_rng(5)
    n, size = 19, padded(19)
    A = rng.standard_normal((n, n))
    one, all_of_it = workspace(size, 3), workspace(size, 3)
    for w in (one, all_of_it):
        load(size, A @ A.T, w.P)
        w.H[0, 4], w.H[1, [2, 17]], w.z[:] = 2.0, [-1.0, 0.3], [0.5, -0.2, np.nan]
        w.R[:] = np.eye(3)
    places = np.zeros(n, dtype=np.int64)
    columns = places[: touched(one.H, places)]
    assert columns.tolist() == [2, 4, 17]
    held = np.zeros(n, dtype=bool)
    assert update_held(size, one, held, columns) == update_held(size, all_of_it, held) == 0
    np.testing.assert_array_equal(one.P, all_of_it.P)
    np.testing.assert_array_equal(one.x, all_of_it.x)


def test_contradictions_are_refused():
    with pytest.raises(UsageError, match="three of a rotation"):
        Group("mounting", [1.0], rotation=True)
    with pytest.raises(UsageError, match="damping"):
        Group("sway", [1.0], frequency=1.0, damping=2.0)
