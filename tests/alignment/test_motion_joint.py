"""Motions fitted jointly: against the dense joint Gaussian of all axes, and where fits of each axis stop short."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty import foreign_rows
from truenorth.alignment.motion_joint import JointLikelihood, fit_jointly
from truenorth.alignment.motion_likelihood import Walks, parameters
from truenorth.errors.sway import AxisMotion, Oscillator, add_autocovariance

K, T = 40, 0.5
WALKS = Walks(2e-3, 3e-4)
MOTIONS = (
    AxisMotion(0.01, (Oscillator(2, 0.2, 0.9, 0.1),)),
    AxisMotion(0.02),
    AxisMotion(0.005, (Oscillator(1, 0.1, 1.3, 0.02), Oscillator(2, 0.05, 0.5, 0.3))),
)


def covariance(motion):
    """Of a series of the motion and the walks, which begin at zero."""
    orders, table = motion.table
    acf = np.zeros(K)
    add_autocovariance(orders, table, T, acf)
    acf[0] += motion.white**2
    lag = np.abs(np.subtract.outer(np.arange(K), np.arange(K)))
    Phi, Q = WALKS.blocks(T)
    at = [np.zeros((2, 2))]
    for _ in range(K - 1):
        at.append(Phi @ at[-1] @ Phi.T + Q)
    walked = [[(np.linalg.matrix_power(Phi, abs(i - j)) @ at[min(i, j)])[0, 0] for j in range(K)] for i in range(K)]
    return acf[lag] + np.array(walked)


@pytest.fixture
def system():
    """Five states, one of them known beforehand and two correlated."""
    rng = np.random.default_rng(3)
    n = 5
    root = rng.standard_normal((n, n))
    root[2] = 0.0
    Phi = np.eye(n) + 0.02 * rng.standard_normal((K, n, n))
    H, x0 = rng.standard_normal((K, 3, n)), rng.standard_normal(n)
    return SimpleNamespace(Phi=Phi, H=H, P0=root @ root.T, x0=x0, z=rng.standard_normal((K, 3)))


def test_it_is_that_of_the_dense_joint_gaussian(system):
    likelihood, dense = JointLikelihood(system, T, WALKS), []
    shown, Phi = [], np.eye(5)
    for k in range(K):
        Phi = system.Phi[k] @ Phi
        shown.append(system.H[k] @ Phi)
    A = np.swapaxes(np.array(shown), 0, 1).reshape(3 * K, 5)  # axis by axis
    z = system.z.T.ravel() - A @ system.x0
    for louder in (1.0, 1.5):
        motions = [AxisMotion(louder * motion.white, motion.oscillators) for motion in MOTIONS]
        C = A @ system.P0 @ A.T
        for axis, motion in enumerate(motions):
            own = slice(axis * K, (axis + 1) * K)
            C[own, own] += covariance(motion)
        dense.append(z @ np.linalg.solve(C, z) + np.linalg.slogdet(C)[1])
        found = [
            likelihood.products(axis, *(x if k == 0 else x[None] for k, x in enumerate(parameters(motion))))
            for axis, motion in enumerate(motions)
        ]
        assert likelihood.deviance(sum(g[0] for g, _ in found), sum(v[0] for _, v in found)) == pytest.approx(
            dense[-1], rel=1e-9
        )


def test_a_fit_is_likelier_than_its_guess_and_ends_at_a_maximum(system):
    likelihood = JointLikelihood(system, T, WALKS)
    motions, score = fit_jointly(likelihood, MOTIONS)
    again, same = fit_jointly(likelihood, motions)
    assert same == pytest.approx(score, abs=0.5)
    assert len(again) == 3


@pytest.mark.slow
def test_a_moored_ship_whose_motion_was_no_maximum():
    """200 s, navigation grade on an indexer: a step of its speed explained by 177 what the motion had not."""
    outcome = foreign_rows.indexed(foreign_rows.moored, "navigation", 200.0, given=False)(4411, 2)
    assert outcome.refused == ""
    assert all(np.abs(ratio).max() < 4.0 for ratio in outcome.ratios.values())
