"""Gates and robust weights: by hand, against the Kalman filter of what they leave, and against outliers."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, random_system
from truenorth.analysis.consistency import chi_square_quantile
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, gated, kalman, robust


def constant(z, P0=3.0, R=1.0) -> LinearSystem:
    one = np.ones((1, 1, 1))
    z = np.asarray(z, dtype=float)
    return LinearSystem(one, 0.0 * one, one, R * one, z[:, None], np.zeros(1), P0 * one[0])


# P + R = 4, so that an innovation is half as many sigma.
@pytest.mark.parametrize(
    ("options", "z", "weight"),
    [
        ({"weighting": "huber", "k0": 1.5}, 2.9, 1.0),
        ({"weighting": "huber", "k0": 1.5}, 6.0, 0.5),
        ({"weighting": "huber", "k0": 1.5}, -60.0, 0.05),
        ({"weighting": "igg3", "k0": 1.5, "k1": 4.0}, 2.9, 1.0),
        ({"weighting": "igg3", "k0": 1.5, "k1": 4.0}, 6.0, 0.5 * (1.0 / 2.5) ** 2),
        ({"weighting": "igg3", "k0": 1.5, "k1": 4.0}, -8.1, 0.0),
    ],
)
def test_weights_by_hand(options, z, weight):
    estimates = robust(constant([z]), history="full", **options)
    assert_allclose(estimates.adaptation, [[weight]], rtol=1e-12)
    gain = 3.0 / (3.0 + 1.0 / weight) if weight else 0.0
    assert_allclose(estimates.x, [[gain * z]], rtol=1e-12)
    assert_allclose(estimates.P, [[[3.0 * (1.0 - gain)]]], rtol=1e-12)
    assert_allclose(estimates.nis, [z * z / 4.0], rtol=1e-12)


@pytest.mark.parametrize("options", [{"by": "row"}, {"by": "epoch"}])
def test_a_gate_is_the_kalman_filter_of_what_it_takes(options):
    system = random_system(epochs=25, missing=0.2)
    estimates = gated(system, probability=0.6, history="full", **options)
    weights = estimates.adaptation
    assert 5 < np.nansum(weights == 0.0) < 50
    assert_array_equal(np.isnan(weights), np.isnan(system.z))
    taken = kalman(replace(system, z=np.where(weights == 1.0, system.z, np.nan)), history="full")
    assert_array_equal(estimates.x, taken.x)
    assert_array_equal(estimates.P, taken.P)
    assert_array_equal(estimates.log_likelihood, taken.log_likelihood)


def test_nis_of_an_epoch_is_that_of_the_joint_gaussian():
    system = random_system(epochs=1, missing=0.0)
    nu, W = Dense.of(system).innovation(0)
    nis = nu @ np.linalg.solve(W, nu)
    assert_allclose(gated(system, innovations=True, by="epoch", probability=0.5).nis, [nis], rtol=1e-10)
    for probability in (0.01, 0.2, 0.5, 0.8, 0.99):
        weights = gated(system, innovations=True, by="epoch", probability=probability).adaptation
        assert_array_equal(weights, np.full((1, 3), float(nis <= chi_square_quantile(probability, 3))))


@pytest.mark.parametrize("filter_", [gated, robust])
def test_full_weight_is_the_kalman_filter_to_the_bit(filter_):
    system = random_system(epochs=20)
    wide = {"probability": 1.0 - 1e-16} if filter_ is gated else {"k0": 1e9}
    estimates, plain = filter_(system, history="full", **wide), kalman(system, history="full")
    assert_array_equal(estimates.x, plain.x)
    assert_array_equal(estimates.P, plain.P)
    assert_allclose(estimates.nis, plain.nis, rtol=1e-9)


def test_patience_lets_a_wrong_filter_find_back():
    z = np.full(8, 100.0)
    closed = gated(constant(z, P0=0.01, R=0.01), history="sigma")
    assert_array_equal(closed.adaptation, np.zeros((8, 1)))
    opened = gated(constant(z, P0=0.01, R=0.01), patience=3, history="sigma")
    assert_array_equal(opened.adaptation[:, 0], [0, 0, 0, 1, 0, 0, 0, 1])
    whole = gated(constant(z, P0=0.01, R=0.01), patience=3, by="epoch", history="sigma")
    assert_array_equal(whole.adaptation, opened.adaptation)


@pytest.mark.parametrize("by", ["row", "epoch"])
def test_chunks_give_the_bits_of_the_batch(by):
    system = random_system(epochs=15)
    options = {"probability": 0.5, "by": by, "patience": 2, "history": "full"}
    batch = gated(system, **options)
    first = gated(system.between(0, 4), **options)
    second = gated(system.between(4, 15), first.state, **options)
    assert_array_equal(np.concatenate([first.adaptation, second.adaptation]), batch.adaptation)
    assert_array_equal(second.x, batch.x[4:])


def test_outliers_do_less_harm():
    # One in ten measurements is 50 sigma off; errors of the last 300 of 400 epochs, against those of the Kalman filter
    # that never met an outlier.
    rng = np.random.default_rng(0)
    truth = np.cumsum(0.1 * rng.standard_normal((100, 400)), axis=1)
    clean = truth + rng.standard_normal(truth.shape)
    dirty = clean + 50.0 * (rng.random(truth.shape) < 0.1) * rng.choice([-1.0, 1.0], truth.shape)
    one = np.ones((1, 1, 1))

    def rms(filter_, z, **options):
        system = LinearSystem(one, 0.01 * one, one, one, z[..., None], np.zeros(1), one[0])
        return float(np.sqrt(np.mean((filter_(system, history="sigma", **options).x[..., 0] - truth)[:, 100:] ** 2)))

    best = rms(kalman, clean)
    assert rms(kalman, dirty) > 5.0 * best
    assert rms(gated, dirty) < 1.1 * best
    assert rms(robust, dirty, weighting="igg3") < 1.15 * best
    assert rms(robust, dirty, weighting="huber") < 1.5 * best
    assert rms(robust, clean) < 1.1 * best


def test_options_are_checked():
    system = random_system()
    for options, message in (
        ({"probability": 95.0}, "probability is 95"),
        ({"by": "column"}, "by is 'column'"),
        ({"patience": 0}, "patience is 0"),
    ):
        with pytest.raises(UsageError, match=message):
            gated(system, **options)
    for options, message in (
        ({"weighting": "tukey"}, "weighting is 'tukey'"),
        ({"k0": 0.0}, "k0 is 0"),
        ({"weighting": "igg3", "k1": 1.0}, "k1 is 1"),
    ):
        with pytest.raises(UsageError, match=message):
            robust(system, **options)
