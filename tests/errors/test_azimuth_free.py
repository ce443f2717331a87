"""Azimuth that nothing shows: what the body sees is the same after a turn about the vertical, and a correction shows no more."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector, quaternion_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.azimuth_free import keep_reset, reset

UP = np.array([0.0, 0.0, 1.0])
V, LATITUDE = np.array([5.0, -7.0, 0.4]), np.radians(48.0)
W_IE = EARTH_RATE * np.array([0.0, np.cos(LATITUDE), np.sin(LATITUDE)])


def state(C, v=V):
    """The loop's, in a frame w that points north at the latitude."""
    s = np.zeros(24)
    C_we = np.array(
        [[0.0, 1.0, 0.0], [-np.sin(LATITUDE), 0.0, np.cos(LATITUDE)], [np.cos(LATITUDE), 0.0, np.sin(LATITUDE)]]
    )
    s[:4], s[4:7], s[7:11] = quaternion_from_dcm(C), v, quaternion_from_dcm(C_we.T)
    return s


def unseen(C, v):
    """(15,) the direction of an azimuth error of one radian that nothing in the body shows."""
    x = np.zeros(15)
    x[2], x[3:6], x[9:12] = 1.0, -np.cross(UP, v), C.T @ np.cross(UP, W_IE)
    return x


def fed_back(s, C, v, x, P):
    """Attitude, velocity and what is added to the gyros' bias, as the closed loop does it."""
    reset(s, x, P)
    return dcm_from_rotation_vector(x[:3]) @ C, v - x[3:6], x[9:12]


@pytest.mark.parametrize("azimuth", [0.05, -1.0, 2.5])
def test_a_turn_that_nothing_in_the_body_shows_is_taken_off_whole(azimuth):
    C = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6]))
    turned, v, bias = fed_back(state(C), C, V, azimuth * unseen(C, V), np.zeros((16, 16)))
    assert np.allclose(turned, dcm_from_rotation_vector(azimuth * UP) @ C, atol=1e-12)
    assert np.allclose(turned.T @ v, C.T @ V, atol=1e-12)  # what a log shows
    assert np.allclose(turned.T @ W_IE + bias, C.T @ W_IE, atol=1e-16)  # and the gyros


def test_no_correction_shows_what_nothing_shows():
    rng = np.random.default_rng(5)
    C, v = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6])), V.copy()
    P = np.zeros((16, 16))
    P[:15, :15] = np.outer(unseen(C, v), unseen(C, v))
    for _ in range(200):
        x = rng.normal(size=15) * np.repeat([3e-3, 0.05, 1.0, 1e-5, 1e-3], 3)
        x[2] *= 10.0
        C, v, _ = fed_back(state(C, v), C, v, x, P)
    now = unseen(C, v)
    # Of the level parts of 200 corrections a tilt of some hundredths is left, which turns no azimuth.
    np.testing.assert_allclose(P[:15, :15], np.outer(now, now), rtol=0.0, atol=1e-9)


def test_the_map_that_is_kept_is_the_one_that_carries_the_covariance():
    rng = np.random.default_rng(4)
    s, x = state(dcm_from_rotation_vector(rng.normal(size=3))), rng.normal(size=16)
    root = rng.normal(size=(16, 16))
    P, D = root @ root.T, np.eye(16)
    keep_reset(s, x.copy(), D)
    expected = D @ P @ D.T
    reset(s, x, P)
    np.testing.assert_allclose(P, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    assert np.array_equal(P, P.T)


def test_small_corrections_are_taken_off_as_they_are():
    rng = np.random.default_rng(6)
    C, x = dcm_from_rotation_vector(rng.normal(size=3)), 1e-6 * rng.normal(size=15)
    was = x.copy()
    reset(state(C), x, np.zeros((16, 16)))
    assert np.allclose(x, was, rtol=0.0, atol=1e-11)
