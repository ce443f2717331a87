"""The oracle of the filter tests: the joint Gaussian of all states and measurements, conditioned densely."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.helpers import changed
from truenorth.core.errors import DataError
from truenorth.filters import LinearSystem


def random_system(
    n=4, m=3, epochs=6, runs=(), seed=0, *, u=True, S=True, diagonal_R=False, missing=0.3, constant=False
) -> LinearSystem:
    """A full, stable-enough system without any structure; `constant`: all matrices have a time axis of length 1."""
    rng = np.random.default_rng(seed)
    K = 1 if constant else epochs
    noise = rng.standard_normal((*runs, K, n + m, n + m))
    joint = noise @ np.swapaxes(noise, -1, -2)
    R = joint[..., n:, n:]
    if diagonal_R:
        R = np.eye(m) * R
    z = 3.0 * rng.standard_normal((*runs, epochs, m))
    z[rng.random(z.shape) < missing] = np.nan
    if missing and epochs > 2:
        z[..., 2, :] = np.nan
    root = rng.standard_normal((*runs, n, n))
    return LinearSystem(
        Phi=np.eye(n) + 0.3 * rng.standard_normal((*runs, K, n, n)),
        Q=joint[..., :n, :n],
        H=rng.standard_normal((*runs, K, m, n)),
        R=R,
        z=z,
        x0=rng.standard_normal((*runs, n)),
        P0=root @ np.swapaxes(root, -1, -2),
        u=rng.standard_normal((*runs, K, n)) if u else None,
        S=joint[..., :n, n:] if S else None,
    )


@dataclass(frozen=True)
class Dense:
    """One run as a joint Gaussian: states stacked (K n), measurements stacked (K m)."""

    x: np.ndarray
    z: np.ndarray
    Pxx: np.ndarray
    Pxz: np.ndarray
    Pzz: np.ndarray
    measured: np.ndarray
    n: int
    m: int

    @classmethod
    def of(cls, system: LinearSystem) -> "Dense":
        n, m, K = system.states, system.rows, system.epochs

        def at(a, k):
            return a[k if len(a) > 1 else 0]

        # Everything is a linear map of the independent sources: initial state, then (w_k, v_k) for each epoch.
        sources = n + K * (n + m)
        cov = np.zeros((sources, sources))
        cov[:n, :n] = system.P0
        A, B = np.zeros((K * n, sources)), np.zeros((K * m, sources))
        mean_x, mean_z = np.zeros(K * n), np.zeros(K * m)
        T, mean = np.eye(n, sources), system.x0
        for k in range(K):
            w = slice(n + k * (n + m), 2 * n + k * (n + m))
            v = slice(w.stop, w.stop + m)
            cov[w, w], cov[v, v] = at(system.Q, k), at(system.R, k)
            if system.S is not None:
                cov[w, v] = at(system.S, k)
                cov[v, w] = at(system.S, k).T
            T = at(system.Phi, k) @ T
            T[:, w] += np.eye(n)
            mean = at(system.Phi, k) @ mean + (0 if system.u is None else at(system.u, k))
            A[k * n : (k + 1) * n] = T
            B[k * m : (k + 1) * m] = at(system.H, k) @ T
            B[k * m : (k + 1) * m, v] += np.eye(m)
            mean_x[k * n : (k + 1) * n] = mean
            mean_z[k * m : (k + 1) * m] = at(system.H, k) @ mean
        z = np.broadcast_to(system.z, (K, m)).ravel()
        return cls(mean_x, mean_z, A @ cov @ A.T, A @ cov @ B.T, B @ cov @ B.T, z, n, m)

    def state(self, epoch: int, until: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance of the state at `epoch`, given all measurements before epoch `until`."""
        s = slice(epoch * self.n, (epoch + 1) * self.n)
        have = self._have(until)
        gain = np.linalg.solve(self.Pzz[np.ix_(have, have)], self.Pxz[s][:, have].T).T
        x = self.x[s] + gain @ (self.measured[have] - self.z[have])
        return x, self.Pxx[s, s] - gain @ self.Pxz[s][:, have].T

    def innovation(self, epoch: int) -> tuple[np.ndarray, np.ndarray]:
        """Innovation and its covariance, all rows, given all measurements before `epoch`."""
        s = slice(epoch * self.m, (epoch + 1) * self.m)
        have = self._have(epoch)
        gain = np.linalg.solve(self.Pzz[np.ix_(have, have)], self.Pzz[s][:, have].T).T
        z = self.z[s] + gain @ (self.measured[have] - self.z[have])
        return self.measured[s] - z, self.Pzz[s, s] - gain @ self.Pzz[s][:, have].T

    def log_likelihood(self) -> float:
        have = self._have(len(self.measured))
        P, e = self.Pzz[np.ix_(have, have)], self.measured[have] - self.z[have]
        return float(-0.5 * (e @ np.linalg.solve(P, e) + np.linalg.slogdet(P)[1] + len(have) * np.log(2.0 * np.pi)))

    def _have(self, until: int) -> np.ndarray:
        rows = np.flatnonzero(np.isfinite(self.measured))
        return rows[rows < until * self.m]


def one_run(system: LinearSystem, index: tuple[int, ...]) -> LinearSystem:
    """One run of a system whose every array has all run axes."""
    values = {name: getattr(system, name) for name in LinearSystem.__dataclass_fields__}
    return LinearSystem(**{name: None if a is None else a[index] for name, a in values.items()})


def assert_infinite_is_named(system, name):
    """An infinite number in the last epoch of run 1 is refused by its name and place."""
    a = getattr(system, name)
    index = (1, *(n - 1 for n in a.shape[1:]))
    where = "run 1" if name in ("x0", "P0") else "epoch 4, run 1"
    with pytest.raises(DataError, match=rf"{type(system).__name__}: {name} is inf at {where}"):
        replace(system, **{name: changed(a, index, np.inf)})


def three_states(Q, H, R, z, x0=(0.5, -1.0, 2.0)) -> LinearSystem:
    """A chain of three states, the last of them known exactly."""
    return LinearSystem(
        Phi=np.array([[[1.0, 0.1, 0.0], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]]]),
        Q=np.asarray(Q, float)[None],
        H=np.asarray(H, float)[None],
        R=np.diag(R)[None],
        z=np.asarray(z, float),
        x0=np.asarray(x0, float),
        P0=np.diag([4.0, 1.0, 0.0]),
    )


def assert_is_joint(system, found, upto=None, **close):
    """States and covariances are those of the joint Gaussian given the rows up to each epoch; `upto`: up to that one."""
    dense = Dense.of(system)
    for k in range(len(found.x)):
        x, P = dense.state(k, k + 1 if upto is None else upto)
        assert_allclose(found.x[k], x, **close)
        assert_allclose(found.P[k], P, **close)
