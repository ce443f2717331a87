"""The steady state against the filter that has settled, and where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.filters.dense import random_system
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem, kalman, steady_state
from truenorth.filters.gains import filter_gains


@pytest.mark.parametrize("S", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_it_is_where_the_filter_settles(S, seed):
    system = random_system(constant=True, epochs=400, missing=0.0, S=S, seed=seed)
    settled, estimates = steady_state(system), kalman(system, history="full")
    gains = filter_gains(system, estimates)
    assert_allclose(settled.P, estimates.P[-1], rtol=1e-9, atol=1e-11)
    assert_allclose(settled.gain, gains.gain[-1], rtol=1e-9, atol=1e-11)
    assert_allclose(settled.innovation_covariance, estimates.innovation_covariance[-1], rtol=1e-9)
    poles = np.linalg.eigvals(gains.step[-1])
    assert_allclose(np.abs(settled.poles), np.sort(np.abs(poles))[::-1], rtol=1e-7, atol=1e-10)


def test_position_and_velocity_by_hand():
    # Kalata's alpha-beta filter: tracking index 1, T = 1: alpha = .75, beta = .5 (P. R. Kalata, 1984, eqs. 11, 12:
    # index^2 = beta^2 / (1 - alpha), beta = 2 (2 - alpha) - 4 sqrt(1 - alpha)).
    g = np.array([0.5, 1.0])
    system = LinearSystem(
        np.array([[[1.0, 1.0], [0.0, 1.0]]]),
        np.outer(g, g)[None],
        np.array([[[1.0, 0.0]]]),
        np.eye(1)[None],
        np.zeros((1, 1)),
        np.zeros(2),
        np.eye(2),
    )
    assert_allclose(steady_state(system).gain, [[0.75], [0.5]], rtol=1e-10)


def test_units_do_not_matter():
    system = random_system(constant=True, missing=0.0, S=False)
    units = np.array([1.0, 1e-8, 1e5, 1e-3])
    other = replace(
        system,
        Phi=system.Phi * units[:, None] / units,
        Q=system.Q * np.outer(units, units),
        H=system.H / units,
    )
    assert_allclose(steady_state(other).gain / units[:, None], steady_state(system).gain, rtol=1e-7)


def test_where_there_is_none_it_says_so():
    def system(Phi, Q, H):
        return LinearSystem(
            np.array(Phi)[None],
            np.diag(Q)[None],
            np.array(H)[None],
            np.eye(1)[None],
            np.zeros((1, 1)),
            np.zeros(2),
            np.eye(2),
        )

    with pytest.raises(DataError, match=r"no process noise reaches the mode with eigenvalue 1:"):
        steady_state(system([[0.9, 1.0], [0.0, 1.0]], [1.0, 0.0], [[1.0, 0.0]]))
    with pytest.raises(DataError, match=r"do not see the mode with eigenvalue 1\.1,"):
        steady_state(system([[0.9, 0.0], [0.0, 1.1]], [1.0, 1.0], [[1.0, 0.0]]))
    with pytest.raises(DataError, match=r"eigenvalue 0\.8[+-]0\.6i"):
        steady_state(system([[0.8, 0.6], [-0.6, 0.8]], [0.0, 0.0], [[1.0, 0.0]]))
    # What dies out by itself need not be seen.
    assert steady_state(system([[0.9, 0.0], [0.0, 0.5]], [1.0, 1.0], [[1.0, 0.0]])).poles[0].real == pytest.approx(0.5)
    with pytest.raises(UsageError, match=r"Phi has shape \(6, 4, 4\)"):
        steady_state(random_system())
