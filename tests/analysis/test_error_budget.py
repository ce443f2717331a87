"""The error budget: its parts add up to the filter's P, and each is what Monte Carlo or a dense calculation says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.filters.dense import random_system
from truenorth.analysis.error_budget import Source, error_budget, sources_of
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.gains import filter_gains

TIGHT = {"rtol": 1e-9, "atol": 1e-11}


def blocks(system: LinearSystem) -> LinearSystem:
    """Without correlation between the first two states and the others."""
    apart = np.kron(np.eye(2), np.ones((2, 2)))
    return replace(system, P0=system.P0 * apart, Q=system.Q * apart)


@pytest.mark.parametrize("S", [False, True])
@pytest.mark.parametrize("constant", [False, True])
def test_parts_add_up_to_the_covariance(S, constant):
    system = blocks(random_system(epochs=12, S=False, constant=constant))
    if S:
        system = replace(system, S=0.05 * np.ones((1, 4, 3)))
    sources = sources_of(system, {"front": slice(0, 2), "back": [2, 3]})
    assert list(sources) == (
        ["front, initial", "back, initial", "noise"]
        if S
        else ["front, initial", "back, initial", "front, noise", "back, noise", "measurement noise"]
    )
    budget = error_budget(system, sources, history="full")
    P = kalman(system, history="full").P
    assert_allclose(budget.P.sum(axis=0), P, **TIGHT)
    assert_allclose(budget.sigma, np.sqrt(np.diagonal(P, axis1=1, axis2=2)), **TIGHT)
    assert_allclose(budget.share.sum(axis=0), 1.0, rtol=1e-12)
    assert_allclose(error_budget(system, sources).P[:, 0], budget.P[:, -1])
    if not S:
        assert np.all(budget.variance >= 0.0)


def test_gains_are_those_of_the_filter():
    system = random_system(epochs=10)
    estimates = kalman(system, history="full")
    gains = filter_gains(system, estimates)
    gain, step, keep = gains.gain, gains.step, gains.keep
    x = system.x0
    for k in range(10):
        predicted = system.Phi[k] @ x + system.u[k]
        nu = np.nan_to_num(estimates.innovation[k])
        x = predicted + gain[k] @ nu
        assert_allclose(x, estimates.x[k], **TIGHT)
        assert_allclose(keep[k] @ system.Phi[k], step[k])
    # Runs in front: each is the one alone.
    many = replace(system, z=np.stack([system.z, system.z[::-1]]))
    both = filter_gains(many, kalman(many, history="full"))
    assert_allclose(both.gain[0], gain, **TIGHT)


def test_what_the_filter_does_not_know_is_counted():
    # A filter that takes R for a quarter of what it is: its true covariance, by the joint Gaussian of linear estimates.
    system = random_system(n=2, m=1, epochs=4, S=False, u=False, missing=0.0)
    budget = error_budget(
        replace(system, R=system.R / 4.0),
        {"all": Source(system.P0, system.Q, system.R)},
        history="full",
    )

    def final_error(x0, w, v):
        x, z = x0, np.empty((4, 1))
        for k in range(4):
            x = system.Phi[k] @ x + w[k]
            z[k] = system.H[k] @ x + v[k]
        return kalman(replace(system, R=system.R / 4.0, z=z, x0=np.zeros(2))).x[-1] - x

    # Column by column: the response of the final error to each unit cause.
    J, cov = [], np.zeros((14, 14))
    for unit in np.eye(14):
        J.append(final_error(unit[:2], unit[2:10].reshape(4, 2), unit[10:].reshape(4, 1)))
    cov[:2, :2] = system.P0
    for k in range(4):
        cov[2 + 2 * k : 4 + 2 * k, 2 + 2 * k : 4 + 2 * k] = system.Q[k]
        cov[10 + k, 10 + k] = system.R[k, 0, 0]
    true = np.array(J).T @ cov @ np.array(J)
    assert_allclose(budget.P[0, -1], true, rtol=1e-9)
    assert np.linalg.eigvalsh(true - kalman(replace(system, R=system.R / 4.0)).P[-1]).min() > 0.0  # it boasts


def test_heading_is_limited_by_the_east_gyro():
    # Gyrocompassing: phi_U' = 0, phi_E' = -phi_U w - eps_E seen through z = g phi_E. What stays is eps_E / w.
    w, eps, g = 5e-5, 5e-8, 9.8
    Phi = np.eye(3) + np.array([[0.0, -w, -1.0], [0, 0, 0], [0, 0, 0]])
    system = LinearSystem(
        Phi[None],
        np.diag([1e-14, 0.0, 0.0])[None],
        np.array([[[g, 0.0, 0.0]]]),
        np.array([[[1e-10]]]),
        np.zeros((20_000, 1)),
        np.zeros(3),
        np.diag([1e-4, 1e-2, eps**2]),
    )
    budget = error_budget(system, sources_of(system, {"level": [0], "heading": [1], "gyro bias": [2]}))
    share = dict(zip(budget.sources, budget.share[:, -1, 1]))
    assert_allclose(np.sqrt(budget.variance[budget.sources.index("gyro bias, initial"), -1, 1]), eps / w, rtol=1e-2)
    assert share["gyro bias, initial"] > 0.9
    assert_allclose(share["heading, initial"], (eps / w / 0.1) ** 2, rtol=1e-2)


def test_bad_input_is_said():
    system = random_system()
    with pytest.raises(UsageError, match="state 1 is in 'a' and in 'b'"):
        sources_of(system, {"a": [0, 1], "b": [1]})
    with pytest.raises(UsageError, match="P0 correlates state 0 of 'a' with state 2 of 'others'"):
        sources_of(system, {"a": [0, 1]})
    with pytest.raises(UsageError, match="no sources"):
        error_budget(system, {})
    with pytest.raises(UsageError, match=r"source 'x': Q has shape \(4, 4\), expected \('K or 1', 4, 4\)"):
        error_budget(system, {"x": Source(Q=np.eye(4))})
    with pytest.raises(UsageError, match="filter with history='full'"):
        filter_gains(system, kalman(system))
    with pytest.raises(UsageError, match=r"has runs \(2,\)"):
        error_budget(random_system(runs=(2,)), {"x": Source()})
