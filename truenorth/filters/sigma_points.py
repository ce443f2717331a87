"""Gaussian filters by quadrature: unscented, cubature, Gauss-Hermite; in all states or in the nonlinear ones only.

All are one recursion with different nodes and weights (:mod:`truenorth.filters.quadrature`). Where the model is linear
in most states once a few are given, ``f(x) = F(u) x + g(u)``, name those few (`nonlinear`): nodes are then needed in
them only, which is what makes high orders affordable, and the rest is in closed form from the Jacobians.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.filters.nonlinear import Guarded, run_nonlinear
from truenorth.filters.nonlinear_system import NonlinearSystem, require_jacobians, require_vector_space
from truenorth.filters.quadrature import QuadratureRule, cubature_rule, gauss_hermite_rule, unscented_rule
from truenorth.filters.system import Estimates, FilterState


def unscented(
    system: NonlinearSystem,
    state: FilterState | None = None,
    *,
    alpha: float,
    beta: float,
    kappa: float,
    nonlinear: Sequence[int] | None = None,
    **running: Unpack[Guarded],
) -> Estimates:
    """Unscented Kalman filter; the rest of its call is that of :func:`gauss_hermite`.

    Parameters
    ----------
    alpha, beta, kappa : float
        As in :func:`truenorth.filters.quadrature.unscented_rule`, in as many dimensions as there are nonlinear states.
    """
    order = cholesky_order(system, nonlinear)
    rule = unscented_rule(len(order), alpha=alpha, beta=beta, kappa=kappa)
    return _by_nodes(system, state, rule, order, **running)


def cubature(
    system: NonlinearSystem,
    state: FilterState | None = None,
    *,
    nonlinear: Sequence[int] | None = None,
    **running: Unpack[Guarded],
) -> Estimates:
    """Cubature Kalman filter, of third degree; the rest of its call is that of :func:`gauss_hermite`."""
    order = cholesky_order(system, nonlinear)
    rule = cubature_rule(len(order))
    return _by_nodes(system, state, rule, order, **running)


def gauss_hermite(
    system: NonlinearSystem,
    state: FilterState | None = None,
    *,
    order: int,
    nonlinear: Sequence[int] | None = None,
    **running: Unpack[Guarded],
) -> Estimates:
    """Gauss-Hermite filter.

    `state` and ``**running`` are as of :func:`truenorth.filters.extended`.

    Parameters
    ----------
    system : NonlinearSystem
        Without retraction; with both Jacobians where `nonlinear` is given.
    order : int
        Nodes in each dimension (3, 5, 7 ...); in d dimensions there are ``order**d``.
    nonlinear : sequence of int, optional
        The states in which transition and measurement are not linear; all of them, if not given. The model must be
        linear in the other states once these are given (:func:`truenorth.filters.check_jacobians` tests that).

    Raises
    ------
    UsageError
        An option out of range, a system with a retraction, a missing Jacobian.
    DataError
        The filter broke down, naming run and epoch.
    """
    first = cholesky_order(system, nonlinear)
    rule = gauss_hermite_rule(len(first), order)
    return _by_nodes(system, state, rule, first, **running)


def cholesky_order(system: NonlinearSystem, nonlinear: Sequence[int] | None) -> NDArray[np.int64]:
    """The nonlinear states; all states where they are not given.

    Raises
    ------
    UsageError
        A state that is not there or is named twice, or no state at all.
    """
    n = system.states
    if nonlinear is None:
        return np.arange(n, dtype=np.int64)
    states = np.asarray(nonlinear)
    if states.ndim != 1 or len(states) == 0 or not np.issubdtype(states.dtype, np.integer):
        raise UsageError(f"nonlinear is {nonlinear!r}, expected a list of states, numbers from 0 to {n - 1}")
    if (states < 0).any() or (states >= n).any() or len(np.unique(states)) < len(states):
        raise UsageError(f"nonlinear is {list(nonlinear)}, expected different states, numbers from 0 to {n - 1}")
    return states.astype(np.int64)


def _by_nodes(
    system: NonlinearSystem,
    state: FilterState | None,
    rule: QuadratureRule,
    order: NDArray[np.int64],
    **running: Unpack[Guarded],
) -> Estimates:
    require_vector_space(system, "a filter by nodes")
    if len(order) < system.states:
        require_jacobians(system, "a filter with nodes in the nonlinear states only")
    return run_nonlinear(system, state, rule, order, **running)
