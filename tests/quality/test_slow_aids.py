"""Errors of aids that last: seen in innovations, taken up with the right size, and left alone where they are white."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.aiding.source import Aiding, state
from truenorth.quality.slow_aids import slow_errors, with_slow
from truenorth.quality.whiteness import scatter_of_means
from truenorth.state.track import Residuals

ROWS, INTERVAL = 1500, 0.2


def markov(rng, sigma, time, axes=3):
    """A Gauss-Markov error (ROWS, axes)."""
    keep = np.exp(-INTERVAL / time)
    x = np.empty((ROWS, axes))
    x[0] = sigma * rng.standard_normal(axes)
    for k in range(1, ROWS):
        x[k] = keep * x[k - 1] + sigma * np.sqrt(1.0 - keep**2) * rng.standard_normal(axes)
    return x


def seen(name, innovation, sigma, states=None):
    """Slow errors that these innovations of a source show."""
    time, size = INTERVAL * np.arange(ROWS), np.full((ROWS, 3), sigma)
    used = np.ones(ROWS, dtype=bool)
    nis = np.sum((innovation / sigma) ** 2, axis=1)
    residuals = Residuals(name, time, innovation, size, nis, used, 0, time, ~used)
    kind = {"GNSS position": "position", "odometer": "body velocity"}.get(name, "velocity")
    source = Aiding(name, kind, time, np.zeros((ROWS, 3)), size, states=states or {})
    found, said = slow_errors(SimpleNamespace(residuals=(residuals,)), [source])
    assert len(found) == len(said)
    return found, source


def test_means_of_white_noise_scatter_as_they_should():
    rng = np.random.default_rng(4)
    assert all(scatter_of_means(rng.standard_normal((ROWS, 3))) == 1.0 for _ in range(50))


def test_a_correlation_too_small_for_any_lag_is_seen_in_means():
    """A tenth of the power for 20 s at 5 Hz: means over such a time err by 1 + .1 (1 + r) / (1 - r) times the variance, about."""
    rng = np.random.default_rng(5)
    e = rng.standard_normal((ROWS, 3)) + markov(rng, np.sqrt(0.1), 20.0)
    assert 1.8 < scatter_of_means(e / np.sqrt(1.1)) < 4.5


@pytest.mark.parametrize(
    ("name", "sigma", "size", "time"), [("GNSS position", 0.5, 2.0, 60.0), ("GNSS velocity", 0.1, 0.05, 20.0)]
)
def test_slow_errors_are_taken_up_and_white_ones_are_not(name, sigma, size, time):
    """No smaller than they are by half, no larger than four times: the filter has followed them, by how much nobody knows."""
    rng = np.random.default_rng(6)
    white = sigma * rng.standard_normal((ROWS, 3))
    assert seen(name, white, sigma)[0] == {}
    found, source = seen(name, white + markov(rng, size, time), sigma)
    assert 0.5 * size < found[name].group.sigma[0] < 4.0 * size
    (louder,) = with_slow([source], found)
    assert found[name].group in louder.states.values()


def test_what_is_too_large_for_a_slow_error_is_another_fault():
    rng = np.random.default_rng(7)
    assert seen("GNSS position", 0.5 * rng.standard_normal((ROWS, 3)) + 40.0, 0.5)[0] == {}


def test_a_wheel_slips_once_its_scale_and_mounting_are_estimated():
    rng = np.random.default_rng(8)
    innovation = 0.05 * rng.standard_normal((ROWS, 3)) + markov(rng, 0.1, 10.0)
    assert seen("odometer", innovation, 0.05)[0] == {}
    known = state("odometer", "scale", 0.03) | state("odometer", "mounting", np.full(2, 0.05))
    assert set(seen("odometer", innovation, 0.05, known)[0]) == {"odometer"}


def test_heights_that_are_left_out_say_nothing():
    rng = np.random.default_rng(8)
    e = 0.5 * rng.standard_normal((ROWS, 3)) + markov(rng, 2.0, 60.0)
    e[:, 2] = np.nan
    found, _ = seen("GNSS position", e, 0.5)
    assert found["GNSS position"].group.sigma[2] < 1e-2 * found["GNSS position"].group.sigma[0]


@pytest.mark.parametrize(("slip", "found"), [(0.03, True), (0.0, False)])
def test_rounded_pulses_hide_no_slip_and_constraints_that_are_kept_neither(slip, found):
    """What a row counts too little the next counts too much; sideways a wheel errs by a tenth of what sigma says."""
    pulse, sigma = 0.03, 0.08
    states = state("odometer", "scale", 0.03) | state("odometer", "mounting", np.full(2, 0.05))
    for seed in range(20):
        rng = np.random.default_rng([9, seed])
        e = 0.1 * sigma * rng.standard_normal((ROWS, 3))
        e[:, 1] = np.diff(pulse * rng.random(ROWS + 1)) / INTERVAL + markov(rng, slip, 5.0, 1)[:, 0]
        shown, _ = seen("odometer", e, sigma, states)
        assert ("odometer" in shown) == found
        if found:
            assert 0.5 * slip < shown["odometer"].group.sigma[1] < 4.0 * slip
            assert not shown["odometer"].across
