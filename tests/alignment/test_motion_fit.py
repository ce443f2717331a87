"""The fit of a base's motion: known motions are found again, by their likelihood; windowed fits on known states."""

import math

import numpy as np
import pytest

from truenorth.alignment.motion_fit import Walks, _Series, autocovariance, fit_motion
from truenorth.alignment.windowed import sequential_fit, windowed_fit
from truenorth.filters import LinearSystem
from truenorth.models.disturbance import AxisMotion, Oscillator

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


@pytest.mark.parametrize("item", [Oscillator(1, 0.02, 0.8, 0.1), Oscillator(2, 0.02, 0.8, 0.1)], ids=["1", "2"])
def test_autocovariance_is_that_of_the_states(item):
    Phi = item.transition(1.0)
    expected = [item.output @ np.linalg.matrix_power(Phi, k) @ item.stationary @ item.output for k in range(40)]
    np.testing.assert_allclose(autocovariance(item, np.arange(40.0)), expected, atol=1e-12 * item.sigma**2)


@pytest.mark.parametrize("item", [Oscillator(1, 0.02, 0.8, 0.1), Oscillator(1, 0.02, 0.8, 1e-9)], ids=["broad", "line"])
def test_expected_periodogram_is_the_mean_of_many(item):
    """Mean of 800 periodograms: within 4 sigma (14 %) wherever the expectation is not a leak of 1e-6."""
    motion = AxisMotion(1e-3, (item,))
    many = [_Series(np.zeros(64), 1.0, WALKS)]
    found = np.mean(
        [np.abs(np.fft.rfft(many[0].taper_weights * drawn(motion, 64, seed))) ** 2 for seed in range(800)], axis=0
    )
    expected = many[0].expected(motion)
    ratio = (found / expected)[1:-1]
    assert np.all(np.abs(ratio - 1) < 4 / math.sqrt(800) * 1.05), ratio


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("count", [120, 400])
def test_as_likely_as_the_truth(name, count):
    """The criterion at the maximum is below the truth's (2 for an unfinished search); a bad search ends tens above."""
    motion = MOTIONS[name]
    for seed in (0, 1):
        y = drawn(motion, count, seed)
        series = _Series(y, 1.0, WALKS)
        found = fit_motion(y, 1.0, WALKS)
        assert series.score(found) < series.score(motion) + 2.0
        if name == "white":
            assert found.sigma == pytest.approx(np.std(y), rel=4 / math.sqrt(2 * count))


def cubic_system(z):
    """Position, velocity, acceleration; the position is measured."""
    K = len(z)
    Phi = np.array([[[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]] * K)
    H = np.array([[[1.0, 0.0, 0.0]]] * K)
    zero = np.zeros((K, 3, 3))
    return LinearSystem(
        Phi=Phi, Q=zero, H=H, R=np.ones((K, 1, 1)), z=z[:, None], x0=np.zeros(3), P0=1e4 * np.eye(3), S=None
    )


def test_windowed_fits_find_the_states_beside_a_tone():
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
