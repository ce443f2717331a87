"""From a nonlinear model to a linear one that a Kalman filter can take: by tangents, or by regression over nodes.

*Tangent* (extended filters): ``Phi = df/dx``, ``H = dh/dx`` at the estimate.

*Statistical linear regression* (all filters with nodes). With ``P = S S'`` and nodes ``x_i = x + S xi_i``, the
measurement is ``h(x_i) = z_bar + C' xi_i + r_i``, ``C = sum w xi (h - z_bar)'``. What the linear part leaves, r, is
noise of covariance ``Omega = sum w r r'``, uncorrelated with x. Thus ``H = C' S^-1`` and ``R + Omega`` give the
moments that the rule finds, ``H P = C' S'`` and ``H P H' + Omega = sum w (h - z_bar)(h - z_bar)'``, in a form whose
rounding is harmless: for a linear model r vanishes, and no large numbers are subtracted.

*Conditionally linear models*, ``f(x) = F(u) x + g(u)`` with few nonlinear states u (the first in the Cholesky
ordering): nodes in u only, ``P = S_u S_u' + rest``. Given u, the other states are normal with covariance `rest`, and
their part of all moments is in closed form, from the Jacobians ``F_i`` at the nodes:
``sum w F_i rest F_i' = F_bar rest F_bar' + sum w E_i rest E_i'``, where ``E_i = F_i - F_bar`` has few rows.
The rule in all states is the case without `rest`.

Sources: T. Lefebvre, H. Bruyninckx, J. De Schutter, Comment on "A new method for the nonlinear transformation of means
and covariances in filters and estimators", IEEE Trans. Autom. Control 47, 2002 (regression); F. Beutler, M. F. Huber,
U. D. Hanebeck, Gaussian filtering using state decomposition methods, 2009 (conditionally linear).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.linalg import (
    Array,
    Size,
    load,
    mirror,
    propagate_covariance,
    take_off,
    transpose,
)
from truenorth.filters.nonlinear_system import Functions, NonlinearRuns
from truenorth.filters.quadrature import QuadratureRule
from truenorth.filters.recursion import Workspace
from truenorth.filters.stack import NEGATIVE

NO_RULE = QuadratureRule(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
SEMIDEFINITE = 1e-14  # of a variance: what is left of it after the states before is rounding


class Points(NamedTuple):
    """Nodes and their images: M nodes in d of n states, m rows; vectors of the model have its own lengths."""

    X: Array  # (s,) estimate
    x: Array  # (s,) a node, or the image of the estimate
    y: Array  # (s,)
    p: Array  # (q,)
    h: Array  # (m,)
    z_mean: Array  # (m,)
    S: Array  # (d, N) columns of the Cholesky factor
    rest: Array  # (N, N) covariance of the linear states given the nonlinear ones
    spread: Array  # (N, N)
    Y: Array  # (M, N) images of nodes, their deviations, what regression leaves of them
    Z: Array  # (M, m)
    A: Array  # (d, N) regression of the images on the nodes
    C: Array  # (d, m)
    J: Array  # (M, n, n) Jacobians at the nodes
    G: Array  # (M, m, n)
    T: Array  # (rows, N)
    changing: NDArray[np.int64]  # (rows,)
    nothing: Array  # (N, N)


@compiled
def points(size: Size, system: NonlinearRuns, rule: QuadratureRule) -> Points:
    """Zeros throughout: padding stays zero for good."""
    N, n, m, s = len(size), system.P0.shape[1], system.z.shape[2], system.x0.shape[1]
    M, d = rule.nodes.shape
    jacobians = 1 if M == 0 else (M if d < n else 0)
    return Points(
        np.zeros(s),
        np.zeros(s),
        np.zeros(s),
        np.zeros(system.p.shape[2]),
        np.zeros(m),
        np.zeros(m),
        np.zeros((d, N)),
        np.zeros((N, N)),
        np.zeros((N, N)),
        np.zeros((M, N)),
        np.zeros((M, m)),
        np.zeros((d, N)),
        np.zeros((d, m)),
        np.zeros((jacobians, n, n)),
        np.zeros((jacobians, m, n)),
        np.zeros((max(N, m), N)),
        np.zeros(max(N, m), np.int64),
        np.zeros((N, N)),
    )


@compiled(forceinline=True)
def finite(a: Array) -> bool:
    """Whether all numbers are finite."""
    total = 0.0
    for i in range(len(a)):
        total += a[i] - a[i]  # NaN for what is not finite
    return total == 0.0


@compiled(forceinline=True)
def finite_variances(size: Size, P: Array) -> bool:
    """Whether the diagonal is finite."""
    total = 0.0
    for i in range(len(size)):
        total += P[i, i] - P[i, i]
    return total == 0.0


@compiled
def decompose(size: Size, P: Array, order: NDArray[np.int64], s: Points) -> bool:
    """``P = S S' + rest`` with as many columns as there are nonlinear states; false where P is indefinite."""
    N = len(size)
    for i in range(N):
        for j in range(N):
            s.rest[i, j] = P[i, j]
    for j in range(len(s.S)):
        c = order[j]
        pivot = s.rest[c, c]
        if not pivot >= -NEGATIVE * P[c, c]:
            return False
        scale = 1.0 / np.sqrt(pivot) if pivot > SEMIDEFINITE * P[c, c] else 0.0
        for i in range(N):
            s.S[j, i] = scale * s.rest[c, i]
        take_off(size, s.rest, s.S[j], 1.0)
        for i in range(N):
            s.rest[c, i] = 0.0
            s.rest[i, c] = 0.0
    return True


