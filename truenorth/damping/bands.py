"""Error bands: what a damped INS may be off by, its networks' own dynamics and a constant error of the reference included."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import Course
from truenorth.damping.loop import LONGEST_STEP, Loop, transition_and_input
from truenorth.models.marine import MOTION, STATES, MarineModel

Array = NDArray[np.float64]


def network_sigma(
    course: Course,
    loop: Loop,
    P0: Array,
    model: MarineModel,
    *,
    start: int = 0,
    reference_noise: float = 0.0,
    reference_sigma: float = 0.0,
) -> Array:
    """(K+1-start, 7) one-sigma of the errors of an INS with this loop, from an epoch on.

    Covariance of errors, network states, biases and the reference's constant error together, through the closed loop.

    Parameters
    ----------
    P0 : (13, 13) array
        Of the undamped errors and biases at the start.
    model : MarineModel
        Of the noise.
    start : int
        Epoch of the switch.
    reference_noise : float, m/s
        White, of each epoch; 0 for internal damping.
    reference_sigma : float, m/s
        One-sigma of the reference's constant error, east and north.
    """
    part = course.between(start, course.epochs)
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse = part.every(stride)
    F, _ = coarse.linearise(model)
    M, N = loop.matrices(F, coarse.position[1:, 0], np.ones(coarse.epochs))
    n = M.shape[1]
    biases = STATES - MOTION.stop
    whole = np.zeros((coarse.epochs, n + biases + 2, n + biases + 2))
    whole[:, :n, :n] = M
    whole[:, MOTION, n : n + biases] = F[:, MOTION, MOTION.stop : STATES]
    whole[:, n : n + biases, n : n + biases] = F[:, MOTION.stop : STATES, MOTION.stop : STATES]
    whole[:, :n, n + biases :] = N
    inputs = np.zeros((coarse.epochs, n + biases + 2, 2))
    inputs[:, :n] = N
    Phi, Gamma = transition_and_input(whole, inputs, coarse.interval)
    P = np.zeros(whole.shape[1:])
    motion = np.arange(MOTION.stop)
    slow = np.arange(n, n + biases)
    placed = np.concatenate([motion, slow])
    P[np.ix_(placed, placed)] = P0
    P[n + biases :, n + biases :] = reference_sigma**2 * np.eye(2)
    noise = np.zeros(len(P))
    noise[motion], noise[slow] = model.noise[MOTION], model.noise[MOTION.stop : STATES]
    Q = np.diag(noise * coarse.interval)
    white = reference_noise**2 * course.interval / coarse.interval
    out = np.empty((coarse.epochs + 1, MOTION.stop))
    out[0] = np.diagonal(P)[MOTION]
    for k in range(coarse.epochs):
        P = Phi[k] @ P @ Phi[k].T + Q + white * Gamma[k] @ Gamma[k].T
        out[k + 1] = np.diagonal(P)[MOTION]
    sigma = np.sqrt(np.maximum(out, 0.0))
    return np.stack([np.interp(part.time, coarse.time, column) for column in sigma.T], axis=1)


def constant_error_sigma(estimate: Callable[[Array], Array], reference: Array, sigma: float, x: Array) -> Array:
    """(K, 7) what a constant error of the reference of this one-sigma does to an estimate.

    Parameters
    ----------
    estimate : callable
        (K+1, 2) reference to (K, 7) estimated errors.
    reference : (K+1, 2) array, m/s
    sigma : float, m/s
    x : (K, 7) array
        The estimate on this reference.
    """
    if sigma == 0.0:
        return np.zeros_like(x)
    parts = [estimate(reference + sigma * axis) - x for axis in np.eye(2)]
    return np.asarray(np.sqrt(sum(part**2 for part in parts)))
