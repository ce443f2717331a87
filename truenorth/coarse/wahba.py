"""Wahba's problem: the rotation between two frames from vectors seen in both.

Sources: H. Black, "A passive system for determining the attitude of a satellite", AIAA J. 2 (1964) (TRIAD);
P. Davenport's q-method, in M. Shuster and S. Oh, "Three-axis attitude determination from vector observations",
J. Guid. Control 4 (1981), eqs. 9-14 (TRIAD) and 37-47 (q-method).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, skew

Array = NDArray[np.float64]


def triad(b1: Array, b2: Array, r1: Array, r2: Array) -> Array:
    """Rotation ``C`` with ``r1 ~ C b1`` exactly in direction, and ``r2`` in the plane of ``C b1, C b2``.

    Parameters
    ----------
    b1, b2 : (3,) arrays
        Two vectors in the first frame; the first one is trusted.
    r1, r2 : (3,) arrays
        The same vectors in the second frame.

    Returns
    -------
    (3, 3) array
        Orthonormal by construction.
    """
    return _triad_axes(r1, r2) @ _triad_axes(b1, b2).T


def _triad_axes(first: Array, second: Array) -> Array:
    x = first / np.linalg.norm(first)
    y = np.cross(first, second)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def davenport_matrices(b: Array, r: Array, weights: Array) -> Array:
    """One K matrix a pair, (J, 4, 4), for quaternions (w, x, y, z) of ``C`` with ``r = C b``; their sum is Davenport's.

    ``w_j |r_j - C b_j|^2 = w_j (|r_j|^2 + |b_j|^2) - 2 q' K_j q``.
    """
    return davenport_of(weights[:, None, None] * r[:, :, None] * b[:, None, :])


def davenport_of(B: Array) -> Array:
    """K matrices (..., 4, 4) of ``B = sum w_j r_j b_j'`` (..., 3, 3), in which they are linear."""
    trace = np.trace(B, axis1=-2, axis2=-1)
    K = np.empty((*B.shape[:-2], 4, 4))
    K[..., 0, 0] = trace
    z = np.stack([B[..., 2, 1] - B[..., 1, 2], B[..., 0, 2] - B[..., 2, 0], B[..., 1, 0] - B[..., 0, 1]], -1)
    K[..., 0, 1:] = z
    K[..., 1:, 0] = z
    K[..., 1:, 1:] = B + np.swapaxes(B, -1, -2) - trace[..., None, None] * np.eye(3)
    return K


def q_method(b: Array, r: Array, weights: Array | None = None) -> Array:
    """Rotation that minimises ``sum w_j |r_j - C b_j|^2`` (Davenport).

    Parameters
    ----------
    b, r : (J, 3) arrays
        The vectors in the first and in the second frame.
    weights : (J,) array, optional

    Returns
    -------
    (3, 3) array
    """
    weighted = r if weights is None else r * np.asarray(weights, dtype=np.float64)[:, None]
    return rotation_from_davenport(davenport_of(weighted.T @ b))


def rotation_from_davenport(K: Array) -> Array:
    """Rotation(s) of the largest eigenvalue of one or of a stack of K matrices, (..., 3, 3)."""
    _, vectors = np.linalg.eigh(K)
    return dcm_from_quaternion(vectors[..., :, -1])


def error_gain(r: Array, weights: Array) -> Array:
    """How errors of the observed vectors become misalignment: (J, 3, 3) with ``phi = sum G_j delta_j``.

    Of ``C_hat = (I - [phi x]) C`` and ``C b_j = r_j + delta_j`` the cost ``sum w_j |delta_j + r_j x phi|^2`` is
    minimal at ``phi = M^-1 sum w_j r_j x delta_j``, ``M = sum w_j (|r_j|^2 I - r_j r_j')``.
    """
    rx = skew(r)
    M = -np.einsum("j,jab,jbc->ac", weights, rx, rx)
    return np.einsum("ab,j,jbc->jac", np.linalg.inv(M), weights, rx)
