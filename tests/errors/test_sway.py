"""Oscillators against their differential equations, and the states of a swaying base against what it really does."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from truenorth.errors.sway import AxisMotion, Oscillator

OSCILLATORS = [
    Oscillator(order, 0.03, w, damping) for order in (1, 2) for w in (0.3, 2.8) for damping in (1e-9, 0.02, 0.6)
]


def dynamics(item):
    w, damp = item.frequency, 2 * item.damping * item.frequency
    stage = np.array([[0.0, 1.0], [-(w**2), -damp]])
    if item.order == 1:
        return stage
    A = np.zeros((4, 4))
    A[:2, :2] = A[2:, 2:] = stage
    A[3, 1] = 1.0
    return A


@pytest.mark.parametrize("item", OSCILLATORS, ids=str)
def test_transition_is_the_exponential(item):
    Phi = AxisMotion(1.0, (item,)).blocks(1.0)[0]
    np.testing.assert_allclose(Phi, expm(dynamics(item)), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("item", OSCILLATORS, ids=str)
def test_it_stays_as_it_is(item):
    """Phi P Phi' + Q = P, with Q from its own integral; the output has the sigma asked for."""
    Phi, Q, P, h = AxisMotion(1.0, (item,)).blocks(1.0)
    np.testing.assert_allclose(Phi @ P @ Phi.T + Q, P, rtol=1e-8, atol=1e-9 * np.abs(P).max())
    assert math.sqrt(h @ P @ h) == pytest.approx(item.sigma, rel=1e-12)


@pytest.mark.parametrize("item", OSCILLATORS, ids=str)
def test_autocovariance_is_that_of_the_states(item):
    motion = AxisMotion(1.0, (item,))
    Phi, _, P, h = motion.blocks(1.0)
    expected = [h @ np.linalg.matrix_power(Phi, k) @ P @ h for k in range(600)]
    np.testing.assert_allclose(motion.autocovariance(1.0, 600), expected, atol=1e-11 * item.sigma**2)


@pytest.mark.parametrize("order", [1, 2])
def test_the_base_does_not_leave(order):
    """What a velocity integrates to stays bounded: its spectrum at frequency zero is nothing against that at the peak."""
    item = Oscillator(order, 0.03, 1.0, 0.05)
    A, h = dynamics(item), AxisMotion(1.0, (item,)).blocks(1.0)[3]

    def gain(w):
        drive = np.zeros(len(A))
        drive[1] = 1.0
        return abs(h @ np.linalg.solve(1j * w * np.eye(len(A)) - A, drive))

    assert gain(1e-6) < 1e-5 * gain(1.0)


def test_blocks_of_an_axis():
    motion = AxisMotion(1e-3, (Oscillator(2, 0.03, 1.0, 0.05), Oscillator(1, 0.01, 0.5, 0.1)))
    Phi, Q, P, h = motion.blocks(1.0)
    assert Phi.shape == Q.shape == P.shape == (6, 6)
    assert not Phi[:4, 4:].any()
    assert math.sqrt(h @ P @ h + 1e-6) == pytest.approx(motion.sigma)
