"""What is known besides attitude at the end of an alignment on the move."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.alignment.moving import Moving
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import radii
from truenorth.state.layout import DP, DV, PHI

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
    return Moving(V, P, 0.0, "motion", {}, None, 0.0, sigma, SimpleNamespace(position=place))


@pytest.mark.parametrize(("own", "more"), [(0.02, 0.0), (0.02, 0.1), (0.1, 0.4), (0.05, 1.8)])
def test_velocity_and_way_turn_with_a_heading_that_is_less_sure(own, more):
    """Mean squares of their errors over headings drawn with that sigma, to 5 %; of heading itself, and of one with the other."""
    known = at_the_end(own).turned(more**2)
    phi = np.hypot(own, more) * np.random.default_rng(1).standard_normal(40_000)
    C = dcm_from_rotation_vector(-phi[:, None] * [0.0, 0.0, 1.0])
    dv = C @ V - V
    way = np.append(WAY, 0.0)
    dp = C @ way - way
    for part, error in ((DV, dv), (DP, dp)):
        found = known.P[part, part][:2, :2]
        true = error[:, :2].T @ error[:, :2] / len(error)
        assert np.abs(found - true).max() < 0.05 * np.trace(true)
    assert known.P[2, 2] == pytest.approx(own**2 + more**2)
    assert np.linalg.eigvalsh(known.P).min() > -1e-9 * np.trace(known.P)
    assert known.P[5, 5] == 0.0
