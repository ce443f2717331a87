"""Runs on a CUDA device against the processor's and the joint Gaussian; by itself, it runs them in Numba's simulator."""

import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from numba import config
from numpy.testing import assert_allclose

from tests.filters.dense import assert_is_joint, one_run, random_system
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem, device, kalman, shared

NAMES = ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood")


def assert_alike(system, **options):
    """All that is kept is the same to 1e-10 of its largest."""
    there, here = kalman(system, device="cuda", **options), kalman(system, **options)
    for name in NAMES:
        a, b = getattr(there, name), getattr(here, name)
        assert_allclose(
            a, b, rtol=1e-10, atol=1e-10 * np.max(np.abs(b), initial=0.0, where=np.isfinite(b)), err_msg=name
        )
    return there


def different_systems():
    """Each run its own matrices, all noise correlated, rows absent: of the joint Gaussian."""
    system = random_system(3, 2, 4, (2,), seed=4)
    there = assert_alike(system, history="full")
    for run in range(2):
        found = replace(there, **{name: getattr(there, name)[run] for name in NAMES})
        assert_is_joint(one_run(system, (run,)), found, rtol=1e-9, atol=1e-9)


def plain_form_and_chunks():
    """Noise of rows by itself, what is constant given once; a batch is its chunks."""
    system = random_system(4, 2, 3, (2,), seed=5, S=False, diagonal_R=True, constant=True)
    whole = assert_alike(system, joseph=False, workers=2)
    begun = kalman(system.between(0, 2), device="cuda", joseph=False)
    rest = kalman(system.between(2, 3), begun.state, device="cuda", joseph=False)
    assert_allclose(rest.x, whole.x, rtol=1e-13)
    assert_allclose(rest.log_likelihood, whole.log_likelihood, rtol=1e-13)


def shared_covariance():
    """Runs that share all but measurements and initial states, more than a block of threads."""
    system = random_system(3, 2, 4, seed=6, S=False, diagonal_R=True)
    rng = np.random.default_rng(0)
    count = device.THREADS + 1
    many = replace(system, z=system.z + rng.standard_normal((count, 4, 2)), x0=rng.standard_normal((count, 3)))
    assert_alike(many, history="full")


def two_runs(P0, H, R, S=None):
    """Two states at rest, seen once."""
    still = {"Phi": np.eye(2)[None], "Q": np.zeros((1, 2, 2)), "z": np.ones((2, 1, len(H))), "x0": np.zeros(2)}
    return LinearSystem(**still, P0=P0 * np.eye(2), H=np.array([H]), R=np.diag(R)[None], S=S)


def rounding():
    """A row without noise leaves its state known; Joseph's form keeps what the plain one loses."""
    rows = [[1.0, 0.0], [0.0, 1.0]]
    assert_alike(two_runs(1.0, rows, [0.0, 1.0]))
    unknown = two_runs(2.7e14, rows, [1.3, 2.1])
    assert_alike(unknown)
    assert_breaks_down(unknown, joseph=False)
    assert_breaks_down(two_runs(1e30, [[1.0, 1.0], [1.0, 1.0]], [1e-12, 1e-12]))


def noise_that_does_not_fit():
    """S that cannot be of these Q and R: a variance below zero after the row, or of the innovation."""
    for of_both, R in ((0.5, 0.1), (-1.0, 0.5)):
        assert_breaks_down(two_runs(1.0, [[1.0, 0.0]], [R], np.array([[[of_both], [0.0]]])))


def assert_breaks_down(system, **options):
    with pytest.raises(DataError) as there:
        kalman(system, device="cuda", **options)
    with pytest.raises(DataError) as here:
        kalman(system, **options)
    assert str(there.value) == str(here.value)


def too_large():
    system = random_system(60, 2, 1, (2,))
    with pytest.raises(UsageError, match="60 states and 2 rows are too many"):
        kalman(system, device="cuda")
    assert kalman(system, device="auto").x.shape == (2, 1, 60)


class Allocations(dict):
    """The arrays that a simulated block shares, one thread at a time.

    The simulator's own let two threads that ask at once have an array each: once in some hundred runs half of a filter was lost.
    """

    def __init__(self):
        super().__init__()
        self.lock = threading.Lock()

    def get(self, key):
        """Who finds none makes it, and the others wait."""
        self.lock.acquire()
        found = super().get(key)
        if found is not None:
            self.lock.release()
        return found

    def __setitem__(self, key, value):
        super().__setitem__(key, value)
        self.lock.release()


def share_one_array(monkeypatch):
    from numba.cuda.simulator.kernelapi import FakeCUDAShared

    begin = FakeCUDAShared.__init__

    def with_a_lock(self, size):
        begin(self, size)
        self._allocations = Allocations()

    monkeypatch.setattr(FakeCUDAShared, "__init__", with_a_lock)


def check(monkeypatch):
    monkeypatch.setattr(shared, "WORTH", 0)
    if config.ENABLE_CUDASIM:  # each thread is one of Python's there
        share_one_array(monkeypatch)
        monkeypatch.setattr(device, "WARP", 2)
        monkeypatch.setattr(device, "THREADS", 2)
        sys.setswitchinterval(1e-5)  # they wait for one another
    different_systems()
    plain_form_and_chunks()
    shared_covariance()
    rounding()
    noise_that_does_not_fit()
    too_large()


if __name__ == "__main__":
    with pytest.MonkeyPatch.context() as patch:
        check(patch)
    print("as on the processor")
