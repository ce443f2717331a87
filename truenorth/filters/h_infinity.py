"""The H-infinity filter: bounds the worst ratio of estimation error to disturbance, whatever the disturbance.

For every disturbance ``sum |L (x - x_hat)|^2 < g^2 (|x - x0|^2 / P0 + sum |w|^2 / Q + sum |v|^2 / R)``, with the
bound g and x_hat from the measurements up to its epoch. The filter is a Kalman filter that after each measurement
also "measures" ``L x`` as just what it took it to be, with the negative variance ``-g^2``: the state stays, and
``P^-1 = P_pred^-1 + H' R^-1 H - L' L / g^2``. It exists while this is positive, that is, while ``L P L' < g^2``
before that step. P is then no covariance any more; it is larger than the Kalman filter's.

Source: B. Hassibi, A. H. Sayed, T. Kailath, Linear estimation in Krein spaces, part II, IEEE Trans. Autom. Control
41, 1996 (the a-posteriori filter, its theorem 2); D. Simon, *Optimal State Estimation*, 2006, chapter 11.
"""

from __future__ import annotations

from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, padded, take_off, transposed_times
from truenorth.filters.drive import NoFilterError, Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import NO_FILTER, SOUND, Workspace, update
from truenorth.filters.system import Estimates, FilterState, LinearSystem

TINY = 1e-150  # its square is still a number


class HInfinity(NamedTuple):
    """Options of :func:`h_infinity`: ``L`` padded (rows, N), and ``1 / g^2``."""

    L: Array
    theta: float


@borrowing(forceinline=True)
def distrust(size: Size, w: Workspace, L: Array, theta: float) -> float:
    """``P = (P^-1 - theta L' L)^-1``, row by row; the margin, ``min(1 - theta l P l')``."""
    margin = 1.0
    for row in range(L.shape[0]):
        transposed_times(size, w.P, L[row], w.a)
        left = 1.0 - theta * dot(size, w.a, L[row])
        margin = min(margin, left)
        if not left > 0.0:
            return left
        take_off(size, w.P, w.a, -theta / left)
    return margin


def room(size: Size, rows: int, options: HInfinity) -> Array:
    """For the margin of an epoch."""
    return np.ones(1)


def condition(
    size: Size, w: Workspace, options: HInfinity, own: Array, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """On the rows present, then on ``L x`` with its negative variance."""
    failure, nis, log_likelihood = SOUND, 0.0, 0.0
    if present > 0:
        failure, nis, log_likelihood = update(size, w, correlated, True)
    own[0] = distrust(size, w, options.L, options.theta)
    memory[0] = min(memory[0], own[0])
    if failure == SOUND and not own[0] > 0.0:
        failure = NO_FILTER
    return failure, nis, log_likelihood


def report(size: Size, w: Workspace, options: HInfinity, own: Array, memory: Array, figures: Array) -> None:
    """The margin."""
    figures[0] = own[0]


variant(HInfinity, room=room, condition=condition, report=report)


def h_infinity(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    bound: float,
    L: ArrayLike | None = None,
    **running: Unpack[Running],
) -> Estimates:
    """H-infinity filter.

    `system`, `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    bound : float
        g: bound on the estimation error's energy against the normalised disturbance's, in the unit of ``L x``. With a
        growing bound the filter becomes the Kalman filter.
    L : (p, n) array, optional
        What of the state is to be estimated; all of it as a rule.

    Returns
    -------
    Estimates
        `adaptation` holds the margin, ``min(1 - l P l' / g^2)``: how far the epoch was from having no such filter;
        ``state.memory`` the smallest so far. `P` is the bound's, not a covariance; `log_likelihood` and `nis` are of
        the Gaussian with it.

    Raises
    ------
    UsageError
        An option out of range.
    NoFilterError
        There is no filter that keeps the bound, naming run and epoch.
    """
    if not bound > 0.0:
        raise UsageError(f"bound is {bound}, expected a positive number")
    wanted = np.eye(system.states) if L is None else np.asarray(L, dtype=np.float64)
    if wanted.ndim != 2 or wanted.shape[1] != system.states or not np.isfinite(wanted).all():
        raise UsageError(f"L has shape {wanted.shape}, expected (p, n) finite numbers with n = {system.states}")
    rows = np.zeros((len(wanted), len(padded(system.states))))
    rows[:, : system.states] = wanted
    options = HInfinity(rows, 1.0 / float(bound) ** 2)
    return run_linear(options, system, state, memory=np.ones(1), adaptation=1, **running)


def smallest_bound(system: LinearSystem, *, L: ArrayLike | None = None, tolerance: float = 1e-6) -> float:
    """Smallest bound for which the H-infinity filter exists in all runs and epochs, by bisection.

    Parameters
    ----------
    system : LinearSystem
    L : (p, n) array, optional
    tolerance : float
        Relative.

    Returns
    -------
    float
        A bound that can be kept, at most `tolerance` above one that cannot.

    Raises
    ------
    UsageError
        Any bound can be kept, since ``L x`` is known exactly.
    """

    def exists(bound: float) -> bool:
        try:
            h_infinity(system, bound=bound, L=L)
        except NoFilterError:
            return False
        return True

    high = 1.0
    while not exists(high):
        high *= 2.0
    low = high / 2.0
    while exists(low):
        if low < TINY:
            raise UsageError("there is no smallest bound: L x is known exactly")
        low, high = low / 2.0, low
    while high > (1.0 + tolerance) * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if exists(middle) else (middle, high)
    return high
