"""How much more a match of coloured innovations scatters: laws of series whose density is known."""

import math

import numpy as np
import pytest
from scipy.fft import dct
from scipy.signal import lfilter

from truenorth.quality.colour import averaged, colour_of, cosines

COUNT = 300
SLOW = np.stack([np.linspace(-1.0, 1.0, COUNT), np.zeros(COUNT)], axis=1)  # a ramp along the first of two axes
SLOW /= np.linalg.norm(SLOW)


def red(rng, pole):
    """(COUNT, 2) of a first-order process of unit variance, whose density at zero is (1 + pole) / (1 - pole)."""
    noise = math.sqrt(1.0 - pole**2) * rng.standard_normal((COUNT + 200, 2))
    return lfilter([1.0], [1.0, -pole], noise, axis=0)[200:]


def weighed(nu, signature=SLOW):
    """A match's square, and what is left of it by the colour."""
    match = float(np.sum(nu * signature))
    return match**2, colour_of(nu - match * signature, signature).ratio(match**2)


def test_cosines_are_the_orthonormal_transform():
    x = np.random.default_rng(1).standard_normal((37, 3))
    assert np.allclose(cosines(x), dct(x, axis=0, norm="ortho"), atol=1e-13)


def test_means_over_neighbours_keep_what_is_even():
    assert np.allclose(averaged(np.ones((50, 2))), 1.0)


def test_white_innovations_keep_their_ratio():
    rng = np.random.default_rng(2)
    pairs = np.array([weighed(rng.standard_normal((COUNT, 2))) for _ in range(400)])
    same = pairs[:, 0] == pairs[:, 1]
    assert 0.9 < same.mean() < 0.99  # but one in twenty, by chance
    assert np.all(pairs[:, 1] <= pairs[:, 0] + 1e-9)


@pytest.mark.parametrize("pole", [0.5, 0.8])
def test_a_slow_match_of_red_innovations_is_as_rare_as_it_says(pole):
    """Of a density of 3 and 9 at zero the match's square is so much larger; by the colour one in twenty is beyond 1.96 sigma."""
    rng = np.random.default_rng(3)
    raw, found = np.array([weighed(red(rng, pole)) for _ in range(400)]).T
    assert raw.mean() > 0.7 * (1.0 + pole) / (1.0 - pole)
    assert np.mean(raw > 1.96**2) > 0.2
    assert np.mean(found > 1.96**2) < 0.1
    assert np.mean(found > 9.0) < 0.02 < np.mean(raw > 9.0)


def test_waves_do_not_grow_a_slow_match():
    t = np.arange(COUNT)
    waves = np.stack([1.4 * np.cos(1.2 * t), 1.4 * np.cos(1.2 * t + 1.0)], axis=1)
    assert colour_of(waves, SLOW).growth == 1.0
    fast = np.stack([np.cos(1.25 * t), 0.0 * t], axis=1)
    assert colour_of(waves, fast).growth > 3.0


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_what_is_there_does_not_hide_itself(pole):
    """A signature of 12 sigmas of its own noise is beyond the limit of a fault in every log: its power is not in the density."""
    rng = np.random.default_rng(4)
    size = 12.0 * math.sqrt((1.0 + pole) / (1.0 - pole))
    assert min(weighed(red(rng, pole) + size * SLOW)[1] for _ in range(100)) > 25.0


def test_axes_that_go_together_count_together():
    """Of the same noise on two axes a signature along their sum scatters twice as much."""
    rng = np.random.default_rng(5)
    one = np.repeat(rng.standard_normal((COUNT, 1)), 2, axis=1)
    both = np.repeat(SLOW[:, :1], 2, axis=1)
    assert 1.5 < colour_of(one, both).growth < 2.6
