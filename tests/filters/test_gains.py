"""Gains of a base at rest, whose sizes are written in a kernel of its own."""

import numpy as np

from truenorth.filters import LinearSystem, filter_gains, gains, kalman

K, (N, M) = 9, gains.AT_REST


def test_sizes_written_in_the_kernel_change_no_bit(monkeypatch):
    rng = np.random.default_rng(3)
    Phi = np.eye(N) + 0.1 * rng.standard_normal((K, N, N))
    H, S = rng.standard_normal((K, M, N)), 0.01 * rng.standard_normal((K, N, M))
    z = rng.standard_normal((K, M))
    z[4, 1] = np.nan
    Q, R = np.tile(0.1 * np.eye(N), (K, 1, 1)), np.tile(np.eye(M), (K, 1, 1))
    system = LinearSystem(Phi, Q, H, R, z, np.zeros(N), np.eye(N), S=S)
    estimates = kalman(system, history="full")
    P0 = np.diag(np.r_[np.zeros(N - gains.BIASES), np.ones(gains.BIASES)])
    own = filter_gains(system, estimates)
    parts = gains.initial_part(own.step, P0, slice(0, gains.AXES))
    monkeypatch.setattr(gains, "AT_REST", (0, 0))
    others = filter_gains(system, estimates)
    for a, b in zip(own, others, strict=True):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(parts, gains.initial_part(own.step, P0, slice(0, gains.AXES)), strict=True):
        np.testing.assert_array_equal(a, b)
