"""Windowed least squares: attitude and biases from the mean velocities of a whole log, tapered at both ends.

Sway is bounded, but not white: a plain least-squares fit takes what is left of an unfinished period for tilt. With a window
that goes to zero at both ends a tone of several periods leaves next to nothing. Nothing has to be known of the sway.

The weights of the sequential form are ``(t/T)^2 (1 - t/T)^2``: powers of t, so that three running sums give the answer at every T;
Hann's window has no such form, and serves a log as a whole.

Source of the windows' sidelobes: F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier
transform, Proc. IEEE 66 (1), 1978.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import LinearSystem

Array = NDArray[np.float64]

BASE_VELOCITY = 1e-3  # m/s: what the window leaves of the motion; only weighs the data against the biases' prior


class WindowedFit(NamedTuple):
    """Least-squares states."""

    x0: Array  # (n,): before the first epoch
    x: Array  # (n,): at the last epoch
    residual: Array  # (K, m): what the fit leaves of z
    response: Array  # (K, m, n): ``z_k`` for a unit of each state before the first epoch


def hann(count: int) -> Array:
    """(count,) Hann's window at the middles of so many intervals."""
    w: Array = np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2
    return w


def windowed_fit(system: LinearSystem, base_velocity: float = BASE_VELOCITY) -> WindowedFit:
    """Fit the states of a system without process noise, Hann-weighted, with its prior.

    Parameters
    ----------
    system : LinearSystem
        Its Q, R and S are not used.
    base_velocity : float, m/s
    """
    A, Phi = response(system)
    weight = hann(len(A)) / base_velocity**2
    z = system.z - A @ system.x0
    N, y = np.einsum("k,kmi,kmj->ij", weight, A, A), np.einsum("k,kmi,km->i", weight, A, z)
    x0 = system.x0 + _solve(N, y, system.P0)
    return WindowedFit(x0, Phi @ x0, system.z - A @ x0, A)


def sequential_fit(system: LinearSystem, base_velocity: float = BASE_VELOCITY) -> Array:
    """The states before the first epoch as known at each epoch, (K, n), weighted by ``(t/T)^2 (1 - t/T)^2``.

    Parameters
    ----------
    system, base_velocity
        As in :func:`windowed_fit`.
    """
    A, _ = response(system)
    t = np.arange(len(A)) + 0.5
    z = system.z - A @ system.x0
    products, sums = A.swapaxes(1, 2) @ A, np.einsum("kmi,km->ki", A, z)
    N = [np.cumsum(t[:, None, None] ** p * products, axis=0) for p in (2, 3, 4)]
    y = [np.cumsum(t[:, None] ** p * sums, axis=0) for p in (2, 3, 4)]
    out = np.empty((len(A), A.shape[2]))
    for k in range(len(A)):
        T = k + 1.0
        # 16 t^2 (T - t)^2 / T^4 = 16 (t^2 / T^2 - 2 t^3 / T^3 + t^4 / T^4)
        share = 16.0 / base_velocity**2 * np.array([T**-2, -2.0 * T**-3, T**-4])
        normal = sum(s * item[k] for s, item in zip(share, N, strict=True))
        out[k] = _solve(np.asarray(normal), np.asarray(sum(s * x[k] for s, x in zip(share, y, strict=True))), system.P0)
    return out + system.x0


def response(system: LinearSystem) -> tuple[Array, Array]:
    """How the states before the first epoch show in each measurement, (K, m, n), and at the last epoch, (n, n)."""
    K, m, n = system.H.shape
    A, Phi = np.empty((K, m, n)), np.eye(n)
    for k in range(K):
        Phi = system.Phi[k] @ Phi
        A[k] = system.H[k] @ Phi
    return A, Phi


def _solve(N: Array, y: Array, P0: Array) -> Array:
    """``(N + P0^-1)^-1 y``, scaled by the prior, which may be singular."""
    s = np.sqrt(np.diag(P0))
    scale = np.where(s > 0, s, 1.0)
    P = P0 / np.outer(scale, scale)
    # (N + P^-1)^-1 = P (I + N P)^-1
    x: Array = scale * (P @ np.linalg.solve(np.eye(len(P)) + (scale[:, None] * N * scale) @ P, scale * y))
    return x
