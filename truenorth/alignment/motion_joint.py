"""Motions of a base along all axes fitted at once, with what is not known of the attitude and the sensors integrated out.

A motion that is fitted to what a nominal solution leaves explains the error of that solution, too. Passes tell the two apart where
the sensors are known well; of others, or in a short log, they end at a motion that is no maximum of the log's likelihood. With
navigation-grade IMUs on indexers of moored ships 7 of 8 sound logs of 100 and 200 s were short of it by 100 to 600, and something
that begins within the log, such as a bias that steps, explained the rest.

With errors x ~ N(0, P0) before the log, which show as ``z_a = R_a x + v_a`` along axis a, and motions v_a of covariances V_a,

    -2 log p = sum_a (log|V_a| + z_a' V_a^-1 z_a) + log|I + N| - y' (I + N)^-1 y,
    N = sum_a S' R_a' V_a^-1 R_a S,   y = sum_a S' R_a' V_a^-1 z_a,   P0 = S S'

The columns ``[z_a, R_a S]`` go through the scalar filter of the motion, and those next to it for the derivatives in lanes of the
same pass: a fit of a hundred epochs takes a quarter of a second, by the filter of the whole log half a minute.

Sources: C. E. Rasmussen, C. K. I. Williams, *Gaussian Processes for Machine Learning*, 2006, sec. 2.7 (explicit basis functions);
for the scalar filter :mod:`truenorth.filters.scalar`. The search is SciPy's L-BFGS-B. Its use is ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.motion_fit import DIFFERENCE, Scale
from truenorth.alignment.motion_likelihood import Orders, Walks, values_of, weighed
from truenorth.alignment.windowed import response
from truenorth.errors.sway import AxisMotion
from truenorth.filters import LinearSystem
from truenorth.filters.scalar import LANES, in_lanes

Array = NDArray[np.float64]

ITERATIONS = 40
KNOWN = 1e-14  # of the largest variance: less is known beforehand
IMPOSSIBLE = 1e12  # of what is no model


class JointLikelihood:
    """Minus twice the log-likelihood of the motions along all axes, but for a constant.

    Parameters
    ----------
    system : LinearSystem
        Of the errors about a nominal solution, without the motion.
    interval : float, s
    walks : Walks
        Random walks of the sensors, as they reach the velocity along any axis.
    """

    def __init__(self, system: LinearSystem, interval: float, walks: Walks) -> None:
        variance, V = np.linalg.eigh(system.P0)
        unsure = variance > KNOWN * variance.max()
        S = V[:, unsure] * np.sqrt(variance[unsure])
        shown, _ = response(system)
        left = system.z - shown @ system.x0
        R = shown @ S
        self.columns = [in_lanes(np.column_stack([left[:, axis], R[:, axis]])) for axis in range(3)]
        self.interval, self.walks = interval, walks.blocks(interval)
        self.epochs, self.duration = len(left), interval * len(left)

    def products(self, axis: int, orders: Orders, logs: Array) -> tuple[Array, Array]:
        """``[z, R S]' V^-1 [z, R S]`` (m, p, p) and ``log|V|`` (m,) of motions along an axis, of logarithms (m, 1 + 3 q)."""
        Y, grams, log_V = self.columns[axis], [], []
        for first in range(0, len(logs), LANES):
            part = logs[first : first + LANES]
            gram, log_F = np.zeros((Y.shape[1], Y.shape[1], LANES)), np.empty(LANES)
            weighed(orders, *values_of(part), self.interval, *self.walks, Y, gram, log_F)
            lower = np.moveaxis(gram, -1, 0)[: len(part)]
            grams.append(lower + np.swapaxes(np.tril(lower, -1), 1, 2))
            log_V.append(log_F[: len(part)])
        return np.concatenate(grams), np.concatenate(log_V)

    @staticmethod
    def deviance(gram: Array, log_V: float) -> float:
        """Of the sums over the axes; infinite of what is no model."""
        N = np.eye(len(gram) - 1) + gram[1:, 1:]
        try:
            factor = np.linalg.cholesky(N)
        except np.linalg.LinAlgError:
            return np.inf
        explained = np.linalg.solve(factor, gram[1:, 0])
        found = log_V + gram[0, 0] - explained @ explained + 2.0 * np.log(np.diag(factor)).sum()
        return float(found) if np.isfinite(found) else np.inf


def fit_jointly(likelihood: JointLikelihood, guess: Sequence[AxisMotion]) -> tuple[tuple[AxisMotion, ...], float]:
    """The likeliest motions near a guess, with as many oscillators, and Schwarz's criterion of them.

    Parameters
    ----------
    likelihood : JointLikelihood
    guess : three AxisMotion
    """
    from scipy.optimize import minimize

    scales = [Scale(motion, likelihood.duration) for motion in guess]
    ends = np.cumsum([len(scale.centre) for scale in scales])
    parts = [slice(end - len(scale.centre), end) for end, scale in zip(ends, scales, strict=True)]

    def with_slope(u: Array) -> tuple[float, Array]:
        there = [
            likelihood.products(
                axis, scale.orders, scale.logs(u[part] + np.vstack([np.zeros(n), DIFFERENCE * np.eye(n)]))
            )
            for axis, (scale, part) in enumerate(zip(scales, parts, strict=True))
            for n in (len(scale.centre),)
        ]
        gram, log_V = (sum(of[k][0] for of in there) for k in (0, 1))
        value = likelihood.deviance(gram, log_V)
        if not np.isfinite(value):
            return IMPOSSIBLE, np.zeros(len(u))
        nearby = [
            likelihood.deviance(gram + grams[j] - grams[0], log_V + logs[j] - logs[0])
            for grams, logs in there
            for j in range(1, len(logs))
        ]
        return value, np.nan_to_num((np.array(nearby) - value) / DIFFERENCE, posinf=0.0)

    bounds = [pair for scale in scales for pair in zip(scale.low, scale.high, strict=True)]
    found = minimize(
        with_slope, np.zeros(ends[-1]), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": ITERATIONS}
    )
    motions = tuple(scale.motion(found.x[part]) for scale, part in zip(scales, parts, strict=True))
    return motions, float(found.fun) + math.log(likelihood.epochs) * len(found.x)
