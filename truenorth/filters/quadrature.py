"""Quadrature rules for expectations under the standard normal distribution: nodes and weights, of any dimension.

``E f(x) = sum_i w_i f(xi_i)`` for ``x ~ N(0, I)``. All rules are exact for the moments that a filter's regression
stands on: weights sum to 1, ``sum w xi = 0`` and ``sum w xi xi' = I``, with either set of weights.

Sources: K. Ito, K. Xiong, Gaussian filters for nonlinear filtering problems, IEEE Trans. Autom. Control 45, 2000
(Gauss-Hermite); I. Arasaratnam, S. Haykin, Cubature Kalman filters, IEEE Trans. Autom. Control 54, 2009; E. A. Wan, R. van
der Merwe, The unscented Kalman filter for nonlinear estimation, 2000 (alpha, beta, kappa).
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.filters.stack import Array

MOST_NODES = 100_000


class QuadratureRule(NamedTuple):
    """Nodes and weights; the first node is the one nearest to the mean."""

    nodes: Array  # (M, d)
    mean: Array  # (M,): weights of expectations
    covariance: Array  # (M,): weights of second moments about the mean; differ from `mean` in the unscented rule only


@cache
def gauss_hermite_rule(dimensions: int, order: int) -> QuadratureRule:
    """Tensor product of Gauss and Hermite's rule: ``order**dimensions`` nodes.

    Exact for products of polynomials of degree ``2 order - 1`` in each variable.

    Parameters
    ----------
    order : int
        Nodes along each axis, at least 2; with 1 there would be no second moment.

    Raises
    ------
    UsageError
        An order below 2, or more than 100,000 nodes.
    """
    _check_dimensions(dimensions)
    if order < 2:
        raise UsageError(f"order is {order}, expected at least 2 nodes along each axis")
    if order**dimensions > MOST_NODES:
        raise UsageError(
            f"order {order} in {dimensions} dimensions makes {order**dimensions} nodes, more than {MOST_NODES}: take a "
            "lower order, the cubature rule, or name the states in which the model is nonlinear (nonlinear=...)"
        )
    x, w = np.polynomial.hermite_e.hermegauss(order)
    w = w / w.sum()
    nodes = np.stack(np.meshgrid(*[x] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions)
    weights = np.prod(np.stack(np.meshgrid(*[w] * dimensions, indexing="ij"), axis=-1).reshape(-1, dimensions), axis=-1)
    return _rule(nodes, weights, weights)


def cubature_rule(dimensions: int) -> QuadratureRule:
    """Third-degree spherical-radial rule: ``2 dimensions`` nodes of equal weight, sqrt(d) along each axis."""
    _check_dimensions(dimensions)
    nodes = np.sqrt(dimensions) * np.concatenate([np.eye(dimensions), -np.eye(dimensions)])
    weights = np.full(2 * dimensions, 0.5 / dimensions)
    return _rule(nodes, weights, weights)


def unscented_rule(dimensions: int, *, alpha: float, beta: float, kappa: float) -> QuadratureRule:
    """Scaled unscented transform: the mean and ``2 dimensions`` nodes.

    Parameters
    ----------
    alpha : float
        Spread of the nodes, which stand at ``alpha sqrt(d + kappa)``. Small values lose digits: about 1e-16 / alpha^2
        of a mean is rounding.
    beta : float
        Extra weight of the mean's deviation in second moments; 2 is best for normal distributions.
    kappa : float
        With alpha = 1, kappa = 3 - d matches the fourth moment, and makes the mean's weight negative for d > 3.

    Raises
    ------
    UsageError
        ``alpha`` not positive, or ``d + kappa`` not positive.
    """
    _check_dimensions(dimensions)
    if not 0.0 < alpha <= 1.0:
        raise UsageError(f"alpha is {alpha}, expected a number above 0 and at most 1")
    if not dimensions + kappa > 0.0 or not np.isfinite(kappa):
        raise UsageError(f"kappa is {kappa}, expected a number above minus the number of states, {-dimensions}")
    if not np.isfinite(beta):
        raise UsageError(f"beta is {beta}, expected a finite number")
    square = alpha**2 * (dimensions + kappa)
    axes = np.eye(dimensions)
    nodes = np.sqrt(square) * np.concatenate([np.zeros((1, dimensions)), axes, -axes])
    mean = np.full(2 * dimensions + 1, 0.5 / square)
    mean[0] = 1.0 - dimensions / square
    covariance = mean.copy()
    covariance[0] += 1.0 - alpha**2 + beta
    return _rule(nodes, mean, covariance)


def _check_dimensions(dimensions: int) -> None:
    if dimensions < 1:
        raise UsageError(f"dimensions is {dimensions}, expected at least 1")


def _rule(nodes: Array, mean: Array, covariance: Array) -> QuadratureRule:
    nearest = np.argsort(np.sum(nodes**2, axis=1), kind="stable")
    return QuadratureRule(nodes[nearest], mean[nearest], covariance[nearest])
