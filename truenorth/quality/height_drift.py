"""Heights of a receiver against its vertical velocities: a height that drifts away.

Heights ``h`` follow the integral ``s`` of the velocities up,

    ``h = a + s + k t + n``,

where `k` is a drift of the heights, or a constant error of the velocities: nothing in the receiver says which. The noise ``n`` of
cells is white, with a walk (errors of the velocities that last from row to row) or a slow error of the fixes (multipath). Their
sizes are not known: as in :mod:`truenorth.quality.gnss` each of a ladder has its generalised least squares, and its weight by
the restricted likelihood.

Source: as there.
"""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import below
from truenorth.quality.gnss import FEWEST_CELLS, RATIOS, cell_means, walk_covariance
from truenorth.quality.slow_aids import USUAL_TIME
from truenorth.records import GnssRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

LASTING = (0.0, 20.0, 200.0)  # s, for which errors of velocities are correlated


def height_evidence(gnss: GnssRecord) -> list[Evidence]:
    """By how much the heights of a receiver drift away from its velocities up, where that is no chance.

    The one of the two that is wrong is not known, so that each output is as wrong as if it were its own.
    """
    if gnss.v_n is None or gnss.alt is None:
        return []
    rows = np.flatnonzero(gnss.has_position & np.isfinite(gnss.alt) & np.isfinite(gnss.v_n[:, 2]))
    if len(rows) < 2 * FEWEST_CELLS:
        return []
    time, up = gnss.time[rows], gnss.v_n[rows, 2]
    steps = np.diff(time)
    risen = np.append(0.0, np.cumsum(0.5 * (up[1:] + up[:-1]) * steps))
    stretch = np.append(0, np.cumsum(steps > 3.0 * np.median(steps)))  # over a gap nothing is known of the way
    found = _drift(*cell_means(stretch, time, gnss.alt[rows] - risen))
    if found is None:
        return []
    rate, sigma, otherwise = found
    if otherwise > 0.5 * limit("height drifts"):
        return []
    size = abs(rate) * float(np.ptp(time))
    figures: dict[str, Figure] = {"size": size, "rate": rate, "sigma": sigma}
    effect = Effect(velocity=abs(rate), position=size)
    return [Evidence("gnss.height_drifts", figures, "known", effect, ("sensor_axes",))]


def _drift(stretch: NDArray[np.intp], time: Array, apart: Array) -> tuple[float, float, float] | None:
    """Rate and its sigma (m/s), and the probability of the other sign, of what cells (M,) are apart; None: too few."""
    count = len(time)
    if not count:
        return None
    own = (stretch[:, None] == np.unique(stretch)).astype(np.float64)  # a height of its own for each stretch
    X = np.column_stack([time - time[0], own])
    dof = count - X.shape[1]
    if dof < FEWEST_CELLS:
        return None
    alike = np.where(own @ own.T > 0.0, np.exp(-np.abs(time[:, None] - time) / USUAL_TIME), 0.0)
    noises = [*(walk_covariance(time, stretch, lasts) for lasts in LASTING), alike]
    rates, sigmas, likely = [], [], []
    for extra in (np.zeros((count, count)), *(r * noise for noise, r in product(noises, RATIOS))):
        C = np.eye(count) + extra
        A, b = np.linalg.solve(C, X), np.linalg.solve(C, apart - apart.mean())
        N = X.T @ A
        x = np.linalg.solve(N, X.T @ b)
        squares = float(b @ (apart - apart.mean() - X @ x))
        if not squares > 0.0:
            continue
        rates.append(float(x[0]))
        sigmas.append(math.sqrt(squares / dof * float(np.linalg.inv(N)[0, 0])))
        powers = np.linalg.slogdet(C)[1] + np.linalg.slogdet(N)[1]
        likely.append(-0.5 * (powers + dof * math.log(squares)))
    if not rates:
        return None
    weights = np.exp(np.array(likely) - max(likely))
    weights /= weights.sum()
    rate = float(weights @ rates)
    sigma = math.sqrt(float(weights @ (np.square(sigmas) + (np.array(rates) - rate) ** 2)))
    other = [below(-math.copysign(1.0, rate) * r / s, dof) for r, s in zip(rates, sigmas, strict=True)]
    return rate, sigma, float(weights @ other)
