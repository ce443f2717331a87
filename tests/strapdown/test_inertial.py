"""Integration in the inertial frame, many rows at once: what it is row by row, and in blocks the bits of one batch."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truenorth.strapdown.inertial_integration import END, ROWS, at_start, go_on, inertial_integrals

COUNT, T = 5 * ROWS + 17, 0.01


@pytest.fixture(scope="module")
def rows():
    """Increments of angle and velocity, some of them of turns too large for a series."""
    rng = np.random.default_rng(5)
    dtheta, dvel = 1e-3 * rng.standard_normal((COUNT, 3)), 0.1 + 0.01 * rng.standard_normal((COUNT, 3))
    dtheta[ROWS + 5 : ROWS + 40] *= 300.0
    dtheta[-2] = 0.0
    return dtheta, dvel


def test_many_rows_at_once_are_what_they_are_one_by_one(rows):
    dtheta, dvel = rows
    epochs = np.array([0, 0, 1, ROWS - 1, ROWS, ROWS + 20, ROWS + 20, COUNT - 1, COUNT])
    C_ib, velocity, position = inertial_integrals(dtheta, dvel, np.full(COUNT, T), epochs)
    C, v, p, before = np.eye(3), np.zeros(3), np.zeros(3), None
    a_before, b_before = np.zeros(3), np.zeros(3)
    found = [(C, v, p)]
    for a, b in zip(dtheta, dvel, strict=True):
        angle = max(np.linalg.norm(a), 1e-12)
        s = _skew(a)
        first, second = (1 - np.cos(angle)) / angle**2, (1 - np.sin(angle) / angle) / angle**2
        mean = np.eye(3) + (first * s + second * s @ s if angle > 1e-6 else 0.0)  # of the attitude within the row
        f = C @ (mean @ b + (np.cross(a_before, b) + np.cross(b_before, a)) / 12.0)
        before = f if before is None else before
        p = p + (v + 0.5 * f - END * (f - before)) * T
        v, before = v + f, f
        C = C @ Rotation.from_rotvec(a + np.cross(a_before, a) / 12.0).as_matrix()
        a_before, b_before = a, b
        found.append((C, v, p))
    for k, epoch in enumerate(epochs):
        for ours, theirs, digits in zip(
            (C_ib[k], velocity[k], position[k]), found[epoch], (1e-13, 1e-9, 1e-9), strict=True
        ):
            np.testing.assert_allclose(ours, theirs, rtol=0, atol=digits)


def test_blocks_of_whole_lots_of_rows_give_the_bits_of_one_batch(rows):
    dtheta, dvel = rows
    steps, bias, epochs = np.full(COUNT, T), 1e-4 * np.arange(6.0), np.arange(0, COUNT + 1, 10)
    whole, state = np.empty((len(epochs), 10)), at_start()
    go_on(dtheta, dvel, steps, epochs, bias, state, whole)
    parts, again, first = np.empty_like(whole), at_start(), 0
    for stop in (ROWS, 3 * ROWS, COUNT):
        wanted = (epochs >= first) & (epochs < stop if stop < COUNT else epochs <= stop)
        out = np.empty((wanted.sum(), 10))
        go_on(dtheta[first:stop], dvel[first:stop], steps[first:stop], epochs[wanted] - first, bias, again, out)
        parts[wanted], first = out, stop
    np.testing.assert_array_equal(parts, whole)
    np.testing.assert_array_equal(again, state)


def _skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
