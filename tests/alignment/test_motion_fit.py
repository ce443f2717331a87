"""The fit of a base's motion: known motions are found again, by their likelihood; windowed fits on known states."""

import math

import numpy as np
import pytest
import scipy.linalg

from truenorth.alignment.motion_fit import climb, search
from truenorth.alignment.motion_likelihood import LOWEST_BIN, Series, Walks, motion_of, parameters
from truenorth.alignment.windowed import sequential_fit, windowed_fit
from truenorth.errors.sway import MOST_OSCILLATORS, AxisMotion, Oscillator
from truenorth.filters import LinearSystem

WALKS = Walks(1e-5, 1e-7)
MOTIONS = {
    "white": AxisMotion(1e-3),
    "a tone": AxisMotion(1e-5, (Oscillator(1, 0.018, 2 * math.pi / 7, 1e-9),)),
    "a broad peak": AxisMotion(1e-3, (Oscillator(1, 0.03, 1.0, 0.05),)),
    "swell": AxisMotion(1e-4, (Oscillator(2, 0.03, 1.0, 0.05),)),
    "two": AxisMotion(1e-4, (Oscillator(1, 0.02, 0.6, 0.05), Oscillator(2, 0.01, 1.3, 0.03))),
}


def drawn(motion, count, seed):
    rng = np.random.default_rng(seed)
    y = motion.white * rng.standard_normal(count)
    if motion.states:
        Phi, Q, P, h = motion.blocks(1.0)

        def root(M):
            values, vectors = np.linalg.eigh(M)
            return vectors * np.sqrt(np.maximum(values, 0.0))

        x, noise = root(P) @ rng.standard_normal(len(P)), root(Q)
        for k in range(count):
            x = Phi @ x + noise @ rng.standard_normal(len(x))
            y[k] += h @ x
    return y


@pytest.mark.parametrize("item", [Oscillator(1, 0.02, 0.8, 0.1), Oscillator(1, 0.02, 0.8, 1e-9)], ids=["broad", "line"])
def test_expected_periodogram_is_the_mean_of_many(item):
    """Mean of 800 periodograms: within 4 sigma (14 %) wherever the expectation is not a leak of 1e-6."""
    motion = AxisMotion(1e-3, (item,))
    many = [Series(np.zeros(64), 1.0, WALKS)]
    found = np.mean(
        [np.abs(np.fft.rfft(many[0].taper_weights * drawn(motion, 64, seed))) ** 2 for seed in range(800)], axis=0
    )
    orders, logs = parameters(motion)
    expected = many[0].expected(orders, logs[None])[0]
    ratio = (found / expected)[1:-1]
    assert np.all(np.abs(ratio - 1) < 4 / math.sqrt(800) * 1.05), ratio


@pytest.mark.parametrize("name", MOTIONS)
def test_exact_likelihood_is_the_dense_gaussian_s(name):
    """Of the contrasts free of the trend, whose covariance is Toeplitz but for the walks."""
    motion, K = MOTIONS[name], 60
    y = drawn(motion, K, 5)
    series = Series(y, 1.0, WALKS)
    Phi, Q = WALKS.blocks(1.0)
    V = scipy.linalg.toeplitz(motion.autocovariance(1.0, K)) + motion.white**2 * np.eye(K)
    P = np.zeros((2, 2))
    for k in range(1, K):
        P = Phi @ P @ Phi.T + Q
        V[k, k:] += P[0, 0] + P[0, 1] * np.arange(K - k)  # the walk of acceleration goes on
        V[k + 1 :, k] = V[k, k + 1 :]
    free = scipy.linalg.null_space(series.columns[:, 1:].T)  # orthonormal: the determinant of B'B makes the difference
    left = free.T @ y
    U = free.T @ V @ free
    B = series.columns[:, 1:]
    expected = np.linalg.slogdet(U)[1] + left @ np.linalg.solve(U, left) + np.linalg.slogdet(B.T @ B)[1]
    orders, logs = parameters(motion)
    assert series.exact(orders, logs[None])[0] == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("name", MOTIONS)
def test_parameters_are_the_motion(name):
    motion = MOTIONS[name]
    again = motion_of(*parameters(motion))
    assert again.white == pytest.approx(motion.white)
    np.testing.assert_array_equal(again.table[0], motion.table[0])
    np.testing.assert_allclose(again.table[1], motion.table[1])


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("count", [120, 400])
def test_as_likely_as_the_truth(name, count):
    """The criterion at the maximum is below the truth's (2 for an unfinished search); a bad search ends tens above."""
    motion = MOTIONS[name]
    for seed in (0, 1):
        y = drawn(motion, count, seed)
        series = Series(y, 1.0, WALKS)
        found = search(series, MOST_OSCILLATORS[0])
        assert series.score(found) < series.score(motion) + 2.0
        if name == "white":
            assert found.sigma == pytest.approx(np.std(y), rel=4 / math.sqrt(2 * count))


