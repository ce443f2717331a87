"""How long until the heading is good enough: read off the way in which sigma has come down so far."""

from __future__ import annotations

import math

import numpy as np

from truenorth.alignment.result import Alignment

SLOPE = -0.2  # of the random part's logarithm over that of time; a flatter one promises nothing


def seconds_to(solution: Alignment, sigma: float, goal: float, now: float) -> float | None:
    """Seconds from `now` until the one-sigma heading error comes down to `goal`.

    The random part of sigma follows the power law of the second half of the history; the floor stays.

    Parameters
    ----------
    sigma : float, rad
        Of heading, now.
    goal : float, rad
    now : float, s

    Returns
    -------
    float or None
        0 where it is reached; None where the floor lies above the goal, or sigma does not come down.
    """
    if sigma <= goal:
        return 0.0
    history = solution.history
    random_goal = goal**2 - float(solution.euler_sigma_floor[0]) ** 2
    if history is None or random_goal <= 0.0 or len(history.time) < 4:
        return None
    random = np.sqrt(np.maximum(history.phi_covariance[:, 2, 2] - history.phi_floor[:, 2, 2], 1e-20))
    elapsed = history.time - (solution.time - solution.duration)
    half = len(elapsed) // 2
    slope = math.log(random[-1] / random[half]) / math.log(elapsed[-1] / elapsed[half])
    if slope > SLOPE:
        return None
    start = solution.time - solution.duration
    left = start + float(elapsed[-1]) * (math.sqrt(random_goal) / float(random[-1])) ** (1.0 / slope) - now
    if left > 0.0:
        return left
    # That time has passed, and sigma is not there yet: the law goes on from the sigma of now.
    random_now = math.sqrt(sigma**2 - float(solution.euler_sigma_floor[0]) ** 2)
    return (now - start) * ((math.sqrt(random_goal) / random_now) ** (1.0 / slope) - 1.0)
