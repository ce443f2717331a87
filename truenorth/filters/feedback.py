"""The closed loop: what the filter finds is fed back into the nominal state, and the error state begins at zero again.

An INS is corrected this way, so that the errors stay small and the linear model true. The filter sees
``dz = z - H x_nominal`` and estimates the error of the nominal state, which goes on by ``x_nominal = Phi x_nominal + u``. On a
linear system it is the open loop to rounding; what differs is only where the estimate is kept.

Source: P. S. Maybeck, *Stochastic Models, Estimation and Control*, vol. 1, 1979, section 6.4 (indirect feedback).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Size, dot, transposed_times
from truenorth.filters.drive import Running, drive
from truenorth.filters.recursion import (
    Histories,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict,
    update,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs


@compiled
def feedback_runs(size: Size, system: Runs, epochs: int, fed: NDArray[np.bool_], out: Histories) -> None:
    """Closed loop of each run; the memory holds the nominal state."""
    N, n, rows = len(size), out.x.shape[2], system.z.shape[2]
    w = workspace(size, rows)
    nominal, moved, u = np.zeros(N), np.zeros(N), np.zeros(N)
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        for i in range(n):
            nominal[i] = w.x[i] if np.isnan(out.memory[run, i]) else out.memory[run, i]
            w.x[i] -= nominal[i]
        for epoch in range(epochs):
            for i in range(n):
                w.u[i] = u[i]  # taken away below; a constant one is loaded at epoch 0 only
            load_process(size, system, run, epoch, w)
            transposed_times(size, w.Phi_t, nominal, moved)
            for i in range(n):
                u[i] = w.u[i]
                nominal[i] = moved[i] + u[i]
                w.u[i] = 0.0
            predict(size, w)
            present, correlated = load_measurement(size, system, run, epoch, w)
            for row in range(rows):
                w.z[row] -= dot(size, w.H[row], nominal)
            if out.innovation.shape[1] > 0:
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
            if present > 0:
                failure, nis, log_likelihood = update(size, w, correlated, True)
                if not conclude(out, run, epoch, failure, nis, log_likelihood):
                    break
            for i in range(n):
                correction = w.x[i] if fed[i] and present > 0 else 0.0
                nominal[i] += correction
                w.x[i] -= correction
                if out.adaptation.shape[1] > 0:
                    out.adaptation[run, epoch, i] = correction
            # Histories hold the whole state: the nominal one and what is left in the filter.
            for i in range(n):
                moved[i] = w.x[i]
                w.x[i] += nominal[i]
            keep(out, run, epoch, epochs - 1, w)
            for i in range(n):
                w.x[i] = moved[i]
        for i in range(n):
            out.memory[run, i] = nominal[i]


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

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        feedback_runs(size, runs, epochs, fed, out)

    return drive(
        kernel,
        system,
        state,
        memory=np.full(system.states, np.nan),
        adaptation=system.states,
        **running,
    )
