"""Wahba's problem against SciPy's solution of it, and the propagation of errors against finite differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from truenorth.coarse.wahba import davenport_matrices, error_gain, q_method, rotation_from_davenport, triad

seeds = st.integers(0, 2**32 - 1)


def _pairs(seed: int, count: int = 12, noise: float = 0.05):
    rng = np.random.default_rng(seed)
    C = Rotation.random(random_state=seed % 2**31).as_matrix()
    b = rng.standard_normal((count, 3))
    r = b @ C.T + noise * rng.standard_normal((count, 3))
    return C, b, r, rng.uniform(0.1, 2.0, count)


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_q_method_is_scipys_align_vectors(seed):
    _, b, r, w = _pairs(seed)
    oracle, _ = Rotation.align_vectors(r, b, weights=w)
    apart = Rotation.from_matrix(q_method(b, r, w)) * oracle.inv()
    assert apart.magnitude() < 1e-10


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_triad_trusts_its_first_vector(seed):
    C, b, _, _ = _pairs(seed, 2)
    r = b @ C.T
    np.testing.assert_allclose(triad(b[0], b[1], r[0], r[1]), C, atol=1e-9)
    # SciPy's limit of an infinite first weight is TRIAD.
    r2 = r[1] + 0.1
    oracle, _ = Rotation.align_vectors([r[0], r2], b, weights=[np.inf, 1.0])
    np.testing.assert_allclose(triad(b[0], b[1], r[0], r2), oracle.as_matrix(), atol=1e-9)


def test_running_sums_give_every_prefix():
    _, b, r, w = _pairs(7)
    running = rotation_from_davenport(np.cumsum(davenport_matrices(b, r, w), axis=0))
    for count in (3, 8, 12):
        np.testing.assert_allclose(running[count - 1], q_method(b[:count], r[:count], w[:count]), atol=1e-12)


@pytest.mark.parametrize("method", ["q_method", "triad"])
def test_error_gain_is_the_derivative(method):
    """phi of C_hat = (I - [phi x]) C for a small change of each component of each observed vector."""
    from truenorth.coarse.inertial import _triad_gain

    C, b, _, w = _pairs(11, 2 if method == "triad" else 6, 0.0)
    r = b @ C.T

    def estimate(vectors):
        return triad(vectors[0], vectors[1], r[0], r[1]) if method == "triad" else q_method(vectors, r, w)

    gain = _triad_gain(r[0], r[1]) if method == "triad" else error_gain(r, w)
    step = 1e-6
    for j in range(len(b)):
        for axis in range(3):
            moved = b.copy()
            moved[j] += step * C.T[:, axis]  # delta_j = C (b_moved - b) = step along n's axis
            error = estimate(moved) @ C.T  # I - [phi x]
            phi = np.array([error[1, 2], error[2, 0], error[0, 1]]) / step
            np.testing.assert_allclose(phi, gain[j][:, axis], atol=1e-5)
