"""Networks by design, and damping that follows the ship."""

import math

import numpy as np
import pytest

from truenorth.core.errors import UsageError
from truenorth.damping.adaptive import FuzzyDamping, leaked
from truenorth.damping.design import design, judged, step_response
from truenorth.damping.networks import SCHULER_RATE, first_order, second_order, third_order
from truenorth.state.track import Track


@pytest.mark.parametrize("network", [first_order(), second_order(0.4, 1.3), third_order(0.6, 1.5, 2.0, 1.0, 3.0)])
def test_no_network_is_without_overshoot(network):
    """Two integrators: the integral of 1 - y is zero, and the response ends at 1."""
    time = np.arange(0.0, 40 * 5064.0, 5.0)
    y = step_response(network, time)
    assert y[-1] == pytest.approx(1.0, abs=1e-9)
    assert np.trapezoid(1.0 - y, time) == pytest.approx(0.0, abs=1e-3 / SCHULER_RATE)
    assert judged(network).overshoot > 0.1


def test_the_step_response_is_that_of_its_differential_equation():
    """Against Euler's method with a hundredth of a per cent of the period as a step."""
    network, h = second_order(0.5), 0.5
    A, B, C, D = network.realised()
    tilt, rate, xi, y = 0.0, 0.0, np.zeros(2), []
    for _ in range(8000):  # tilt' = w_s^2 H (velocity), velocity' = 1 - tilt
        y.append(tilt)
        carried = C @ xi + D * rate
        tilt, rate, xi = tilt + h * SCHULER_RATE**2 * carried, rate + h * (1.0 - tilt), xi + h * (A @ xi + B * rate)
    np.testing.assert_allclose(step_response(network, h * np.arange(8000)), y, atol=2e-3)


def test_third_order_places_all_poles():
    network = third_order(0.5, 1.4, 2.2, 0.8, 3.0)
    closed = np.polyadd(np.polymul((1.0, 0.0, 0.0), network.denominator), SCHULER_RATE**2 * np.array(network.numerator))
    found = np.sort_complex(np.roots(closed) / SCHULER_RATE)
    pair = [1.4 * (-0.5 + 1j * math.sqrt(0.75)), 2.2 * (-0.8 + 0.6j)]
    np.testing.assert_allclose(found, np.sort_complex(np.array([*pair, *np.conj(pair), -3.0])), atol=1e-8)
    with pytest.raises(UsageError, match="expected above 0"):
        third_order(0.3, 1.05, 0.5, 1.0, -1.0)


def test_design_meets_both_figures_or_says_what_the_nearest_does():
    found = design(2, 0.3, 60 * 60.0)
    assert found.overshoot <= 0.3
    assert found.settling <= 3600.0
    y = step_response(found.network, np.arange(0.0, 60000.0, 10.0))
    assert y.max() - 1.0 == pytest.approx(found.overshoot, abs=2e-3)
    with pytest.raises(UsageError, match="the nearest has"):
        design(2, 0.05, 60 * 60.0)
    with pytest.raises(UsageError, match="expected 2 or 3"):
        design(4, 0.3, 3600.0)


def test_what_leaks_is_what_changes():
    """A constant velocity leaks nothing; a step leaks all of its high frequencies in as H(inf) - 1 says, and decays."""
    network = first_order(0.5)
    time = np.arange(0.0, 40000.0, 10.0)
    v = np.where(time[:, None] < 5000.0, [3.0, -2.0, 0.0], [3.0, 6.0, 0.0])
    course = Track.of_motion(time, np.broadcast_to(np.eye(3), (len(time), 3, 3)), v, np.zeros((len(time), 3)))
    leak = leaked(course, network)
    assert np.abs(leak[time < 4990.0]).max() < 1e-12
    assert np.abs(leak[:, 0]).max() < 1e-12
    jump = leak[np.searchsorted(time, 5000.0), 1]
    assert jump == pytest.approx(8.0 * (1.0 - network.numerator[0]), rel=1e-9)
    assert abs(leak[-1, 1]) < 1e-3
    mu = FuzzyDamping(0.3, 1.5).of_course(course, network)
    assert mu[0] == 1.0
    assert mu.min() == 0.0
    assert mu[-1] == 1.0
    np.testing.assert_allclose(FuzzyDamping(0.3, 1.5).strength(np.array([0.0, 0.3, 0.9, 1.5, 9.0])), [1, 1, 0.5, 0, 0])
