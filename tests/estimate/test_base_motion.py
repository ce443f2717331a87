"""The variance of a base's velocity, read from the innovations of a filter."""

import numpy as np
import pytest

from truenorth.estimate.base_motion import VelocityNoise
from truenorth.filters import LinearSystem

K, STATES = 120, 30


def wide(rng: np.random.Generator, sigma: np.ndarray) -> LinearSystem:
    """Constants seen in three rows of an epoch, as noisy as `sigma`, of which much less is known before than rows show."""
    H = rng.standard_normal((K, 3, STATES))
    x = 10.0 * rng.standard_normal(STATES)
    one = np.eye(STATES)
    z = H @ x + sigma * rng.standard_normal((K, 3))
    return LinearSystem(one[None], 0.0 * one[None], H, 1e-12 * np.eye(3)[None], z, np.zeros(STATES), 100.0 * one)


@pytest.mark.parametrize("begin", [1.0, 1e-6])
@pytest.mark.parametrize("seed", range(3))
def test_it_is_found_behind_a_wide_prior(seed: int, begin: float) -> None:
    """Chi-square of some 90 numbers an axis, within four sigmas. Its steps were those of the prior's innovations."""
    sigma = np.array([0.1, 0.03, 0.3])
    noise = VelocityNoise(np.full((K, 3), begin), [np.ones(K, dtype=np.bool_)], 6, coloured=False)
    system = wide(np.random.default_rng(seed), sigma)
    found = noise(system)
    assert noise.R[0] == pytest.approx(sigma**2, rel=0.6)
    again = noise(system)  # it stays where it is
    assert np.diagonal(again.system.R[0]) == pytest.approx(np.diagonal(found.system.R[0]), rel=0.1)
