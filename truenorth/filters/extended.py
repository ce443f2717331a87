"""Extended Kalman filters: the model's tangent at the estimate, once or iterated; also for states on a manifold.

Sources: A. H. Jazwinski, *Stochastic Processes and Filtering Theory*, 1970, section 8.3; B. M. Bell, F. W. Cathey, The
iterated Kalman filter update as a Gauss-Newton method, IEEE Trans. Autom. Control 38, 1993; A. Barrau, S. Bonnabel, The
invariant extended Kalman filter as a stable observer, IEEE Trans. Autom. Control 62, 2017.
"""

from __future__ import annotations

from typing import Unpack

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.filters.drive import Running
from truenorth.filters.linearisation import NO_RULE
from truenorth.filters.nonlinear import Guarded, run_nonlinear
from truenorth.filters.nonlinear_system import NonlinearSystem, require_jacobians, require_vector_space
from truenorth.filters.robust import Gate
from truenorth.filters.system import Estimates, FilterState


def extended(
    system: NonlinearSystem,
    state: FilterState | None = None,
    **running: Unpack[Guarded],
) -> Estimates:
    """Extended Kalman filter.

    With the retraction of the system it is the error-state filter on a manifold; with errors in which the motion's
    Jacobians do not depend on the estimate it is the *invariant* extended Kalman filter.

    Parameters
    ----------
    system : NonlinearSystem
        With both Jacobians.
    state : FilterState, optional
        From an earlier call with the same options, to go on from.
    **running
        ``tracking``, ``gate``, ``history``, ``innovations``, ``workers``: see :class:`truenorth.filters.Guarded`.

    Raises
    ------
    UsageError
        A Jacobian is missing.
    DataError
        The filter broke down, naming run and epoch.
    """
    require_jacobians(system, "the extended Kalman filter")
    return run_nonlinear(system, state, NO_RULE, np.zeros(0, np.int64), **running)


def iterated(
    system: NonlinearSystem,
    state: FilterState | None = None,
    *,
    iterations: int = 10,
    tolerance: float = 1e-6,
    gate: Gate | None = None,
    **running: Unpack[Running],
) -> Estimates:
    """Iterated extended Kalman filter: each measurement is linearised again where the update has led.

    The updates are Gauss and Newton's steps towards the largest posterior density.

    `state` and ``**running`` are as of :func:`truenorth.filters.kalman`.

    Parameters
    ----------
    system : NonlinearSystem
        With both Jacobians; without retraction.
    iterations : int
        At most, of each epoch; 1 is the extended Kalman filter.
    tolerance : float
        Stop where no state moves by more than this part of its sigma.
    gate : Gate, optional
        Leave out measurements whose innovation is not to be believed; they are judged before the iteration.

    Returns
    -------
    Estimates
        Innovations, NIS and log-likelihood are those of the first linearisation.

    Raises
    ------
    UsageError
        A Jacobian is missing, the system has a retraction, or an option is out of range.
    DataError
        The filter broke down, naming run and epoch.
    """
    require_jacobians(system, "the iterated extended Kalman filter")
    require_vector_space(system, "the iterated extended Kalman filter")
    if iterations < 1:
        raise UsageError(f"iterations is {iterations}, expected at least 1")
    if not tolerance >= 0.0:
        raise UsageError(f"tolerance is {tolerance}, expected a number of at least 0")
    return run_nonlinear(
        system,
        state,
        NO_RULE,
        np.zeros(0, np.int64),
        gate=gate,
        iterations=iterations,
        tolerance=tolerance,
        **running,
    )
