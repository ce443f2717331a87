"""What is known besides attitude at the end of an alignment on the move."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.alignment.in_motion_answer import less_sure_all_along
from truenorth.alignment.in_motion_spread import Spread
from truenorth.alignment.moving import Moving, moving_of
from truenorth.alignment.result import History
from truenorth.core.attitude import UNIFORM_SIGMA, dcm_from_euler, dcm_from_rotation_vector, skew
from truenorth.core.earth import EARTH_RATE, radii
from truenorth.state.layout import BG, DP, DV, PHI
from truenorth.state.track import Track

V, WAY = np.array([3.0, -8.0, 0.5]), np.array([900.0, -1400.0])


def at_the_end(sigma):
    """Of a wheel's way, heading known to `sigma` by the filter, velocity and place with it to first order."""
    lat, lon = 0.8, 0.3
    R_M, R_N = radii(lat)
    place = np.array([[lat, lon, 0.0], [lat, lon, 0.0]])
    place[0, :2] -= WAY[1] / R_M, WAY[0] / (R_N * math.cos(lat))
    column = np.zeros(15)
    column[PHI.stop - 1] = 1.0
    column[DV][:2], column[DP][:2] = (V[1], -V[0]), (WAY[1], -WAY[0])
    P = sigma**2 * np.outer(column, column)
    track = SimpleNamespace(position=place, C_nb=[dcm_from_rotation_vector(np.array([0.02, -0.03, 0.7]))])
    return Moving(V, P, 0.0, "motion", {}, None, 0.0, sigma, track)


@pytest.mark.parametrize(("own", "more"), [(0.02, 0.0), (0.02, 0.1), (0.1, 0.4), (0.05, 1.8)])
def test_velocity_and_way_turn_with_a_heading_that_is_less_sure(own, more):
    """No less than the mean squares of their errors over headings drawn with that sigma; 5 % more, as long as it is small."""
    known = at_the_end(own).turned(more**2)
    phi = np.hypot(own, more) * np.random.default_rng(1).standard_normal(40_000)
    C = dcm_from_rotation_vector(-phi[:, None] * [0.0, 0.0, 1.0])
    dv = C @ V - V
    way = np.append(WAY, 0.0)
    dp = C @ way - way
    for part, error in ((DV, dv), (DP, dp)):
        found = known.P[part, part][:2, :2]
        true = error[:, :2].T @ error[:, :2] / len(error)
        assert np.linalg.eigvalsh(found - true).min() > -0.05 * np.trace(true)
        assert more > 0.1 or np.abs(found - true).max() < 0.05 * np.trace(true)
    assert known.P[2, 2] == pytest.approx(own**2 + more**2)
    assert np.linalg.eigvalsh(known.P).min() > -1e-9 * np.trace(known.P)
    assert known.P[5, 5] == 0.0


def test_what_a_heading_that_is_less_sure_goes_with_is_seen_by_no_sensor_in_the_body():
    """Neither the log, ``C'(dv + v x phi)``, nor the gyros of known bias, by the earth's rate: both would narrow it again."""
    before = at_the_end(0.02)
    known = before.turned(0.6**2)
    C = known.track.C_nb[0]
    w = EARTH_RATE * np.array([0.0, math.cos(0.8), math.sin(0.8)])
    sees = np.zeros((6, 15))
    sees[:3, DV], sees[:3, PHI] = C.T, -C.T @ skew(V)
    sees[3:, BG], sees[3:, PHI] = np.eye(3), C.T @ skew(w)
    turn = known.turn
    np.testing.assert_allclose(sees @ turn, np.zeros(6), atol=1e-12)
    for later in (known, known.less_sure(0.1**2)):
        assert later.P[2, 2] > 0.6**2
        beyond = later.P - later.P[2, 2] * np.outer(turn, turn)
        np.testing.assert_allclose(beyond[PHI.stop - 1], np.zeros(15), atol=2e-3 * np.abs(later.P).max())


