"""Kernels with vectors by name give the bits of a loop over numbers, in matrices of every padded size."""

import numpy as np
import pytest

from truenorth.core import linalg
from truenorth.core.compiled import compiled
from truenorth.core.vectors import load3, plus4, store3


@compiled
def _propagated(size, Phi, Phi_t, Q, P, work):
    linalg.transpose(size, Phi, Phi_t)
    linalg.propagate_covariance(size, Phi, Phi_t, Q, P, work)


@compiled
def _conditioned(size, P, h, a, b, y):
    linalg.divide(size, a, 3.0, b)
    linalg.add_times(size, b, h, 0.7)
    linalg.add_difference(size, b, a, h, 0.3)
    linalg.take_off_and_see(size, P, a, 0.1, h, y)
    linalg.take_off_pair(size, P, y, b)
    linalg.transposed_times(size, P, b, h)


@compiled
def _copied(A, B, rows, columns):
    linalg.copy_corner(A, B, rows, columns)


@compiled
def _doubled(A, B):
    for k in range(len(A)):
        row = load3(A, (k, 0))
        store3(B, (k, 0), plus4(row, row))


def _product(A, B):
    """Row by row, each sum from the first term to the last."""
    C = np.zeros((len(A), B.shape[1]))
    for k in range(len(B)):
        C = C + A[:, k, None] * B[k]
    return C


@pytest.mark.parametrize("n", [3, 12, 15])
def test_a_covariance_is_propagated_to_the_bits_of_a_loop(n):
    rng, size = np.random.default_rng(n), linalg.padded(n)
    N = len(size)
    Phi, Q, P = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    Phi[:n, :n] = rng.standard_normal((n, n))
    for M in (Q, P):
        M[:n, :n] = np.eye(n) + 0.1 * np.ones((n, n)) * rng.standard_normal()
    expected = _product(_product(Phi, P), Phi.T) + Q
    lower = np.tril(expected)
    Phi_t = np.empty((N, N))
    _propagated(size, Phi, Phi_t, Q, P, np.zeros((N, N)))
    assert np.array_equal(Phi_t, Phi.T)
    assert np.array_equal(P, lower + np.tril(expected, -1).T)


def test_a_row_takes_off_what_a_loop_takes_off():
    rng, N = np.random.default_rng(1), 12
    P = rng.standard_normal((N, N))
    P = P + P.T
    h, a = rng.standard_normal(N), rng.standard_normal(N)
    b = a / 3.0 + 0.7 * h
    b = b + (a - 0.3 * h)
    left = P - 0.1 * np.outer(a, a)
    y = _product(h[None], left)[0]
    both = left - 0.5 * (np.outer(y, b) + np.outer(b, y))
    seen = _product(b[None], both)[0]
    found, found_b, found_y, found_h = P.copy(), np.zeros(N), np.zeros(N), h.copy()
    _conditioned(linalg.padded(N), found, found_h, a.copy(), found_b, found_y)
    for one, other in ((found_b, b), (found_y, y), (found, both), (found_h, seen)):
        assert np.array_equal(one, other)


@pytest.mark.parametrize("columns", [2, 8, 11, 16])
def test_a_corner_is_copied_and_nothing_behind_it(columns):
    A, B = np.arange(256.0).reshape(16, 16), np.full((16, 17), -1.0)
    _copied(A, B, 5, columns)
    assert np.array_equal(B[:5, :columns], A[:5, :columns])
    assert np.all(B[5:] == -1.0)
    assert np.all(B[:, columns:] == -1.0)


def test_a_row_of_three_is_read_and_written_alone():
    """Neither the rest of its array nor what stands behind the last row of it is touched."""
    A, B = np.arange(21.0).reshape(7, 3), np.full((8, 3), -1.0)
    _doubled(A, B[:7])
    assert np.array_equal(B[:7], 2.0 * A)
    assert np.all(B[7] == -1.0)
    _doubled(A[:3], A[:3])
    assert np.array_equal(A[:4], [[0.0, 2.0, 4.0], [6.0, 8.0, 10.0], [12.0, 14.0, 16.0], [9.0, 10.0, 11.0]])


def test_vectors_do_not_stand_in_arrays_with_gaps():
    numba = pytest.importorskip("numba")
    with pytest.raises(numba.TypingError, match="contiguous"):
        _copied(np.zeros((16, 16))[:, ::2], np.zeros((16, 16)), 5, 8)


def test_a_vector_from_the_disk_is_of_the_type_of_this_process():
    """Of another type, an inner kernel that takes or gives vectors is refused by what is compiled anew and calls it."""
    import pickle
    import subprocess
    import sys

    from truenorth.core.vectors import _vector

    program = "from numba.core.serialize import dumps\nfrom truenorth.core.vectors import _vector\nprint(dumps(_vector(8)).hex())"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert pickle.loads(bytes.fromhex(said)) is _vector(8)
