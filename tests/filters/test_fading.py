"""Fading and strong tracking filters against hand-worked examples of two states, and against what they are for."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import random_system
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, fading, kalman, strong_tracking

KINDS = ["single", "noise", "multiple", "improved"]
TIGHT = {"rtol": 1e-12}


def hand_worked(z, R=1.0) -> LinearSystem:
    """Position and velocity, position doubled and measured; every number of the examples is small."""
    z = np.asarray(z, dtype=float)
    return LinearSystem(
        Phi=np.array([[[1.0, 1.0], [0.0, 1.0]]]),
        Q=np.array([[[1.0, 0.0], [0.0, 2.0]]]),
        H=np.array([[[2.0, 0.0]]]),
        R=np.array([[[R]]]),
        z=z[:, None],
        x0=np.array([0.0, 1.0]),
        P0=np.array([[2.0, 1.0], [1.0, 3.0]]),
    )


# Epoch 0: x = (1, 1), Phi P Phi' = [[7, 4], [4, 3]], with Q [[8, 4], [4, 5]]; h P h' = 28 without Q, h Q h' = 4,
# and e = 22 - 2 = 20, V = 400.
@pytest.mark.parametrize(
    ("kind", "factor", "P", "variance"),
    [
        # (400 - 1 - 4) / 28
        ("single", 395 / 28, [[395 / 4 + 1, 395 / 7], [395 / 7, 3 * 395 / 28 + 2]], 400.0),
        # (400 - 28 - 4) / 1
        ("noise", 368.0, [[8.0, 4.0], [4.0, 5.0]], 400.0),
        # lam^2 = (400 - 1 - 4) / 28, state 0 only
        ("multiple", np.sqrt(395 / 28), [[395 / 4 + 1, 4 * np.sqrt(395 / 28)], [4 * np.sqrt(395 / 28), 5.0]], 400.0),
        # lam^2 = (400 - 1) / 32
        ("improved", np.sqrt(399 / 32), [[399 / 4, 4 * np.sqrt(399 / 32)], [4 * np.sqrt(399 / 32), 5.0]], 400.0),
    ],
)
def test_one_step_by_hand(kind, factor, P, variance):
    estimates = fading(hand_worked([22.0]), kind=kind, history="full")
    P = np.array(P)
    gain = 2.0 * P[:, 0] / variance
    assert_allclose(estimates.adaptation, [[factor]], **TIGHT)
    assert_allclose(estimates.innovation_covariance, [[[variance]]], **TIGHT)  # as large as the innovation was
    assert_allclose(estimates.x[0], np.array([1.0, 1.0]) + 20.0 * gain, **TIGHT)
    assert_allclose(estimates.P[0], P - variance * np.outer(gain, gain), rtol=1e-11)


def test_memory_by_hand():
    # V = 400, then (.5 * 400 + e^2) / 1.5: with noise scaled, x and e of epoch 1 follow from epoch 0.
    estimates = fading(hand_worked([22.0, 9.0]), kind="noise", rho=0.5, history="full")
    e = estimates.innovation[:, 0]
    assert_allclose(e[0], 20.0)
    assert_allclose(estimates.state.memory, [(200.0 + e[1] ** 2) / 1.5], **TIGHT)
    x0 = np.array([1.0, 1.0]) + 20.0 * np.array([16.0, 8.0]) / 400.0
    assert_allclose(e[1], 9.0 - 2.0 * (x0[0] + x0[1]), **TIGHT)


def test_strong_tracking_by_hand():
    # Softening 100: (400 - 100 - 4) / 28; softening 395: (400 - 395 - 4) / 28 is below 1.
    for softening, factor in ((100.0, 296 / 28), (395.0, 1.0), (1.0, 395 / 28)):
        estimates = strong_tracking(hand_worked([22.0]), softening=softening, history="full")
        assert_allclose(estimates.adaptation, [[factor]], **TIGHT)
    capped = strong_tracking(hand_worked([22.0]), cap=3.0, history="full")
    assert_allclose(capped.adaptation, [[3.0]])
    assert_allclose(capped.innovation_covariance, [[[3 * 28.0 + 4.0 + 1.0]]], **TIGHT)


def test_strong_tracking_without_softening_is_single_fading():
    system = random_system(epochs=20)
    assert_array_equal(strong_tracking(system).x, fading(system, kind="single").x)


@pytest.mark.parametrize("kind", KINDS)
def test_a_quiet_filter_is_the_kalman_filter_to_the_bit(kind):
    system = single_rows(random_system(epochs=20, S=False))
    quiet = replace(system, R=1e6 * np.eye(3)[None])
    faded, plain = fading(quiet, kind=kind, history="full"), kalman(quiet, history="full")
    assert_array_equal(faded.adaptation, np.ones_like(faded.adaptation))
    assert_array_equal(faded.x, plain.x)
    assert_array_equal(faded.P, plain.P)


@pytest.mark.parametrize("kind", KINDS)
def test_factors_make_the_expected_innovations_as_large_as_they_are(kind):
    # What defines the factors: trace (single kinds) or every row (multiple kinds) of H P H' + R is V where they fire.
    system = single_rows(random_system(epochs=20, missing=0.2, seed=3))
    estimates = fading(replace(system, z=10.0 * system.z), kind=kind, history="full")
    V = np.full(3, np.nan)
    fired = 0
    for e, W, lam in zip(estimates.innovation, estimates.innovation_covariance, estimates.adaptation):
        here = np.isfinite(e)
        V[here] = np.where(np.isnan(V), e**2, (0.95 * V + e**2) / 1.95)[here]
        expected = np.diag(W)
        if kind in ("single", "noise"):
            if lam[0] > 1.0:
                assert_allclose(expected[here].sum(), V[here].sum(), rtol=1e-9)
                fired += 1
        else:
            assert_array_equal(lam[~here], 1.0)
            assert_allclose(expected[lam > 1.0], V[lam > 1.0], rtol=1e-9)
            fired += (lam > 1.0).sum()
    assert fired > 5


@pytest.mark.parametrize("kind", KINDS)
def test_chunks_give_the_bits_of_the_batch(kind):
    system = single_rows(random_system(epochs=15))
    batch = fading(system, kind=kind, history="full")
    first = fading(system.between(0, 4), kind=kind, history="full")
    second = fading(system.between(4, 15), first.state, kind=kind, history="full")
    for name in ("x", "P", "adaptation", "nis"):
        assert_array_equal(np.concatenate([getattr(first, name), getattr(second, name)]), getattr(batch, name))


def test_a_jump_is_followed():
    # A constant that the filter is sure of jumps: the Kalman filter takes hundreds of epochs, the fading one a few.
    rng = np.random.default_rng(0)
    truth = np.where(np.arange(400) < 300, 0.0, 50.0)
    one = np.ones((1, 1, 1))
    system = LinearSystem(one, 1e-6 * one, one, one, (truth + rng.standard_normal(400))[:, None], np.zeros(1), one[0])
    slow, fast = (
        f.x[-80:, 0] - 50.0 for f in (kalman(system, history="sigma"), strong_tracking(system, history="sigma"))
    )
    assert np.abs(slow).min() > 20.0
    assert np.sqrt(np.mean(fast**2)) < 1.5


def test_runs_are_those_alone():
    system = random_system(runs=(3,), epochs=6)
    together = fading(system, kind="single", workers=2)
    for i in range(3):
        alone = {name: a[i] for name, a in vars(system).items()}
        assert_array_equal(together.x[i], fading(LinearSystem(**alone), kind="single").x)


def test_options_are_checked():
    system = random_system()
    for options, message in (
        ({"kind": "all"}, "kind is 'all'"),
        ({"kind": "multiple"}, "H: row 0 at epoch 0 measures several states"),
        ({"kind": "single", "rho": -1.0}, "rho is -1.0"),
        ({"kind": "single", "cap": 0.5}, "cap is 0.5"),
    ):
        with pytest.raises(UsageError, match=message):
            fading(system, **options)
    with pytest.raises(UsageError, match="softening is 0"):
        strong_tracking(system, softening=0.5)
    H = np.zeros((1, 3, 4))
    H[..., 1] = 1.0
    with pytest.raises(UsageError, match="state 1 is measured by several rows"):
        fading(replace(system, H=H), kind="improved")
    with pytest.raises(UsageError, match="the state remembers 0 figures, expected 3"):
        fading(system, kalman(system).state, kind="single")


def single_rows(system: LinearSystem) -> LinearSystem:
    H = np.zeros((1, 3, 4))
    H[0, 0, 2], H[0, 1, 0], H[0, 2, 3] = 2.0, -1.0, 0.5
    return replace(system, H=H)