def test_a_larger_sigma_of_velocity_is_an_error_of_its_own():
    known = at_the_end(0.02).turned(0.6**2)
    larger = known.less_sure(0.0, velocity=1.3, position=1.2)
    np.testing.assert_allclose(np.diag(larger.P)[DV], 1.3**2 * np.diag(known.P)[DV])
    np.testing.assert_allclose(np.diag(larger.P)[DP], 1.2**2 * np.diag(known.P)[DP])
    np.testing.assert_array_equal(larger.P[2], known.P[2])


def _drive():
    """A track of 200 s in bends, whose filter is sure of all, and its history."""
    time = np.arange(200.0)
    heading = 0.5 * np.sin(0.05 * time) + 0.01 * time
    v_n = 8.0 * np.stack([np.sin(heading), np.cos(heading), 0.0 * time], axis=1)
    way = np.cumsum(v_n, axis=0) - v_n[0]
    R_M, R_N = radii(0.8)
    place = np.stack([0.8 + way[:, 1] / R_M, 0.3 + way[:, 0] / (R_N * math.cos(0.8)), 0.0 * time], axis=1)
    C_nb = np.stack([dcm_from_euler(h, 0.0, 0.0) for h in heading])
    track = Track.of_motion(time, C_nb, v_n, place)
    track = Track(**{**vars(track), "P": np.broadcast_to(1e-8 * np.eye(15), (len(time), 15, 15))})
    none, phi = np.zeros((len(time), 3)), track.P[:, PHI, PHI]
    return track, way, History(time, C_nb, phi, 0.0 * phi, none, none, none + 1e-9, none, none, none, none, time)


@pytest.mark.parametrize("off", [0.3, UNIFORM_SIGMA])
def test_a_heading_that_nothing_shows_is_unsure_all_along_the_track(off):
    """Of a wheel's track alone the filter was sure: velocity was up to 16, place 6 sigmas off on the way, and heading 213."""
    track, way, history = _drive()
    spread = Spread(np.diag([0.0, 0.0, off**2]))
    moving, less_sure = less_sure_all_along(moving_of(track, 0.0, "motion", None).turned(off**2), history, spread)
    phi = np.linspace(-1.0, 1.0, 201) * math.sqrt(3.0) * off  # evenly, with that sigma
    C = dcm_from_rotation_vector(-phi[:, None] * [0.0, 0.0, 1.0])
    for part, true in ((DV, track.v_n), (DP, way)):
        error = np.mean(np.sum((true @ np.swapaxes(C, 1, 2) - true)[..., :2] ** 2, axis=2), axis=0)
        known = moving.track.P[:, part, part][:, [0, 1], [0, 1]].sum(axis=1)
        assert np.all(known >= 0.95 * error)
    np.testing.assert_allclose(moving.track.P[:, 2, 2], off**2, rtol=1e-6)
    np.testing.assert_allclose(less_sure.phi_covariance[:, 2, 2], off**2, rtol=1e-6)
    north = np.sqrt(np.sum(less_sure.gyro_bias_sigma**2, axis=1))
    np.testing.assert_allclose(north, off * EARTH_RATE * np.cos(track.position[:, 0]), rtol=1e-3)
    np.testing.assert_allclose(moving.track.P[-1], moving.P, atol=1e-6)


def test_where_places_are_measured_heading_alone_is_less_sure():
    track, _, history = _drive()
    spread = Spread(np.diag([1e-4, 2e-4, 0.1]))
    moving, less_sure = less_sure_all_along(moving_of(track, 0.0, "motion", None), history, spread)
    more = moving.track.P - track.P
    np.testing.assert_allclose(more[:, PHI, PHI], np.broadcast_to(spread.moment, (len(track), 3, 3)), atol=1e-12)
    np.testing.assert_allclose(less_sure.phi_covariance - history.phi_covariance, more[:, PHI, PHI], atol=1e-12)
    assert not more[:, 3:].any()
    np.testing.assert_array_equal(less_sure.gyro_bias_sigma, history.gyro_bias_sigma)
