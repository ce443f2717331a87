"""R from a window: by hand, and on data whose R is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import one_run, random_system
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, innovation_adaptive, kalman

KINDS = ["innovation", "residual"]


def constant(z, R=1.0, P0=4.0) -> LinearSystem:
    one = np.ones((1, 1, 1))
    return LinearSystem(one, 0 * one, one, R * one, np.asarray(z, float)[:, None], np.zeros(1), P0 * one[0])


@pytest.mark.slow
def test_by_hand():
    # P = 4, R = 1, z = 5, window 2: nu^2 - P = 21, with the given 1 in the other place r = 11; k = 4/15, P+ = 44/15.
    found = innovation_adaptive(constant([5.0, 1.0]), window=2, history="full")
    assert_allclose(found.adaptation[0], [11.0])
    assert_allclose(found.x[0], [4.0 / 15.0 * 5.0])
    assert_allclose(found.P[0], [[44.0 / 15.0]])
    # nu = 1 - 4/3 = -1/3: 1/9 - 44/15 = -127/45; r = (21 - 127/45) / 2.
    assert_allclose(found.adaptation[1], [(21.0 - 127.0 / 45.0) / 2.0])
    # Residuals: the first update takes the given 1: k = .8, e = 1, P+ = .8, r = (1 + 1.8) / 2.
    found = innovation_adaptive(constant([5.0, 1.0]), kind="residual", window=2, history="full")
    assert_allclose(found.adaptation, [[1.0], [1.4]])
    assert_allclose(found.P[0], [[0.8]])


def test_limits_and_absent_rows():
    found = innovation_adaptive(constant([0.0, np.nan, 100.0]), window=1, largest=9.0, smallest=0.5, history="full")
    assert_allclose(found.adaptation, [[0.5], [0.5], [9.0]])  # an absent row leaves its window alone


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("factor", [0.1, 25.0])
def test_a_wrong_noise_is_found(kind, factor):
    # A random walk with R = 1, given as `factor`; 20 runs of 2000 epochs with a window of 200. The estimate of a run scatters by
    # about sqrt(2/200) = 10 %, its mean over runs and ten windows by 1 %: bounds at 15 %.
    rng = np.random.default_rng(0)
    truth = np.cumsum(0.2 * rng.standard_normal((20, 2000)), axis=1)
    one = np.ones((1, 1, 1))
    system = LinearSystem(
        one, 0.04 * one, one, factor * one, (truth + rng.standard_normal(truth.shape))[..., None], np.zeros(1), one[0]
    )
    found = innovation_adaptive(system, kind=kind, window=200, history="full")
    settled = found.adaptation[:, 1000:]
    assert abs(settled.mean() - 1.0) < 0.15
    right, wrong = (
        np.sqrt(np.mean((e.x[:, 1000:, 0] - truth[:, 1000:]) ** 2)) for e in (found, kalman(system, history="sigma"))
    )
    best = np.sqrt(np.mean((kalman(replace(system, R=one), history="sigma").x[:, 1000:, 0] - truth[:, 1000:]) ** 2))
    assert right < 1.02 * best < 1.1 * best < wrong


@pytest.mark.parametrize("kind", KINDS)
def test_chunks_and_runs_give_the_bits_of_the_batch(kind):
    system = random_system(epochs=15, S=False, diagonal_R=True, runs=(3,))
    batch = innovation_adaptive(system, kind=kind, window=4, history="full", workers=2)
    first = innovation_adaptive(system.between(0, 6), kind=kind, window=4, history="full")
    second = innovation_adaptive(system.between(6, 15), first.state, kind=kind, window=4, history="full")
    for name in ("x", "P", "adaptation"):
        assert_array_equal(np.concatenate([getattr(first, name), getattr(second, name)], axis=1), getattr(batch, name))
    assert_array_equal(batch.x[1], innovation_adaptive(one_run(system, (1,)), kind=kind, window=4, history="full").x)


def test_options_are_checked():
    system = random_system(S=False, diagonal_R=True)
    for options, message in (
        ({"kind": "both"}, "kind is 'both'"),
        ({"window": 0}, "window is 0"),
        ({"smallest": 2.0}, "smallest is 2"),
    ):
        with pytest.raises(UsageError, match=message):
            innovation_adaptive(system, **options)
    with pytest.raises(UsageError, match="R is not diagonal"):
        innovation_adaptive(random_system(S=False))
