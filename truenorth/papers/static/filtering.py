"""The paper's two filters on what they measure, and their errors at chosen times."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.stationary import DV, KEPT, PHI, StationaryModel
from truenorth.filters import Estimates, FilterState, LinearSystem, kalman
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.static.truth import Truth

Array = NDArray[np.float64]
Filter = Callable[[LinearSystem, FilterState | None], Estimates]


def system_of(truth: Truth, model: StationaryModel, states: int, P0: Array, R: float) -> LinearSystem:
    """The ten- or the eight-state filter's system of all runs of a case.

    Parameters
    ----------
    model : StationaryModel
        As the filter believes it.
    states : {10, 8}
    P0 : (10, 10) array
    R : float
        Variance of one measurement, (m/s)^2 or (m/s^2)^2.
    """
    T = float(truth.time[0])
    turned = not np.allclose(truth.C_nb, truth.C_nb[0])
    attitudes = truth.C_nb if turned else truth.C_nb[:1]
    kinds, which = np.unique(attitudes, axis=0, return_inverse=True)
    discrete = [model.discrete(T, C, states) for C in kinds]
    Phi, Q = (np.stack([d[i] for d in discrete])[which.ravel()] for i in (0, 1))
    if states == 10:
        H = np.eye(10)[None, DV]
        z, noise = truth.velocity, R
    else:
        # The mean over the interval that ends at the epoch: half an interval late, which a stationary base does not show.
        H = np.stack([model.accelerometer_rows(C) for C in kinds])[which.ravel()]
        z, noise = truth.force, R + model.walks.accel_random_walk**2 / T
    return LinearSystem(
        Phi=Phi,
        Q=Q,
        H=H,
        R=noise * np.eye(2)[None],
        z=z,
        x0=np.zeros(states),
        P0=P0[np.ix_(KEPT[states], KEPT[states])],
    )


def errors_at(
    system: LinearSystem, truth: Truth, times: Sequence[float], run: Filter | None = None, workers: int = 1
) -> list[AttitudeErrors]:
    """Filter in stretches between the times, and hold each estimate against the truth: errors of all runs, time by time."""
    estimate = run or (lambda part, state: kalman(part, state, innovations=False, workers=workers))
    true_phi = truth.phi if system.states == 10 else truth.phi_platform
    state: FilterState | None = None
    found, first = [], 0
    for time in times:
        last = int(np.searchsorted(truth.time, time * (1 - 1e-9))) + 1
        state = estimate(system.between(first, last), state).state
        x, P, first = state.x, state.P, last
        P = np.broadcast_to(P, (len(x), *P.shape[-2:]))
        found.append(AttitudeErrors.of(x[:, PHI] - true_phi[:, last - 1], P[:, PHI, PHI]))
    return found
