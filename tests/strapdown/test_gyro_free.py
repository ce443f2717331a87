"""Angular rate from twelve accelerometers: exact on a rigid body, honest with noise."""

import numpy as np
import pytest

from truenorth.core.errors import UsageError
from truenorth.papers.related.gyro_free import AMPLITUDES, simulate
from truenorth.strapdown.gyro_free import COLUMNS, ROWS, field_of, noise_of


def test_a_rigid_body_comes_back():
    """Force, angular acceleration and all six products of the rate, from any four places that lie in no plane."""
    rng = np.random.default_rng(2)
    w, dw, f0 = rng.standard_normal((3, 50, 3))
    places = rng.standard_normal((4, 3))
    f = f0[:, None] + np.cross(dw[:, None], places) + np.cross(w[:, None], np.cross(w[:, None], places))
    found = field_of(f, places)
    np.testing.assert_allclose(found.force, f0, atol=1e-12)
    np.testing.assert_allclose(found.acceleration, dw, atol=1e-12)
    np.testing.assert_allclose(found.square, w[:, ROWS] * w[:, COLUMNS], atol=1e-12)


def test_covariance_of_the_noise():
    """Against 20000 draws, to 5 % of each diagonal element."""
    places = 0.3 * np.vstack([np.zeros(3), np.eye(3)])
    found = field_of(np.random.default_rng(3).standard_normal((20000, 4, 3)), places)
    values = np.concatenate([found.acceleration, found.square], axis=1)
    np.testing.assert_allclose(np.var(values, axis=0), np.diag(noise_of(places)), rtol=0.05)


def test_places_in_a_plane_are_refused():
    with pytest.raises(UsageError, match="lie in a plane"):
        field_of(np.zeros((4, 3)), [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    with pytest.raises(UsageError, match=r"expected \(4, 3\)"):
        field_of(np.zeros((3, 3)), np.eye(3))


@pytest.mark.slow
def test_the_filter_is_honest():
    """60 numbers at the end: RMS over sigma within its 99.9 % band, .70 to 1.30; and far below what integrating gives."""
    true, found, sigma = simulate(AMPLITUDES, 20, 9, 0)
    error = (found["filter"] - true)[:, -1]
    assert 0.70 < np.sqrt(np.mean((error / sigma[:, -1]) ** 2)) < 1.30
    assert np.std(error) < 0.1 * np.std((found["integrated"] - true)[:, -1])
