"""The Kalman filter against the exact dense joint Gaussian, and its bits."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, one_run, random_system
from tests.runs import said_by_a_second_process
from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import padded
from truenorth.filters import LinearSystem, drive, kalman

TIGHT = {"rtol": 1e-9, "atol": 1e-9}

SYSTEMS = {
    "plain": {"u": False, "S": False, "diagonal_R": True, "missing": 0.0},
    "full R": {"u": False, "S": False, "missing": 0.0},
    "missing": {"u": False, "S": False, "diagonal_R": True},
    "missing, full R": {"u": False, "S": False},
    "input": {"S": False},
    "correlated": {"missing": 0.0},
    "everything": {},
    "everything, constant": {"constant": True},
    "one state": {"n": 1, "m": 2},
    "nine states": {"n": 9, "m": 4, "epochs": 4},
    "seventeen states": {"n": 17, "m": 2, "epochs": 3},
}


@pytest.mark.parametrize("joseph", [True, False])
@pytest.mark.parametrize("kind", SYSTEMS)
def test_filter_is_the_joint_gaussian(kind, joseph):
    system = random_system(**SYSTEMS[kind])
    dense = Dense.of(system)
    estimates = kalman(system, history="full", joseph=joseph)
    for k in range(system.epochs):
        x, P = dense.state(k, k + 1)
        assert_allclose(estimates.x[k], x, **TIGHT)
        assert_allclose(estimates.P[k], P, **TIGHT)
        assert_allclose(estimates.sigma[k], np.sqrt(np.diag(P)), **TIGHT)
        nu, covariance = dense.innovation(k)
        assert_allclose(estimates.innovation[k], nu, **TIGHT)
        assert_allclose(estimates.innovation_covariance[k], covariance, **TIGHT)
        have = np.isfinite(nu)
        nis = nu[have] @ np.linalg.solve(covariance[np.ix_(have, have)], nu[have]) if have.any() else 0.0
        assert_allclose(estimates.nis[k], nis, **TIGHT)
        assert estimates.nis_rows[k] == have.sum()
    assert_allclose(estimates.log_likelihood, dense.log_likelihood(), **TIGHT)


def test_covariance_is_symmetric_to_the_bit():
    P = kalman(random_system(n=9, epochs=30), history="full").P
    assert_array_equal(P, np.swapaxes(P, -1, -2))


def test_wider_padding_changes_no_bit(monkeypatch):
    system = random_system(n=9, epochs=30)
    narrow = kalman(system, history="full")
    monkeypatch.setattr(drive, "padded", lambda n: padded(17))
    wide = kalman(system, history="full")
    for name in ("x", "P", "innovation", "nis", "log_likelihood"):
        assert_array_equal(getattr(wide, name), getattr(narrow, name))


@pytest.mark.parametrize("constant", [False, True])
def test_chunks_give_the_bits_of_the_batch(constant):
    system = random_system(epochs=20, constant=constant)
    batch = kalman(system, history="full")
    state, at = None, 0
    for stop in (1, 2, 9, 20):
        chunk = kalman(system.between(at, stop), state, history="full")
        for name in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis"):
            assert_array_equal(getattr(chunk, name), getattr(batch, name)[at:stop])
        state, at = chunk.state, stop
    assert_array_equal(state.P, batch.state.P)
    assert_array_equal(state.log_likelihood, batch.log_likelihood)


def test_constant_matrices_give_the_bits_of_repeated_ones():
    system = random_system(constant=True)
    repeated = {
        name: np.repeat(getattr(system, name), system.epochs, axis=0) for name in ("Phi", "Q", "H", "R", "u", "S")
    }
    once, often = kalman(system, history="full"), kalman(replace(system, **repeated), history="full")
    assert_array_equal(once.P, often.P)
    assert_array_equal(once.x, often.x)


@pytest.mark.parametrize("workers", [1, 3])
def test_runs_are_those_alone_to_the_bit(workers):
    system = random_system(runs=(2, 4), epochs=5)
    together = kalman(system, history="full", workers=workers)
    for index in np.ndindex(2, 4):
        alone = kalman(one_run(system, index), history="full")
        for name in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood"):
            assert_array_equal(getattr(together, name)[index], getattr(alone, name))


def test_run_axes_broadcast():
    system = random_system(S=False)
    rng = np.random.default_rng(1)
    z = rng.standard_normal((3, 1, system.epochs, system.rows))
    x0 = rng.standard_normal((2, system.states))
    together = kalman(replace(system, z=z, x0=x0), history="full")
    assert together.x.shape == (3, 2, system.epochs, system.states)
    assert together.state.P.shape == (3, 2, system.states, system.states)
    for i, j in np.ndindex(3, 2):
        alone = kalman(replace(system, z=z[i, 0], x0=x0[j]), history="full")
        assert_array_equal(together.x[i, j], alone.x)
        assert_array_equal(together.P[i, j], alone.P)


def test_histories_are_opt_in():
    system = random_system()
    full = kalman(system, history="full")
    for history, of_x in (("last", 1), ("sigma", system.epochs)):
        estimates = kalman(system, history=history)
        assert estimates.x.shape == estimates.sigma.shape == (of_x, system.states)
        assert estimates.P.shape == (1, system.states, system.states)
        assert_array_equal(estimates.x[-1], full.x[-1])
        assert_array_equal(estimates.P[-1], full.P[-1])
        assert_array_equal(estimates.log_likelihood, full.log_likelihood)
        assert len(estimates.innovation) == (0 if history == "last" else system.epochs)
    assert_array_equal(kalman(system, innovations=True).nis, full.nis)


def test_joseph_survives_what_the_plain_form_does_not():
    # Two almost parallel precise measurements of an unknown state, P0 / R = 1e16: the plain form is left with the
    # rounding of the prior. The truth is the information form in rational numbers.
    prior, r, slope = 1e12, 1e-4, 1e-3
    system = LinearSystem(
        Phi=np.eye(2)[None],
        Q=np.zeros((1, 2, 2)),
        H=np.array([[[1.0, 0.0], [1.0, slope]]]),
        R=r * np.eye(2)[None],
        z=np.ones((1, 2)),
        x0=np.zeros(2),
        P0=prior * np.eye(2),
    )
    a, b, c = (
        2 / Fraction(r) + 1 / Fraction(prior),
        Fraction(slope) / Fraction(r),
        Fraction(slope) ** 2 / Fraction(r) + 1 / Fraction(prior),
    )
    exact = np.array([[c, -b], [-b, a]]) / (a * c - b * b)
    assert_allclose(kalman(system).state.P, exact.astype(float), rtol=1e-12)
    with pytest.raises(DataError, match="epoch 0: the covariance P is lost in rounding"):
        kalman(system, joseph=False)


def test_a_second_process_compiles_nothing():
    program = """
