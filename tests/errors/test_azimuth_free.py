"""Azimuth that nothing shows: what the body sees is the same after a turn about the vertical, and a correction shows no more."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector, quaternion_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.azimuth_free import keep_reset, reset

UP = np.array([0.0, 0.0, 1.0])
DRIFT, AT = np.array([0.4, -0.7, 0.0]), 15  # of a log in the water, and its first state
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


def unseen(C, v, d=DRIFT):
    """(17,) the direction of an azimuth error of one radian that nothing in the body shows."""
    x = np.zeros(17)
    x[2], x[3:6], x[9:12], x[15:] = 1.0, -np.cross(UP, v + d), C.T @ np.cross(UP, W_IE), 0.0
    return x


def assumed(d=DRIFT):
    return np.append(np.zeros(15), d[:2])


def fed_back(s, C, v, x, P, d=DRIFT):
    """Attitude, velocity, what is added to the gyros' bias, and the drift, as the closed loop does it."""
    reset(s, x, assumed(d), AT, P)
    return dcm_from_rotation_vector(x[:3]) @ C, v - x[3:6], x[9:12], d + np.append(x[15:], 0.0)


@pytest.mark.parametrize("azimuth", [0.05, -1.0, 2.5])
def test_a_turn_that_nothing_in_the_body_shows_is_taken_off_whole(azimuth):
    C = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6]))
    turned, v, bias, d = fed_back(state(C), C, V, azimuth * unseen(C, V), np.zeros((18, 18)))
    assert np.allclose(turned, dcm_from_rotation_vector(azimuth * UP) @ C, atol=1e-12)
    assert np.allclose(turned.T @ (v + d), C.T @ (V + DRIFT), atol=1e-12)  # what a log shows
    assert np.array_equal(d, DRIFT)
    assert np.allclose(turned.T @ W_IE + bias, C.T @ W_IE, atol=1e-16)  # and the gyros


def test_no_correction_shows_what_nothing_shows():
    rng = np.random.default_rng(5)
    C, v, d = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6])), V.copy(), DRIFT
    P = np.zeros((18, 18))
    P[:17, :17] = np.outer(unseen(C, v), unseen(C, v))
    for _ in range(200):
        x = rng.normal(size=17) * np.append(np.repeat([3e-3, 0.05, 1.0, 1e-5, 1e-3], 3), [0.02, 0.02])
        x[2] *= 10.0
        C, v, _, d = fed_back(state(C, v), C, v, x, P, d)
    now = unseen(C, v, d)
    # Of the level parts of 200 corrections a tilt of some hundredths is left, which turns no azimuth.
    np.testing.assert_allclose(P[:17, :17], np.outer(now, now), rtol=0.0, atol=1e-9)


def test_the_map_that_is_kept_is_the_one_that_carries_the_covariance():
    rng = np.random.default_rng(4)
    s, x = state(dcm_from_rotation_vector(rng.normal(size=3))), rng.normal(size=18)
    root = rng.normal(size=(18, 18))
    P, D = root @ root.T, np.eye(18)
    keep_reset(s, x.copy(), assumed(), AT, D)
    expected = D @ P @ D.T
    reset(s, x, assumed(), AT, P)
    np.testing.assert_allclose(P, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    assert np.array_equal(P, P.T)


def test_small_corrections_are_taken_off_as_they_are():
    rng = np.random.default_rng(6)
    C, x = dcm_from_rotation_vector(rng.normal(size=3)), 1e-6 * rng.normal(size=17)
    was = x.copy()
    reset(state(C), x, assumed(), AT, np.zeros((18, 18)))
    assert np.allclose(x, was, rtol=0.0, atol=1e-11)
