"""The closed loop against the open one."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import random_system
from tests.filters.test_kalman import SYSTEMS, TIGHT
from truenorth.core.errors import UsageError
from truenorth.filters import feedback, kalman


@pytest.mark.parametrize("states", [slice(None), [0, 2], []])
@pytest.mark.parametrize("kind", ["plain", "everything", "everything, constant", "one state"])
def test_it_is_the_open_loop(kind, states):
    system = random_system(**SYSTEMS[kind])
    if kind == "one state" and states == [0, 2]:
        states = [0]
    opened, closed = kalman(system, history="full"), feedback(system, states=states, history="full")
    for name in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood"):
        assert_allclose(getattr(closed, name), getattr(opened, name), **TIGHT)


def test_what_is_fed_back_is_the_correction():
    system = random_system(epochs=8, missing=0.0)
    closed = feedback(system, history="full")
    before = np.concatenate([system.x0[None], closed.x[:-1]])
    predicted = np.einsum("kij,kj->ki", system.Phi, before) + system.u
    assert_allclose(closed.adaptation, closed.x - predicted, **TIGHT)
    partial = feedback(system, states=[1, 3], history="full")
    assert_array_equal(partial.adaptation[:, [0, 2]], 0.0)
    assert np.all(partial.adaptation[:, [1, 3]] != 0.0)
    # Without a measurement there is nothing to feed back.
    silent = feedback(replace(system, z=np.full_like(system.z, np.nan)), history="full")
    assert_array_equal(silent.adaptation, 0.0)


@pytest.mark.parametrize("constant", [False, True])
def test_chunks_give_the_bits_of_the_batch(constant):
    system = random_system(epochs=15, constant=constant)
    batch = feedback(system, states=[0, 1], history="full")
    first = feedback(system.between(0, 4), states=[0, 1], history="full")
    second = feedback(system.between(4, 15), first.state, states=[0, 1], history="full")
    assert_allclose(np.concatenate([first.x, second.x]), batch.x, rtol=1e-13, atol=1e-13)
    assert_array_equal(np.concatenate([first.P, second.P]), batch.P)


def test_bad_states_are_said():
    with pytest.raises(UsageError, match=r"states is \[7\], expected indices below 4"):
        feedback(random_system(), states=[7])
