"""The square-root filter: against the dense joint Gaussian, against rational numbers, and over very long runs."""

from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, assert_is_joint, one_run, random_system, three_states
from tests.filters.test_kalman import SYSTEMS, TIGHT
from truenorth.core.errors import DataError
from truenorth.filters import LinearSystem, kalman, square_root


@pytest.mark.parametrize("kind", [kind for kind in SYSTEMS if kind != "seventeen states"])  # 6 s of compiling
def test_filter_is_the_joint_gaussian(kind):
    system = random_system(**SYSTEMS[kind])
    dense, plain = Dense.of(system), kalman(system, history="full")
    estimates = square_root(system, history="full")
    for k in range(system.epochs):
        x, P = dense.state(k, k + 1)
        assert_allclose(estimates.x[k], x, **TIGHT)
        assert_allclose(estimates.P[k], P, **TIGHT)
    for name in ("sigma", "innovation", "innovation_covariance", "nis"):
        assert_allclose(getattr(estimates, name), getattr(plain, name), **TIGHT)
    assert_allclose(estimates.log_likelihood, dense.log_likelihood(), **TIGHT)


def test_histories_and_chunks_give_the_bits_of_the_batch():
    system = random_system(epochs=20)
    batch, last = square_root(system, history="full"), square_root(system)
    assert_array_equal(last.P[-1], batch.P[-1])
    assert_array_equal(last.x[-1], batch.x[-1])
    first = square_root(system.between(0, 7))
    second = square_root(system.between(7, 20), first.state, history="full")
    for name in ("x", "P", "nis"):
        assert_array_equal(getattr(second, name), getattr(batch, name)[7:])
    assert_array_equal(second.state.memory, batch.state.memory)
    assert_array_equal(second.log_likelihood, batch.log_likelihood)


def test_runs_are_those_alone_to_the_bit():
    system = random_system(runs=(3,), epochs=5)
    together = square_root(system, history="full", workers=2)
    for i in range(3):
        assert_array_equal(together.P[i], square_root(one_run(system, (i,)), history="full").P)


def test_singular_noise_and_prior_pass():
    Q, H = np.outer([1.0, 2.0, 0.0], [1.0, 2.0, 0.0]), [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]]
    system = three_states(Q, H, [0.0, 0.3], [[1.0, np.nan], [1.3, 2.0], [0.4, 0.2]], x0=(0.0, 0.0, 0.0))
    assert_is_joint(system, square_root(system, history="full"), **TIGHT)


SLOPE = 1e-3


def stiff(epochs: int, prior: float) -> LinearSystem:
    """Two unknown constants, seen through two almost parallel rows of noise 1."""
    return LinearSystem(
        Phi=np.eye(2)[None],
        Q=np.zeros((1, 2, 2)),
        H=np.array([[[1.0, 1.0], [1.0, 1.0 + SLOPE]]]),
        R=np.eye(2)[None],
        z=np.zeros((epochs, 2)),
        x0=np.zeros(2),
        P0=prior * np.eye(2),
    )


def stiff_covariance(epochs: int, prior: float) -> np.ndarray:
    """Its P in rational numbers: ``P^-1 = epochs H' H + P0^-1``."""
    s, first = Fraction(1.0 + SLOPE), 1 / Fraction(prior)
    a, b, c = 2 * epochs + first, epochs * (1 + s), epochs * (1 + s * s) + first
    return (np.array([[c, -b], [-b, a]]) / (a * c - b * b)).astype(float)


@pytest.mark.parametrize("prior", [1e13, 1e15, 1e16, 1e18])
def test_precision_beyond_a_covariance(prior):
    # P0 / R = 1e16 and more is beyond what a covariance holds, in whatever form: then it is said, never passed over.
    exact = stiff_covariance(10, prior)
    assert_allclose(square_root(stiff(10, prior)).P[-1], exact, rtol=1e-11)
    with pytest.raises(DataError, match="epoch 0: the covariance P is lost in rounding; use Joseph's form"):
        kalman(stiff(10, prior), joseph=False)
    if prior < 1e16:
        assert_allclose(kalman(stiff(10, prior)).P[-1], exact, rtol=1e-2)
    else:
        with pytest.raises(DataError, match=r"epoch 0: the covariance P is lost in rounding.*square_root"):
            kalman(stiff(10, prior))


def test_a_huge_prior_that_a_covariance_can_hold_is_no_trouble():
    # Rows that read off one state each: P0 / R = 1e24 leaves small numbers in P.
    system = stiff(10, 1e24)
    apart = LinearSystem(system.Phi, system.Q, np.eye(2)[None], system.R, system.z, system.x0, system.P0)
    assert_allclose(kalman(apart).P[-1], 0.1 * np.eye(2), rtol=1e-9)


def run_in_blocks(blocks: int, length: int) -> None:
    """Symmetric, positive definite and true after each block."""
    system, state = stiff(length, 1e18), None
    for block in range(1, blocks + 1):
        state = square_root(system, state).state
        assert_array_equal(state.P, state.P.T)
        assert np.linalg.eigvalsh(state.P).min() > 0.0
        assert_allclose(state.P, stiff_covariance(length * block, 1e18), rtol=1e-9)


def test_a_hundred_thousand_steps_stay_positive_and_true():
    run_in_blocks(10, 10_000)


@pytest.mark.slow
def test_ten_million_steps_stay_positive_and_true():
    run_in_blocks(100, 100_000)  # 7 s
