"""Smoothing of a closed loop: each output given the measurements of the whole log.

Corrections fed back make the loop's errors those of a linear filter less what it has corrected so far, ``x_c``. With
``z = nu + H x_c`` (innovation and what was corrected) the same linear filter is run again and smoothed by
:func:`truenorth.filters.smoother`; its answer less ``x_c`` is what is left of the error at each epoch. Corrections that
are not fed back as they are leave them in other coordinates, those after each: they are carried there (``D``), as the loop
carries its covariance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import azimuth_free, invariant
from truenorth.estimate.along_curve import knows_body, lever_now
from truenorth.estimate.correct import feed_back
from truenorth.estimate.memory import AS_IT_IS, REOPENED, USED, Events, Kept, Model
from truenorth.filters import LinearSystem
from truenorth.filters.smoother import smoother
from truenorth.strapdown import wander

Array = NDArray[np.float64]


def smoothed(plan: Events, kept: Kept, P0: Array, model: Model) -> tuple[Array, Array, Array]:
    """State, sensors and covariance (along w) at each output, smoothed.

    Parameters
    ----------
    plan : Events
    kept : Kept
        Of a run made for smoothing: with its links from event to event.
    P0 : (n, n) array
        Covariance at the beginning.
    model : Model

    Returns
    -------
    state : (J, 12) array
    sensors : (J, n) array
    P : (J, n, n) array
    """
    linked = (plan.source >= 0) | plan.output
    innovation, used = kept.innovation[linked], np.isin(kept.verdict[linked], (USED, REOPENED))
    count, n = len(innovation), len(P0)
    corrected = np.zeros((count, n))  # after each event, in the errors before it
    z = np.full((count, 3), np.nan)
    Phi = kept.Phi.copy()
    x = np.zeros(n)
    for k in range(count):
        if k > 0:
            Phi[k] = Phi[k] @ kept.D[k - 1]
        x = Phi[k] @ x
        if used[k]:
            z[k] = innovation[k] + kept.H[k] @ x
        x = x + kept.dx[k]
        corrected[k] = x
    R = np.zeros((count, 3, 3))
    R[:, range(3), range(3)] = np.where(np.isfinite(z), kept.R, 1.0)
    answer = smoother(LinearSystem(Phi=Phi, Q=kept.Q, H=kept.H, R=R, z=z, x0=np.zeros(n), P0=P0))
    out = plan.output[linked]
    left, P, D = answer.x[out] - corrected[out], answer.P[out], kept.D[out]
    left = np.einsum("kij,kj->ki", D, left)
    P = D @ P @ np.swapaxes(D, 1, 2)
    state, sensors = kept.state.copy(), kept.aux.copy()
    full = np.zeros((len(state), wander.LENGTH))
    full[:, : state.shape[1]] = state
    for k in range(len(state)):
        if knows_body(model, full[k], sensors[k], kept.P[k]):
            lever = lever_now(model, full[k], kept.lever[k], kept.P[k])
            azimuth_free.reset(full[k], left[k], sensors[k], model.drift, lever, P[k])
        elif model.invariant != AS_IT_IS:
            invariant.reset(full[k], left[k], P[k], model.fixed_altitude)
        feed_back(full[k], sensors[k], left[k], model.dynamics.turns)
    return full[:, : state.shape[1]], sensors, P
