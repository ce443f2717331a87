"""Tracks: part of one, errors of one against another, and the step from epoch to epoch."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector
from truenorth.core.earth import ecef_axes, ecef_from_geodetic, geodetic_from_ecef
from truenorth.core.errors import DataError
from truenorth.state.layout import DP, DV, PHI
from truenorth.state.track import Track

TIME = np.arange(5.0)


def track(lon=0.3, alt=200.0):
    C = dcm_from_euler(np.linspace(0.0, 5.0, 5), 0.1, -0.2)
    place = np.column_stack([0.7 + 1e-3 * TIME, lon + 1e-3 * TIME, np.full(5, alt)])
    return Track.of_motion(TIME, C, np.tile([1.0, 2.0, 3.0], (5, 1)), place)


@pytest.mark.parametrize("lon", [0.3, np.pi])
def test_errors_are_the_metres_on_the_ellipsoid(lon):
    """Against the straight line between both places; one west, the other east of 180 deg."""
    truth, dp = track(lon), np.array([30.0, -40.0, 5.0])
    lat, lon, _ = truth.position.T
    there = ecef_from_geodetic(*truth.position.T) + np.einsum("kij,j->ki", ecef_axes(lat, lon), dp)
    position = np.column_stack(geodetic_from_ecef(there))
    phi = np.array([1e-3, -2e-3, 3e-3])
    C = dcm_from_rotation_vector(-phi) @ truth.C_nb
    moved = Track.of_motion(TIME, C, truth.v_n + np.array([0.1, 0.2, 0.3]), position)
    errors = moved.errors_against(truth)
    np.testing.assert_allclose(errors[:, PHI], np.tile(phi, (5, 1)), atol=1e-12)
    np.testing.assert_allclose(errors[:, DV], np.tile([0.1, 0.2, 0.3], (5, 1)), atol=1e-12)
    np.testing.assert_allclose(errors[:, DP], np.tile(dp, (5, 1)), atol=1e-3)  # 50 m over the earth's radius, squared
    np.testing.assert_array_equal(moved[2:4].errors_against(truth, np.array([2, 3])), errors[2:4])


def test_a_part_has_its_own_epochs():
    whole = track()
    part = whole[1::2]
    np.testing.assert_array_equal(part.time, [1.0, 3.0])
    np.testing.assert_array_equal(part.C_nb, whole.C_nb[1::2])
    assert part.interval == 2.0
    assert part.P.shape == (0, 15, 15)
    assert len(whole[:1]) == 1
    with pytest.raises(DataError, match="a track of 1 epochs"):
        _ = whole[:1].interval
    with pytest.raises(DataError, match=r"a step of 2\.000 s after 1\.000 s"):
        _ = whole[np.array([0, 1, 3, 4])].interval