def walked(walks, count, seeds):
    """Velocities by random walks, one of each seed."""
    draws = np.stack([np.random.default_rng(seed).standard_normal((count, 2)) for seed in seeds], axis=1)
    Phi, Q = walks.blocks(1.0)
    noise, x, y = np.linalg.cholesky(Q), np.zeros((len(seeds), 2)), np.empty((len(seeds), count))
    for k in range(count):
        x = x @ Phi.T + draws[k] @ noise.T
        y[:, k] = x[:, 0]
    return y


@pytest.mark.parametrize("walks", [Walks(1e-3, 1e-12), Walks(1e-9, 1e-4)], ids=["velocity", "tilt"])
def test_expected_periodogram_of_the_walks(walks):
    """Mean of 300, above the bins of the trend: of a walk of tilt a twentieth of what is below leaks."""
    many = [Series(y, 1.0, walks) for y in walked(walks, 256, range(300))]
    ratio = np.mean([item.periodogram / item.walked for item in many], axis=0)[LOWEST_BIN + 1 : -8]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert 0.5 < ratio.min() < ratio.max() < 1.6


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_sea_of_tones_is_not_lost_in_the_walk_of_poor_sensors(seed):
    """20 minutes: a walk of tilt has the highest peaks, and one of the sea's tones is a line. Both were searched, 3000 likelier."""
    rng = np.random.default_rng(seed)
    t, walks = np.arange(1200.0), Walks(1e-3, 3e-4)
    (y,) = walked(walks, len(t), [seed])
    y += sum(0.02 * np.sin(2.0 * math.pi * (t / period + rng.uniform())) for period in rng.uniform(6.0, 10.0, 4))
    series = Series(y, 1.0, walks)
    seas = AxisMotion(1e-4, (Oscillator(2, 0.03, 0.72, 0.03), Oscillator(2, 0.03, 0.92, 0.03)))
    assert series.score(search(series, MOST_OSCILLATORS[0])) < series.score(climb(series, seas, 60)) + 200.0


def cubic_system(z):
    """Position, velocity, acceleration; the position is measured."""
    K = len(z)
    Phi = np.array([[[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]] * K)
    H = np.array([[[1.0, 0.0, 0.0]]] * K)
    zero = np.zeros((K, 3, 3))
    return LinearSystem(
        Phi=Phi, Q=zero, H=H, R=np.ones((K, 1, 1)), z=z[:, None], x0=np.zeros(3), P0=1e4 * np.eye(3), S=None
    )


@pytest.mark.parametrize("count", [8, 400])
def test_a_base_that_does_not_move_at_all_has_no_oscillator(count):
    assert search(Series(np.zeros(count), 1.0, WALKS), MOST_OSCILLATORS[0]).oscillators == ()


def test_windowed_fits_find_the_states_next_to_a_tone():
    t = np.arange(1.0, 301.0)
    truth = np.array([1.0, -0.02, 1e-4])
    z = truth[0] + truth[1] * t + truth[2] * t**2 / 2 + 0.5 * np.cos(2 * np.pi * t / 7.3)
    fit = windowed_fit(cubic_system(z))
    plain = np.linalg.lstsq(np.stack([np.ones_like(t), t, t**2 / 2], 1), z, rcond=None)[0]
    assert np.all(np.abs(fit.x0 - truth) < 0.05 * np.abs(plain - truth))
    np.testing.assert_allclose(fit.residual[:, 0], 0.5 * np.cos(2 * np.pi * t / 7.3), atol=2e-3)
    np.testing.assert_allclose(fit.x[0], z[-1] - 0.5 * np.cos(2 * np.pi * t[-1] / 7.3), atol=5e-3)
    history = sequential_fit(cubic_system(z))
    assert np.all(np.abs(history[-1] - truth) < 0.1 * np.abs(plain - truth))
    # The running sums are those of the log that ends there.
    np.testing.assert_allclose(history[149], sequential_fit(cubic_system(z[:150]))[-1], rtol=1e-6, atol=1e-9)


def test_windowed_fit_keeps_the_prior_of_what_it_cannot_see():
    system = cubic_system(np.zeros(50))
    P0 = np.diag([1e4, 1e4, 0.0])
    held = LinearSystem(
        Phi=system.Phi, Q=system.Q, H=system.H, R=system.R, z=system.z + 1.0, x0=np.array([0.0, 0.0, 0.3]), P0=P0
    )
    assert windowed_fit(held).x0[2] == 0.3
