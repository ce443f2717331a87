"""Random walks of the sensors and motion of the base, separated by maximum likelihood.

On a base that moves, the Allan deviation sees the motion. The filter separates both by their spectra: white gyro noise
makes the velocity of a base that stays wander as ``g t^(3/2)``, white accelerometer noise as ``t^(1/2)``, and bounded motion
not at all. Where the log has nothing to say (heavy sway hides it all), a prior about the usual values decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.staying import StaticModel
from truenorth.estimate.base_motion import base_variance
from truenorth.filters import LinearSystem, kalman

Array = NDArray[np.float64]

PRIOR_WIDTH = math.log(5.0)  # one sigma of a random walk about its usual value: a factor of five
STEPS = (math.log(4.0), math.log(2.0), math.log(1.4))  # pattern search, coarse to fine
WALKS = 2  # the first of the walks of biases, behind white noise
LADDER = math.log(4.0) * np.array([-2.0, -1.0, 1.0, 2.0, 3.0, 4.0])
SETTLE = 3  # runs for the base's variance before the search


def fit_noise(
    build: Callable[[StaticModel, Array], LinearSystem], R: Array, usual: StaticModel, *, climb: bool = False
) -> StaticModel:
    """Random walks of greatest posterior density.

    Parameters
    ----------
    build : callable
        ``build(model, R)`` gives the linear system.
    R : (3,) array, (m/s)^2
        Variance of the base's velocity to begin with; fitted along.
    usual : StaticModel
        Centre of the log-normal prior; terms that are zero stay zero.
    climb : bool
        Look for walks of the biases far above the usual ones, too: far below what the log shows they move nothing, and no small
        step finds the way up. Of a still base only: what moves another looks like them.
    """
    centre = np.array(astuple(usual))
    free = np.flatnonzero(centre > 0.0)

    def model_at(x: Array) -> StaticModel:
        return StaticModel(*(centre * np.exp(x)).tolist())

    def cost(x: Array, R: Array) -> tuple[float, Array]:
        estimates = kalman(build(model_at(x), R), innovations=True)
        value = -2.0 * float(estimates.log_likelihood) + float(np.sum((x / PRIOR_WIDTH) ** 2))
        # Slow wander is for the walks to explain: the base's own motion is fitted without its colour.
        return value, base_variance(estimates, R, colour=False)[0]

    x = np.zeros(len(centre))
    for _ in range(SETTLE):
        _, R = cost(x, R)
    best, _ = cost(x, R)
    for axis in free[free >= WALKS] if climb else ():
        for rung in x[axis] + LADDER:
            trial = x.copy()
            trial[axis] = rung
            value, R_trial = cost(trial, R)
            if value < best:
                best, x, R = value, trial, R_trial
    for step in STEPS:
        for axis in free:
            for change in (step, -step):
                moved = False
                while True:
                    trial = x.copy()
                    trial[axis] += change
                    value, R_trial = cost(trial, R)
                    if value >= best:
                        break
                    # The variance follows each step that is taken, and the step is judged again with it.
                    x, R, moved = trial, R_trial, True
                    best, _ = cost(x, R)
                if moved:
                    break
    return model_at(x)