@compiled(forceinline=True)
def node(rule: QuadratureRule, i: int, s: Points) -> None:
    """``x_i = X + S xi_i``, in `s.x`."""
    for j in range(len(s.x)):
        s.x[j] = s.X[j]
    for k in range(rule.nodes.shape[1]):
        xi = rule.nodes[i, k]
        if xi != 0.0:
            for j in range(len(s.x)):
                s.x[j] += s.S[k, j] * xi


@compiled(forceinline=True)
def regress(rule: QuadratureRule, Y: Array, width: int, mean: Array, A: Array) -> None:
    """Mean of images Y over nodes and their regression on the nodes, A; in Y stays what the regression leaves."""
    M, d = rule.nodes.shape
    for j in range(width):
        total = 0.0
        for i in range(1, M):
            total += rule.mean[i] * (Y[i, j] - Y[0, j])
        mean[j] = Y[0, j] + total
    for k in range(d):
        for j in range(width):
            A[k, j] = 0.0
    for i in range(M):
        for j in range(width):
            Y[i, j] -= mean[j]
        for k in range(d):
            xi = rule.covariance[i] * rule.nodes[i, k]
            if xi != 0.0:
                for j in range(width):
                    A[k, j] += xi * Y[i, j]
    for i in range(M):
        for k in range(d):
            xi = rule.nodes[i, k]
            if xi != 0.0:
                for j in range(width):
                    Y[i, j] -= xi * A[k, j]


@compiled(forceinline=True)
def average(rule: QuadratureRule, J: Array, mean: Array) -> None:
    """Mean of Jacobians in the corner of `mean`; then, in J, deviations from it: zero where a row never changes."""
    M, rows, n = J.shape
    for r in range(rows):
        changes = False
        for i in range(1, M):
            for j in range(n):
                changes |= J[i, r, j] != J[0, r, j]
        for j in range(n):
            total = 0.0
            if changes:
                for i in range(1, M):
                    total += rule.mean[i] * (J[i, r, j] - J[0, r, j])
            mean[r, j] = J[0, r, j] + total
        for i in range(M):
            for j in range(n):
                J[i, r, j] = J[i, r, j] - mean[r, j] if changes else 0.0


@compiled(forceinline=True)
def add_spread(size: Size, rule: QuadratureRule, E: Array, s: Points, spread: Array) -> None:
    """``spread += sum w E_i rest E_i'``; rows that are zero cost nothing."""
    M, rows, n = E.shape
    count = 0
    for r in range(rows):
        changes = False
        for i in range(M):
            for j in range(n):
                changes |= E[i, r, j] != 0.0
        if changes:
            s.changing[count] = r
            count += 1
    for i in range(M if count > 0 else 0):
        for a in range(count):
            for j in range(len(size)):
                s.T[a, j] = 0.0
            for k in range(n):
                e = E[i, s.changing[a], k]
                if e != 0.0:
                    for j in range(len(size)):
                        s.T[a, j] += e * s.rest[k, j]
            for b in range(a + 1):
                total = 0.0
                for j in range(n):
                    total += s.T[a, j] * E[i, s.changing[b], j]
                spread[s.changing[a], s.changing[b]] += rule.mean[i] * total
                if b != a:
                    spread[s.changing[b], s.changing[a]] += rule.mean[i] * total


@compiled(forceinline=True)
def clear(order: NDArray[np.int64], d: int, J: Array) -> None:
    """No columns of the nonlinear states: nodes stand for those."""
    for k in range(d):
        for r in range(len(J)):
            J[r, order[k]] = 0.0


@compiled
def tangent(size: Size, function: Any, jacobian: Any, s: Points, value: Array, slope: Array, into: Array) -> None:
    """Value of a function of the model at the state, and its Jacobian there, laid into a matrix of the filter."""
    function(s.X, s.p, value)
    slope[:] = 0.0
    jacobian(s.X, s.p, slope)
    load(size, slope, into)


