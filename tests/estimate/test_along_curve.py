"""Rows over the ground of a motion that is known in the body: linear where the correction ends."""

import numpy as np
import pytest

from tests.errors.test_azimuth_free import AT, LEVER, UP, V, assumed, state, unseen
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.linalg import padded
from truenorth.errors.azimuth_free import beyond_tangent
from truenorth.estimate.along_curve import bend, bent, follow
from truenorth.estimate.memory import memory
from truenorth.filters.recursion import workspace

N = 24
SIZE = padded(17)


def row(rng):
    """Of velocity and place, and of what an arm and a drift add."""
    H = np.zeros((3, N))
    H[:, [2, 3, 4, 6, 7]] = rng.normal(size=(3, 5))
    return H


def loop(C, P=None):
    return memory(state(C), assumed(), np.eye(17) if P is None else P, 0.0, 1)


def curve(m, x):
    """(N,) the errors that are taken off along the curve."""
    dv, dp, _, _ = beyond_tangent(m.s, x, m.aux, AT, (*LEVER, 1.0))
    out = np.array(x)
    out[3:5], out[6:8] = dv, dp
    return out


@pytest.mark.parametrize("azimuth", [0.0, 0.3, -2.0])
def test_a_row_along_the_curve_is_its_derivative_there(azimuth):
    rng = np.random.default_rng(3)
    m, w, room, H = loop(dcm_from_rotation_vector(rng.normal(size=3))), workspace(SIZE, 3), bent(N), row(rng)
    x = np.append(rng.normal(size=17), np.zeros(N - 17))
    x[2] = azimuth
    room.H[:], room.z[:], room.x[:] = H, rng.normal(size=3), x
    w.H[:] = H
    bend(m, AT, (*LEVER, 1.0), w, room)
    step = 1e-6
    ahead = np.array([H @ (curve(m, x + step * e) - curve(m, x - step * e)) / (2.0 * step) for e in np.eye(N)]).T
    np.testing.assert_allclose(w.H, ahead, rtol=1e-6, atol=1e-6)
    # What is left beyond x is left of the linear row as well.
    np.testing.assert_allclose(w.z - w.H @ x, room.z - H @ curve(m, x), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("azimuth", [0.05, -0.4, 1.0])
def test_a_fix_finds_an_azimuth_that_is_far_off(azimuth):
    """A way of 5 km, and a fix of 1 m at its end: by the tangent .4 rad are 400 m short of it."""
    C = dcm_from_rotation_vector(np.array([0.02, -0.01, 0.6]))
    direction = unseen(C, V)
    P = np.outer(direction, direction) + np.diag(np.repeat(1e-8, 17))
    m, w, room = loop(C, P), workspace(SIZE, 3), bent(N)
    w.P[:17, :17] = P
    for i in range(3):
        w.H[i, 6 + i], w.R[i, i] = 1.0, 1.0
    w.z[:] = np.append(LEVER, 0.0) - dcm_from_rotation_vector(azimuth * UP) @ np.append(LEVER, 0.0)
    follow(SIZE, m, AT, (*LEVER, 1.0), w, room)
    assert room.x[2] == pytest.approx(azimuth, abs=1e-6 + 2e-7 * abs(azimuth))
    S = w.H @ w.P @ w.H.T + w.R
    # The fix costs what its azimuth does, and nothing more.
    assert w.z @ np.linalg.solve(S, w.z) == pytest.approx(azimuth**2, rel=1e-4)
