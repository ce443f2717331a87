"""The closed loop: what the filter finds is fed back into the nominal state, and the error state begins at zero again.

An INS is corrected this way, so that the errors stay small and the linear model true. The filter sees
``dz = z - H x_nominal`` and estimates the error of the nominal state, which goes on by ``x_nominal = Phi x_nominal + u``. On a
linear system it is the open loop to rounding; what differs is only where the estimate is kept.

Source: P. S. Maybeck, *Stochastic Models, Estimation and Control*, vol. 1, 1979, section 6.4 (indirect feedback).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, transposed_times
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import SOUND, Workspace, update
from truenorth.filters.system import Estimates, FilterState, LinearSystem


class Feedback(NamedTuple):
    """Options of :func:`feedback`."""

    fed: NDArray[np.bool_]


class Room(NamedTuple):
    """Nominal state of this epoch, and what was fed back to it, (N,)."""

    nominal: Array
    correction: Array


def room(size: Size, rows: int, options: Feedback) -> Room:
    """The memory holds the nominal state between epochs, NaN before the first."""
    return Room(np.zeros(len(size)), np.zeros(len(size)))


def adapt(size: Size, w: Workspace, options: Feedback, own: Room, memory: Array) -> None:
    """Carry the nominal state on; what the filter sees, and estimates, is relative to it."""
    n, first = len(memory), np.isnan(memory[0])
    for i in range(n):
        own.correction[i] = 0.0 if first else memory[i]
    transposed_times(size, w.Phi_t, own.correction, own.nominal)
    for i in range(n):
        own.nominal[i] = w.x[i] if first else own.nominal[i] + w.u[i]
        w.x[i] -= own.nominal[i]
    for row in range(w.z.shape[0]):
        w.z[row] -= dot(size, w.H[row], own.nominal)


def condition(
    size: Size, w: Workspace, options: Feedback, own: Room, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """Update, and feed back; histories hold the whole state: the nominal one and what is left in the filter."""
    found = update(size, w, correlated, True) if present > 0 else (SOUND, 0.0, 0.0)
    for i in range(len(memory)):
        own.correction[i] = w.x[i] if options.fed[i] and present > 0 else 0.0
        memory[i] = own.nominal[i] + own.correction[i]
        w.x[i] += own.nominal[i]
    return found


def report(size: Size, w: Workspace, options: Feedback, own: Room, memory: Array, figures: Array) -> None:
    """What was fed back."""
    for i in range(len(figures)):
        figures[i] = own.correction[i]


variant(Feedback, room=room, adapt=adapt, condition=condition, report=report)


def feedback(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    states: slice | Sequence[int] = slice(None),
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter in a closed loop.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call, to go on from; its `memory` is the nominal state.
    states : slice or indices
        Fed back after each measurement; the others stay in the filter.
    **running
        ``history``, ``innovations``, ``workers``: see :class:`truenorth.filters.Running`.

    Returns
    -------
    Estimates
        `x` is the nominal state and what is left in the filter, together; `adaptation` holds what was fed back.

    Raises
    ------
    UsageError
        A state that is not there.
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    fed = np.zeros(system.states, dtype=np.bool_)
    try:
        fed[states if isinstance(states, slice) else list(states)] = True
    except IndexError:
        raise UsageError(f"states is {states!r}, expected indices below {system.states}") from None

    memory = np.full(system.states, np.nan)
    return run_linear(Feedback(fed), system, state, memory=memory, adaptation=system.states, **running)
