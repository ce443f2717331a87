"""What is known of the errors at the start: the covariance of the states, made here and nowhere else, and how biases come apart."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.state.layout import BA, BG, DP, DV, PHI, STATES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WholeBiases:
    """How to take apart the biases of a start into their constant and their slow part."""

    # (6,): variance a priori of what is constant of the gyro and accelerometer biases, (rad/s)^2 and (m/s^2)^2
    constant: Array
    averaged: float = 0.0  # s; they are means over the time before the start; 0: they hold at the start


def prior_covariance(
    phi: ArrayLike = 0.0, dv: ArrayLike = 0.0, dp: ArrayLike = 0.0, bias_variance: ArrayLike = 0.0, *others: float
) -> Array:
    """(15 + m, 15 + m) covariance at the start of uncorrelated errors.

    Parameters
    ----------
    phi, dv, dp : one or (3,) sigmas, rad, m/s, m
    bias_variance : one or (6,) variances, (rad/s)^2 and (m/s^2)^2
        Of the biases, as a specification has them: :attr:`truenorth.records.specs.ImuSpec.bias_variance`.
    *others : m floats
        Sigmas of the states behind the fifteen.
    """
    variance = np.zeros(STATES + len(others))
    for part, sigma in ((PHI, phi), (DV, dv), (DP, dp), (slice(STATES, None), others)):
        variance[part] = np.square(sigma)
    variance[BG.start : BA.stop] = bias_variance
    return np.diag(variance)


def joined(*blocks: ArrayLike) -> Array:
    """(n, n) covariance of uncorrelated groups of states, in order.

    Parameters
    ----------
    *blocks : (m, m) covariances, or (m,) sigmas
    """
    given = [np.asarray(block, dtype=np.float64) for block in blocks]
    edges = [0, *accumulate(map(len, given))]
    n = edges[-1]
    P = np.zeros((n, n))
    diagonal = P.reshape(-1)[:: n + 1]
    for first, last, block in zip(edges, edges[1:], given):
        if block.ndim == 1:
            diagonal[first:last] = block**2
        else:
            P[first:last, first:last] = block
    return P


def positive(P: Array) -> Array:
    """The nearest correlation structure without negative eigenvalues; variances stay as they are or grow by rounding."""
    sigma = np.sqrt(np.maximum(np.diag(P), 1e-300))
    values, vectors = np.linalg.eigh(P / np.outer(sigma, sigma))
    if values[0] >= 1e-9:
        return P
    raised = (vectors * np.maximum(values, 1e-9)) @ vectors.T
    return np.asarray(raised * np.outer(sigma, sigma), dtype=np.float64)
