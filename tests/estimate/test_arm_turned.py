"""What an arm that is not known makes of an attitude that is not known, in the noise of a place."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_euler
from truenorth.estimate.correct import MOST_TURNED, arm_turned

ARM = 15


def added(P, place=True):
    """Variances that a row gets, m^2."""
    H = np.zeros((3, len(P)))
    H[:, 6:9] = np.eye(3) if place else 0.0
    R = np.zeros(3)
    arm_turned.py_func(ARM, dcm_from_euler(0.7, 0.2, -0.3), SimpleNamespace(H=H, P=P), R)
    return R


def uncertain(heading, arm):
    P = np.zeros((18, 18))
    P[:3, :3] = np.diag([0.01, 0.02, heading]) ** 2
    P[15:, 15:] = np.diag(arm) ** 2
    return P


def test_it_is_the_mean_square_of_the_product():
    """Level components are as large as the larger one of two ways in which a frame may point."""
    P, C = uncertain(0.08, [0.5, 1.0, 0.8]), dcm_from_euler(0.7, 0.2, -0.3)
    rng = np.random.default_rng(1)
    phi = rng.standard_normal((400_000, 3)) * np.sqrt(np.diag(P)[:3])
    arm = rng.standard_normal((400_000, 3)) * np.sqrt(np.diag(P)[15:]) @ C.T
    square = np.mean(np.cross(phi, arm) ** 2, axis=0)
    R = added(P)
    assert R[2] == pytest.approx(square[2], rel=0.02)
    assert R[0] == R[1]
    assert 0.99 < R[0] / square[:2].max() < 1.25


def test_what_is_known_adds_nothing():
    known = np.zeros(3)
    np.testing.assert_array_equal(added(uncertain(0.05, known)), 0.0)
    np.testing.assert_array_equal(added(uncertain(0.05, np.ones(3)), place=False), 0.0)
    np.testing.assert_array_equal(added(uncertain(1.1 * np.sqrt(MOST_TURNED), np.ones(3))), 0.0)
    still = uncertain(0.0, np.ones(3))
    still[:3, :3] = 0.0
    np.testing.assert_array_equal(added(still), 0.0)
