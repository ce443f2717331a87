"""The Allan deviation against closed forms and allantools, the coefficients against simulated noise."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from truenorth.analysis.allan import overlapping_adev
from truenorth.core.errors import UsageError
from truenorth.quality.noise import noise_coefficients
from truenorth.records import ImuRecord


def test_agrees_with_allantools():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools
    rate = np.random.default_rng(1).standard_normal(5000).cumsum() * 0.01 + 3.0
    ours = overlapping_adev(rate, 0.02, taus=[0.02, 0.06, 1.0, 7.0, 40.0])
    taus, deviation, _, _ = allantools.oadev(rate, rate=50.0, data_type="freq", taus=[0.02, 0.06, 1.0, 7.0, 40.0])
    np.testing.assert_allclose(ours.tau, taus, rtol=1e-12)
    np.testing.assert_allclose(ours.deviation, deviation, rtol=1e-9)


def test_a_ramp_has_its_closed_form():
    """A rate that grows by R per second: ``sigma = R tau / sqrt(2)`` (IEEE Std 952, C.1.6)."""
    time = np.arange(4000) * 0.1
    allan = overlapping_adev(0.3 * time, 0.1)
    np.testing.assert_allclose(allan.deviation, 0.3 * allan.tau / np.sqrt(2.0), rtol=1e-9)


def test_alternating_increments_are_quantisation():
    """Angles that alternate by +-q/2: the second difference is +-2q at odd steps and 0 at even ones."""
    increments = np.tile([1e-6, -1e-6], 500)
    allan = overlapping_adev(increments, 0.01, taus=[0.01, 0.02, 0.03], kind="increments")
    np.testing.assert_allclose(allan.deviation * allan.tau, [np.sqrt(2.0) * 1e-6, 0.0, np.sqrt(2.0) * 1e-6], atol=1e-12)


def test_rates_and_increments_give_the_same():
    rate = np.random.default_rng(2).standard_normal((3000, 3))
    a = overlapping_adev(rate, 0.005)
    b = overlapping_adev(rate * 0.005, 0.005, kind="increments")
    np.testing.assert_allclose(a.deviation, b.deviation, rtol=1e-11)


def test_sigma_is_the_scatter_on_white_noise():
    """400 records: the scatter's own uncertainty is 1/sqrt(800) = 3.5 %; six taus inside 4: p < 5e-4."""
    rate = np.random.default_rng(3).standard_normal((2048, 400))
    allan = overlapping_adev(rate, 1.0, taus=[1, 2, 4, 8, 16, 32])
    ratio = allan.deviation.std(axis=1) / allan.sigma.mean(axis=1)
    assert np.all(np.abs(ratio - 1.0) < 0.15)


@pytest.mark.slow
def test_white_noise_gives_its_density_with_honest_sigma():
    """300 channels; the mean z-score's sigma is 0.06, the RMS's 0.04: bounds at 4 of these, p < 2e-4."""
    rng = np.random.default_rng(4)
    z = []
    for _ in range(50):
        record = ImuRecord(np.arange(5000) * 0.01, rng.standard_normal((5000, 3)), 7 * rng.standard_normal((5000, 3)))
        gyro, accel = noise_coefficients(record)
        z.append((gyro.random_walk - 0.1) / gyro.random_walk_sigma)
        z.append((accel.random_walk - 0.7) / accel.random_walk_sigma)
    assert abs(np.mean(z)) < 0.35  # the bias of "no coefficient below zero", up to 0.1 sigma, included
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.25


def test_four_processes_are_separated():
    """Each made by its definition. Scatter over 51 channels: N .4 %, Q .4 %, K 7.5 %; bounds at 4-5 of it."""
    rng, N, K, Q, dt = np.random.default_rng(5), 2e-4, 3e-5, 2e-5, 0.02
    shape = (200_000, 3)
    angle = Q * rng.standard_normal((shape[0] + 1, 3))
    rate = N / np.sqrt(dt) * rng.standard_normal(shape)
    rate += np.cumsum(K * np.sqrt(dt) * rng.standard_normal(shape), axis=0)
    rate += np.diff(angle, axis=0) / dt
    gyro, _ = noise_coefficients(ImuRecord(np.arange(shape[0]) * dt, rate, rate))
    np.testing.assert_allclose(gyro.random_walk, N, rtol=0.02)
    np.testing.assert_allclose(gyro.quantisation, Q, rtol=0.02)
    np.testing.assert_allclose(gyro.rate_random_walk, K, rtol=0.35)
    measured = gyro.allan.deviation[:8] ** 2
    np.testing.assert_allclose(gyro.variance(gyro.allan.tau[:8]), measured, rtol=0.06)


def test_scaling_the_data_scales_the_coefficients():
    rng = np.random.default_rng(6)
    data = rng.standard_normal((4000, 3)) + rng.standard_normal((4000, 3)).cumsum(axis=0) * 0.01
    gyro, accel = noise_coefficients(ImuRecord(np.arange(4000) * 0.01, data, 1e6 * data))
    np.testing.assert_allclose(accel.random_walk, 1e6 * gyro.random_walk, rtol=1e-9)
    np.testing.assert_allclose(accel.rate_random_walk, 1e6 * gyro.rate_random_walk, rtol=1e-9)


def test_constant_channels_have_no_noise():
    gyro, _ = noise_coefficients(ImuRecord(np.arange(100) * 0.1, np.ones((100, 3)), np.ones((100, 3))))
    assert np.all(gyro.random_walk == 0.0)
    assert np.all(np.isnan(gyro.random_walk_sigma))


@pytest.mark.parametrize(
    ("rows", "interval", "taus"), [(2, 0.1, None), (100, 0.0, None), (100, 0.1, [80.0]), (100, np.nan, None)]
)
def test_unusable_calls_are_refused(rows, interval, taus):
    with pytest.raises(UsageError):
        overlapping_adev(np.ones(rows), interval, taus)