import sys
from tests.filters.dense import random_system
from truenorth.filters import kalman, smoother

read_only = random_system()
read_only.z.flags.writeable = False
for system in (random_system(), random_system(n=13, runs=(2,)), read_only):
    for history in ("last", "full"):
        kalman(system, history=history)
        kalman(system, kalman(system).state, joseph=False, innovations=True, workers=2)
    smoother(system)
for module, kernel, of_sizes in (("linear", "linear_runs", "drive"), ("smoother", "smooth_runs", "smoother")):
    padded = sys.modules["truenorth.filters." + of_sizes].padded
    stats = getattr(sys.modules["truenorth.filters." + module], kernel).stats
    sizes = {len(padded(n)) for n in (4, 13)}
    print(sum(stats.cache_misses.values()), sum(stats.cache_hits.values()) - len(sizes))
"""
    expected = ["0", "0", "0", "0"]
    assert said_by_a_second_process(program, expected.__eq__) == expected  # one specialisation a padded size


def test_a_filter_that_breaks_down_says_where():
    system = random_system(S=False, missing=0.0, diagonal_R=True, runs=(2,))
    Q, P0 = np.zeros_like(system.Q), np.zeros_like(system.P0)
    R = system.R.copy()
    R[1, 3] = 0.0
    with pytest.raises(DataError, match="epoch 3 of run 1: the variance of an innovation"):
        kalman(replace(system, Q=Q, P0=P0, R=R))


def test_options_are_checked():
    with pytest.raises(UsageError, match="history is 'all'"):
        kalman(random_system(), history="all")
    with pytest.raises(UsageError, match="workers is 0"):
        kalman(random_system(), workers=0)
