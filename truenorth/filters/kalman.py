"""The Kalman filter: predict, and condition on one measurement row after the other.

Sources: R. E. Kalman, A new approach to linear filtering and prediction problems, J. Basic Eng. 82, 1960;
P. D. Joseph's form of the update in R. S. Bucy, P. D. Joseph, *Filtering for Stochastic Processes with Applications
to Guidance*, 1968; rows one by one and correlated noise: D. Simon, *Optimal State Estimation*, 2006, sections 6.1, 7.1.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Unpack

from truenorth.core.linalg import Array, Size
from truenorth.filters.device import Device
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import SOUND, Workspace, update
from truenorth.filters.system import Estimates, FilterState, LinearSystem


class Kalman(NamedTuple):
    """Options of :func:`kalman`."""

    joseph: bool


def condition(
    size: Size, w: Workspace, options: Kalman, own: Any, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """In Joseph's form or in the plain one."""
    if present == 0:
        return SOUND, 0.0, 0.0
    return update(size, w, correlated, options.joseph)


variant(Kalman, condition=condition)


def kalman(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    joseph: bool = True,
    device: Device = "cpu",
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter.

    Exact for any ``R`` (diagonal or not) and ``S``; absent rows (NaN) are left out.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call, to go on from; replaces ``x0, P0``. Chunks give the bits of one batch.
    joseph : bool
        Update the covariance in Joseph's form, which survives precise measurements of what was unknown; the plain
        form takes two thirds of the time of an update. Where P cannot hold the information of a row in either form (rows that mix
        states with a prior some 1e16 times R), the filter stops and says so; :func:`truenorth.filters.square_root` goes on.
    device : "cpu", "cuda" or "auto"
        Where many runs are worked out: "cuda" is a CUDA device (``pip install 'truenorth[cuda]'``), with the same results but for
        rounding; "auto" takes it where there is one and the work is large enough.
    **running
        ``history``, ``innovations``, ``workers``: see :class:`truenorth.filters.Running`.

    Raises
    ------
    UsageError
        A CUDA device is asked for and is not there, or cannot hold the system.
    DataError
        The variance of an innovation or of a state is not positive, or there is nothing but rounding left in P, naming run
        and epoch.
    """
    return run_linear(Kalman(joseph), system, state, joseph=joseph, device=device, **running)
