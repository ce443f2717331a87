"""Invariant errors: what a correction leaves, against the group itself; and that an odometer sees no azimuth in them."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm, skew
from truenorth.errors.invariant import keep_reset, left_jacobian, reset


def jacobian(phi):
    return np.stack([left_jacobian(tuple(phi), tuple(e)) for e in np.eye(3)], axis=1)


def with_errors(C, v, phi, xi):
    """Attitude and velocity that are off by phi and xi."""
    return dcm_from_rotation_vector(-phi) @ C, dcm_from_rotation_vector(-phi) @ v + jacobian(-phi) @ xi


def errors_of(C_hat, v_hat, C, v):
    phi = rotation_vector_from_dcm(C @ C_hat.T)
    return phi, np.linalg.solve(jacobian(-phi), v_hat - dcm_from_rotation_vector(-phi) @ v)


def fed_back(C_hat, v_hat, x, P):
    """As the closed loop does it."""
    s = np.zeros(24)
    s[4:7] = v_hat
    reset(s, x, P, False)
    return dcm_from_rotation_vector(x[:3]) @ C_hat, v_hat - x[3:6]


@pytest.mark.parametrize("azimuth", [0.0, 0.1, -0.5])
def test_a_correction_leaves_the_errors_that_its_covariance_says(azimuth):
    rng = np.random.default_rng(3)
    C, v = dcm_from_rotation_vector(rng.normal(size=3)), np.array([6.0, -8.0, 0.3])
    phi, xi = np.array([2e-3, -3e-3, azimuth]), np.array([0.05, -0.02, 0.03])
    for _ in range(5):
        d = rng.normal(size=6) * [*[1e-4] * 3, *[1e-3] * 3]  # what the correction does not know
        C_hat, v_hat = with_errors(C, v, phi + d[:3], xi + d[3:])
        x = np.zeros(8)
        x[:3], x[3:6] = phi, xi - np.cross(phi, v_hat)
        # The covariance of this one error, in the ordinary coordinates before the correction.
        ordinary = np.concatenate([d[:3], d[3:] + np.cross(v_hat, d[:3])])
        P = np.zeros((8, 8))
        P[:6, :6] = np.outer(ordinary, ordinary)
        C_new, v_new = fed_back(C_hat, v_hat, x, P)
        left_phi, left_xi = errors_of(C_new, v_new, C, v)
        left = np.concatenate([left_phi, left_xi + np.cross(v_new, left_phi)])
        # Second order in d, and the terms of Q that are left out.
        assert np.allclose(P[:6, :6], np.outer(left, left), rtol=0.0, atol=2e-3 * np.linalg.norm(left) ** 2)
        assert np.array_equal(P, P.T)
        assert np.all(P[6:] == 0.0)


def test_the_map_that_is_kept_is_the_one_that_carries_the_covariance():
    rng = np.random.default_rng(4)
    s, x = np.zeros(24), rng.normal(size=8)
    s[4:7] = 5.0, -7.0, 0.4
    root = rng.normal(size=(8, 8))
    P, D = root @ root.T, np.eye(8)
    keep_reset(s, x, False, D)
    expected = D @ P @ D.T
    reset(s, x, P, False)
    np.testing.assert_allclose(P, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_large_corrections_of_velocity_turn_with_the_attitude():
    """A vehicle whose heading alone was wrong by 60 deg: its velocity is where the heading points, before and after."""
    C, v = np.eye(3), np.array([0.0, 10.0, 0.0])
    phi = np.radians([0.0, 0.0, 60.0])
    C_hat, v_hat = with_errors(C, v, phi, np.zeros(3))
    x = np.zeros(6)
    x[:3], x[3:] = phi, -np.cross(phi, v_hat)
    C_new, v_new = fed_back(C_hat, v_hat, x, np.zeros((6, 6)))
    assert np.allclose(C_new, C, atol=1e-12)
    assert np.allclose(v_new, v, atol=1e-12)


def test_the_jacobian_of_rotations():
    phi, e = np.array([0.02, -0.01, 0.7]), 1e-6 * np.array([0.3, 0.8, -0.5])
    left = rotation_vector_from_dcm(dcm_from_rotation_vector(phi) @ dcm_from_rotation_vector(-(phi + e)))
    assert np.allclose(-left, jacobian(phi) @ e, atol=1e-11)
    small = 1e-5 * phi
    assert np.allclose(jacobian(small), np.eye(3) + skew(small) / 2, atol=1e-10)
