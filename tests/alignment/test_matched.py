"""Signatures matched from the last epoch back: against each one sent through the filter by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.alignment import matched as module
from truenorth.alignment.matched import Innovations, Signatures, innovations_of, matched, matched_whole
from truenorth.alignment.summed_back import AT_REST
from truenorth.errors.staying import PHI
from truenorth.filters import LinearSystem, filter_gains, kalman

K, N, M = 12, 12, 3


def forward(system, gains, signatures, U, A, s):
    """Innovations (K, m) that a signature makes, and the error (n,) that it leaves."""
    e, seen = np.zeros(N), np.zeros((K, M))
    for k in range(signatures.epoch[s], K):
        begins = k == signatures.epoch[s]
        u = signatures.state[:, s] if begins else U @ signatures.after[:, s]
        a = signatures.measured[:, s] if begins else A[k] @ signatures.after[:, s]
        seen[k] = system.H[k] @ system.Phi[k] @ (e + u) + a
        e = gains.step[k] @ (e + u) - gains.gain[k] @ a
    return seen, e


@pytest.mark.parametrize("other", [0, 2])
@pytest.mark.parametrize("W", [5, AT_REST[2] - N])
def test_as_forward(other, W):
    rng = np.random.default_rng(4)
    Phi = np.eye(N) + 0.1 * rng.standard_normal((K, N, N))
    H, S = rng.standard_normal((K, M, N)), 0.01 * rng.standard_normal((K, N, M))
    Q, R = np.tile(0.1 * np.eye(N), (K, 1, 1)), np.tile(np.eye(M), (K, 1, 1))
    system = LinearSystem(Phi, Q, H, R, rng.standard_normal((K, M)), np.zeros(N), np.eye(N), S=S)
    estimates = kalman(system, history="full")
    fine = SimpleNamespace(system=system, estimates=estimates, gains=filter_gains(system, estimates))
    epochs = np.array([0, 3, 3, 7, K - 1])
    count = len(epochs)
    shapes = ((N, count), (M, count), (W, count), (N, W), (K, M, W))
    signatures, more = (Signatures(epochs, *(rng.standard_normal(shape) for shape in shapes)) for _ in range(2))
    U, A = signatures.state_course, signatures.measured_course
    others = rng.standard_normal((K, M, other)) if other else None
    seen = innovations_of(fine, others)
    ratio, size, left = (match := matched(seen, signatures)[0])
    for together, alone in zip(matched(seen, more, signatures), (matched(seen, more)[0], match), strict=True):
        np.testing.assert_array_equal(np.vstack([*together]), np.vstack([*alone]))

    L = np.linalg.cholesky(estimates.innovation_covariance)
    white = np.linalg.solve(L, estimates.innovation[..., None]).ravel()
    known = np.zeros((K * M, 0))
    if other:  # errors of the measurement at every epoch: what the filter makes of them
        columns = []
        for j in range(other):
            e, seen = np.zeros(N), np.zeros((K, M))
            for k in range(K):
                seen[k] = H[k] @ Phi[k] @ e + others[k, :, j]
                e = fine.gains.step[k] @ e - fine.gains.gain[k] @ others[k, :, j]
            columns.append(np.linalg.solve(L, seen[..., None]).ravel())
        known = np.stack(columns, axis=1)
    # With others of one sigma in it the covariance of the white innovations is I + known known'.
    information = np.linalg.inv(np.eye(K * M) + known @ known.T)
    for s in range(count):
        seen, e = forward(system, fine.gains, signatures, U, A, s)
        y = np.linalg.solve(L, seen[..., None]).ravel()
        energy, match = y @ information @ y, y @ information @ white
        np.testing.assert_allclose([ratio[s], size[s]], [match**2 / energy, match / energy], rtol=1e-10)
        np.testing.assert_allclose(left[:, s], e[PHI], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("other", [0, 2])
def test_what_begins_with_the_log_followed_forward(other):
    """The same figures as of the sums; and of a course that a state takes up but for one part in 1e5."""
    rng = np.random.default_rng(8)
    Phi, H = np.tile(np.eye(N), (K, 1, 1)), np.tile(np.eye(M, N), (K, 1, 1))
    Q, R = np.zeros((K, N, N)), np.tile(np.eye(M), (K, 1, 1))
    system = LinearSystem(Phi, Q, H, R, rng.standard_normal((K, M)), np.zeros(N), 1e14 * np.eye(N))
    estimates = kalman(system, history="full")
    fine = SimpleNamespace(system=system, estimates=estimates, gains=filter_gains(system, estimates))
    seen = innovations_of(fine, 1e-3 * rng.standard_normal((K, M, other)) if other else None)
    course = rng.standard_normal((K, M, 1))
    none, one = np.zeros((N, 1)), np.ones((1, 1))
    bank = Signatures(np.zeros(1, dtype=np.int64), none, course[0], one, none, course)
    whole = matched_whole(seen, bank)
    for together, alone in zip(matched(seen, bank)[0], whole, strict=True):
        np.testing.assert_allclose(together, alone, rtol=1e-5, atol=1e-9)
    apart = course + 1e5  # a constant is a state
    large = matched_whole(seen, bank._replace(measured=apart[0], measured_course=apart))
    np.testing.assert_allclose([large.ratio, large.size], [whole.ratio, whole.size], rtol=1e-3)


def test_sizes_written_in_the_kernel_change_no_bit(monkeypatch):
    """A base at rest has a kernel of its own; given its sizes as it runs, the other one gives the same."""
    rng, W = np.random.default_rng(5), AT_REST[2] - N
    gains = SimpleNamespace(
        step=0.3 * rng.standard_normal((K, N, N)),
        H_Phi=rng.standard_normal((K, M, N)),
        gain=rng.standard_normal((K, N, M)),
    )
    L = np.tril(rng.standard_normal((K, M, M))) + 3.0 * np.eye(M)
    seen = Innovations(L, gains, rng.standard_normal((K, M, 1)))
    shapes = ((N, 3), (M, 3), (W, 3), (N, W), (K, M, W))
    signatures = Signatures(np.array([0, 4, K - 2]), *(rng.standard_normal(shape) for shape in shapes))
    own = matched(seen, signatures)[0]
    monkeypatch.setattr(module, "AT_REST", None)
    np.testing.assert_array_equal(np.vstack([*own]), np.vstack([*matched(seen, signatures)[0]]))
