"""Azimuth that nothing shows: what the body sees is the same after a turn about the vertical, and a correction shows no more."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector, quaternion_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.azimuth_free import (
    beyond_tangent,
    keep_reset,
    lever_of,
    reset,
    share_of_gyros,
    turns_with_azimuth,
)

UP = np.array([0.0, 0.0, 1.0])
DRIFT, AT = np.array([0.4, -0.7, 0.0]), 15  # of a log in the water, and its first state
LEVER = np.array([3000.0, -4000.0])  # m, from the place about which the vehicle turns
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


def unseen(C, v, d=DRIFT, lever=LEVER):
    """(17,) the direction of an azimuth error of one radian that nothing in the body shows."""
    x = np.zeros(17)
    x[6:8] = lever[1], -lever[0]
    x[2], x[3:6], x[9:12], x[15:] = 1.0, -np.cross(UP, v + d), C.T @ np.cross(UP, W_IE), 0.0
    return x


def assumed(d=DRIFT):
    return np.append(np.zeros(15), d[:2])


def moved(lever, x):
    """The lever once a correction is fed back."""
    return lever - x[6:8]


def fed_back(s, C, v, x, P, d=DRIFT, lever=LEVER, share=1.0):
    """Attitude, velocity, what is added to the gyros' bias, and the drift, as the closed loop does it."""
    reset(s, x, assumed(d), AT, (*lever, share), P)
    return dcm_from_rotation_vector(x[:3]) @ C, v - x[3:6], x[9:12], d + np.append(x[15:], 0.0)


@pytest.mark.parametrize("azimuth", [0.05, -1.0, 2.5])
def test_a_turn_that_nothing_in_the_body_shows_is_taken_off_whole(azimuth):
    C = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6]))
    x = azimuth * unseen(C, V)
    turned, v, bias, d = fed_back(state(C), C, V, x, np.zeros((18, 18)))
    assert np.allclose(turned, dcm_from_rotation_vector(azimuth * UP) @ C, atol=1e-12)
    assert np.allclose(turned.T @ (v + d), C.T @ (V + DRIFT), atol=1e-12)  # what a log shows
    assert np.array_equal(d, DRIFT)
    assert np.allclose(moved(LEVER, x), dcm_from_rotation_vector(azimuth * UP)[:2, :2] @ LEVER)
    assert np.allclose(turned.T @ W_IE + bias, C.T @ W_IE, atol=1e-16)  # and the gyros


def test_no_correction_shows_what_nothing_shows():
    rng = np.random.default_rng(5)
    C, v, d, lever = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6])), V.copy(), DRIFT, LEVER
    P = np.zeros((18, 18))
    P[:17, :17] = np.outer(unseen(C, v), unseen(C, v))
    for _ in range(200):
        x = rng.normal(size=17) * np.append(np.repeat([3e-3, 0.05, 1.0, 1e-5, 1e-3], 3), [0.02, 0.02])
        x[2] *= 10.0
        C, v, _, d = fed_back(state(C, v), C, v, x, P, d, lever)
        lever = moved(lever, x)
    now = unseen(C, v, d, lever)
    # Of the level parts of 200 corrections a tilt of some hundredths is left, which turns no azimuth.
    np.testing.assert_allclose(P[:17, :17], np.outer(now, now), rtol=1e-12, atol=1e-9)


def test_the_map_that_is_kept_is_the_one_that_carries_the_covariance():
    rng = np.random.default_rng(4)
    s, x = state(dcm_from_rotation_vector(rng.normal(size=3))), rng.normal(size=18)
    root = rng.normal(size=(18, 18))
    P, D = root @ root.T, np.eye(18)
    keep_reset(s, x.copy(), assumed(), AT, (*LEVER, 1.0), D)
    expected = D @ P @ D.T
    reset(s, x, assumed(), AT, (*LEVER, 1.0), P)
    np.testing.assert_allclose(P, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())
    assert np.array_equal(P, P.T)


def test_small_corrections_are_taken_off_as_they_are():
    rng = np.random.default_rng(6)
    C, x = dcm_from_rotation_vector(rng.normal(size=3)), 1e-6 * rng.normal(size=17)
    was = x.copy()
    reset(state(C), x, assumed(), AT, (*LEVER, 1.0), np.zeros((18, 18)))
    assert np.allclose(np.delete(x, [6, 7]), np.delete(was, [6, 7]), rtol=0.0, atol=1e-11)
    assert np.allclose(x[6:8], was[6:8], rtol=0.0, atol=1e-8)  # of 5 km, 1e-12 turned


def test_the_lever_is_what_place_has_in_common_with_azimuth():
    rng = np.random.default_rng(7)
    direction, root = unseen(np.eye(3), V), rng.normal(size=(17, 17))
    root[2] = 0.0  # all other errors have nothing to do with azimuth
    P = 0.09 * np.outer(direction, direction) + root @ root.T
    np.testing.assert_allclose(lever_of(P), LEVER, rtol=1e-12)
    assert lever_of(np.zeros((17, 17))) == (0.0, 0.0)


@pytest.mark.parametrize("drift", [-1, AT])
def test_velocity_turns_with_azimuth_where_the_covariance_knows_it_in_the_body(drift):
    s, small = state(np.eye(3)), np.diag(np.full(17, 1e-4))
    v = V + DRIFT * (drift >= 0)
    in_body, over_ground = np.zeros((2, 17))
    in_body[2], in_body[3:6] = 0.2, -0.2 * np.cross(UP, v)
    over_ground[2] = 0.2
    assert turns_with_azimuth(s, assumed(), drift, small + np.outer(in_body, in_body))
    assert not turns_with_azimuth(s, assumed(), drift, small + np.outer(over_ground, over_ground))


def test_beyond_the_tangent_is_what_is_fed_back():
    rng = np.random.default_rng(8)
    s, x = state(dcm_from_rotation_vector(rng.normal(size=3))), rng.normal(size=17)
    (vx, vy), (px, py), _, _ = beyond_tangent(s, x, assumed(), AT, (*LEVER, 1.0))
    reset(s, x, assumed(), AT, (*LEVER, 1.0), np.zeros((18, 18)))
    np.testing.assert_allclose([vx, vy, px, py], x[[3, 4, 6, 7]], rtol=1e-12)


@pytest.mark.parametrize("seen", [0.1, 1.0, 10.0])
def test_gyros_are_biased_by_what_azimuth_makes_of_the_earth_as_far_as_they_are_not_known_better(seen):
    """Of biases of one sigma that have seen the earth's rate to so many of them: ``1/(1 + seen^2)``."""
    C, sigma = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6])), 1e-5
    P = np.diag(np.repeat([0.04, 1.0, 1.0, sigma**2, 1.0, 1.0], 3))[:17, :17]
    H = np.zeros((3, 17))
    H[:, 9:12], H[:, 2] = np.eye(3), -C.T @ np.cross(UP, W_IE)
    P -= P @ H.T @ np.linalg.solve(H @ P @ H.T + (seen * sigma) ** 2 * np.eye(3), H @ P)
    assert share_of_gyros(state(C), -1, P) == pytest.approx(1.0 / (1.0 + seen**2), rel=1e-6)
    assert share_of_gyros(state(C), -1, np.zeros((17, 17))) == 1.0


def test_gyros_that_are_known_are_no_more_biased_after_a_correction():
    C = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6]))
    x, P = np.zeros(17), np.zeros((18, 18))
    x[2], P[2, 2] = 0.3, 0.01
    _, _, bias, _ = fed_back(state(C), C, V, x, P, share=0.0)
    assert np.array_equal(bias, np.zeros(3))
    assert not P[9:12].any()