@compiled
def predict_tangent(size: Size, functions: Functions, w: Workspace, s: Points) -> bool:
    """``X = f(X)``, ``P = Phi P Phi'`` with the Jacobian at X before; false where a number is not finite."""
    tangent(size, functions.transition, functions.transition_jacobian, s, s.x, s.J[0], w.Phi)
    transpose(size, w.Phi, w.Phi_t)
    for i in range(len(s.X)):
        s.X[i] = s.x[i]
    propagate_covariance(size, w.Phi, w.Phi_t, s.nothing, w.P, w.temporary)
    return finite(s.X) and finite_variances(size, w.P)


@compiled
def images(
    rule: QuadratureRule,
    order: NDArray[np.int64],
    function: Any,
    jacobian: Any,
    s: Points,
    image: Array,
    values: Array,
    slopes: Array,
) -> None:
    """Values of a function of the model at all nodes, and its Jacobians there in the linear states, if there are any."""
    d = rule.nodes.shape[1]
    for i in range(len(rule.nodes)):
        node(rule, i, s)
        function(s.x, s.p, image)
        for j in range(len(image)):
            values[i, j] = image[j]
        if d < len(s.X):
            slopes[i][:] = 0.0
            jacobian(s.x, s.p, slopes[i])
            clear(order, d, slopes[i])


@compiled
def predict_nodes(
    size: Size, functions: Functions, rule: QuadratureRule, order: NDArray[np.int64], w: Workspace, s: Points
) -> bool:
    """``X = E f(x)``, ``P = cov f(x)`` by the rule; P is to be decomposed. False where a number is not finite."""
    N, n = len(size), len(s.X)
    M, d = rule.nodes.shape
    images(rule, order, functions.transition, functions.transition_jacobian, s, s.y, s.Y, s.J)
    regress(rule, s.Y, n, s.X, s.A)
    for i in range(N):
        for j in range(N):
            s.spread[i, j] = 0.0
    for k in range(d):
        take_off(size, s.spread, s.A[k], -1.0)
    for i in range(M):
        take_off(size, s.spread, s.Y[i], -rule.covariance[i])
    if d < n:
        average(rule, s.J, w.Phi)
        add_spread(size, rule, s.J, s, s.spread)
        for i in range(N):
            for j in range(N):
                w.Phi_t[j, i] = w.Phi[i, j]
                w.P[i, j] = s.rest[i, j]
        propagate_covariance(size, w.Phi, w.Phi_t, s.spread, w.P, w.temporary)
    else:
        for i in range(N):
            for j in range(N):
                w.P[i, j] = s.spread[i, j]
        mirror(size, w.P)
    return finite(s.X) and finite_variances(size, w.P)


@compiled
def measure_tangent(size: Size, functions: Functions, w: Workspace, s: Points) -> bool:
    """``z - h(X)`` in place of z, and H; false where a number is not finite."""
    tangent(size, functions.measurement, functions.measurement_jacobian, s, s.h, s.G[0], w.H)
    sound = finite(s.h)
    for r in range(len(s.h)):
        w.z[r] -= s.h[r]
        sound = sound and finite(w.H[r])
    return sound


@compiled
def measure_nodes(
    size: Size, functions: Functions, rule: QuadratureRule, order: NDArray[np.int64], w: Workspace, s: Points
) -> bool:
    """``z - E h(x)`` in place of z, H by regression, ``R + Omega`` in place of R; P is to be decomposed."""
    n, rows = len(s.X), len(s.h)
    M, d = rule.nodes.shape
    images(rule, order, functions.measurement, functions.measurement_jacobian, s, s.h, s.Z, s.G)
    regress(rule, s.Z, rows, s.z_mean, s.C)
    for i in range(M):
        for r in range(rows):
            for q in range(rows):
                w.R[r, q] += rule.covariance[i] * s.Z[i, r] * s.Z[i, q]
    for r in range(rows):
        for j in range(n):
            w.H[r, j] = 0.0
    if d < n:
        average(rule, s.G, w.H)
        add_spread(size, rule, s.G, s, w.R)
    sound = finite(s.z_mean)
    for r in range(rows):
        # H S_u = C' in the nonlinear states, less what the linear ones contribute: back substitution.
        for j in range(d - 1, -1, -1):
            c = order[j]
            if s.S[j, c] > 0.0:
                total = s.C[j, r]
                for i in range(n):
                    total -= w.H[r, i] * s.S[j, i]
                w.H[r, c] = total / s.S[j, c]
        w.z[r] -= s.z_mean[r]
        sound = sound and finite(w.H[r])
    return sound
