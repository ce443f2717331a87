"""The smoother against the exact dense joint Gaussian."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, assert_is_joint, one_run, random_system, three_states
from tests.filters.test_kalman import SYSTEMS, TIGHT
from truenorth.filters import LinearSystem, kalman, smoother


@pytest.mark.parametrize("kind", [kind for kind in SYSTEMS if kind != "seventeen states"])  # 6 s of compiling
def test_smoother_is_the_joint_gaussian(kind):
    system = random_system(**SYSTEMS[kind])
    dense = Dense.of(system)
    smoothed = smoother(system)
    for k in range(system.epochs):
        x, P = dense.state(k, system.epochs)
        assert_allclose(smoothed.x[k], x, **TIGHT)
        assert_allclose(smoothed.P[k], P, **TIGHT)
        assert_allclose(smoothed.sigma[k], np.sqrt(np.diag(P)), **TIGHT)


def test_the_start_is_smoothed_too():
    # The state before epoch 0 is the state at epoch 0 of the same system with an idle epoch put in front.
    system = random_system(epochs=5)
    idle = {
        name: np.concatenate([fill[None], getattr(system, name)])
        for name, fill in {
            "Phi": np.eye(4),
            "Q": np.zeros((4, 4)),
            "H": np.zeros((3, 4)),
            "R": np.eye(3),
            "z": np.full(3, np.nan),
            "u": np.zeros(4),
            "S": np.zeros((4, 3)),
        }.items()
    }
    x, P = Dense.of(replace(system, **idle)).state(0, 6)
    smoothed = smoother(system)
    assert_allclose(smoothed.x0, x, **TIGHT)
    assert_allclose(smoothed.P0, P, **TIGHT)


def test_the_last_epoch_is_the_filters():
    system = random_system(epochs=9)
    smoothed = smoother(system)
    assert_array_equal(smoothed.x[-1], smoothed.filtered.x[-1])
    assert_array_equal(smoothed.P[-1], smoothed.filtered.P[-1])
    assert_array_equal(smoothed.filtered.P, kalman(system, history="full").P)


def test_no_covariance_is_inverted():
    # A state known exactly, a constant without process noise and a noiseless row: P and Q are singular throughout.
    z = [[1.0, np.nan], [1.3, np.nan], [0.4, 0.2], [2.0, np.nan]]
    system = three_states(np.zeros((3, 3)), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [0.3, 0.0], z)
    assert_is_joint(system, smoother(system), upto=4, **TIGHT)


@pytest.mark.parametrize("workers", [1, 3])
def test_runs_are_those_alone_to_the_bit(workers):
    system = random_system(runs=(2, 2), epochs=4)
    together = smoother(system, workers=workers)
    for index in np.ndindex(2, 2):
        alone = smoother(one_run(system, index))
        for name in ("x", "sigma", "P", "x0", "P0"):
            assert_array_equal(getattr(together, name)[index], getattr(alone, name))


def test_it_goes_on_from_a_state():
    system = random_system(epochs=8)
    first = kalman(system.between(0, 3))
    late, whole = smoother(system.between(3, 8), first.state), smoother(system)
    assert_allclose(late.x, whole.x[3:], **TIGHT)
    assert_allclose(late.P, whole.P[3:], **TIGHT)
    assert_allclose(late.x0, whole.x[2], **TIGHT)
    assert_array_equal(late.filtered.log_likelihood, whole.filtered.log_likelihood)


def test_a_variance_hidden_by_rounding_is_not_claimed():
    # An unknown constant, measured late: the smoothed variance 1e-6 is 1e-22 of the filtered one at epoch 0.
    system = LinearSystem(
        Phi=np.eye(1)[None],
        Q=np.zeros((1, 1, 1)),
        H=np.eye(1)[None],
        R=1e-6 * np.eye(1)[None],
        z=np.array([[np.nan], [1.0]]),
        x0=np.zeros(1),
        P0=1e16 * np.eye(1),
    )
    smoothed = smoother(system)
    assert_allclose(smoothed.P[:, 0, 0], [1e-13 * 1e16, 1e-6], rtol=1e-9)
    assert abs(smoothed.x[0, 0] - 1.0) < smoothed.sigma[0, 0]
