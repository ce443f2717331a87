"""Allan deviation of inertial sensors, and the noise coefficients read from it.

Sources: IEEE Std 952-1997, annex C (the Allan variance of gyro noise processes); W. J. Riley, *Handbook
of Frequency Stability Analysis*, NIST SP 1065, 2008 (overlapping estimator; degrees of freedom, table 5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.blocks import row_blocks
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]

SHORTEST_RECORD = 20  # rows; below that an Allan deviation says nothing
OCTAVE_CORRELATION = 0.5  # of overlapping Allan variances one octave apart, white noise (1000 simulated records)
MODEL_ERRORS = (0.0, 0.1, 0.3, 1.0, 3.0)  # of the variance, relative
MISFIT = 3.0  # chi-square a degree of freedom, above which the four processes do not describe the record
WORTH = 6.0  # what one more noise process must lower chi-square by to be believed


@dataclass(frozen=True)
class AllanDeviation:
    """Overlapping Allan deviation of one or more channels.

    Parameters
    ----------
    tau : (M,) array, s
        Averaging times.
    deviation : (M, ...) array
        Allan deviation, in the unit of the rates (rad/s, m/s^2).
    sigma : (M, ...) array
        One-sigma of `deviation`, from the degrees of freedom of white rate noise.
    """

    tau: Array
    deviation: Array
    sigma: Array


@dataclass(frozen=True)
class NoiseCoefficients:
    """Noise coefficients of three like channels, SI units, each with its one-sigma.

    The unit of the rate is rad/s for gyros and m/s^2 for accelerometers; below u stands for it. A coefficient
    of 0 means that the record does not show the process above the others; its sigma is then NaN.

    Parameters
    ----------
    quantisation : (3,) array, u s
        ``Q``; variance ``3 Q^2 / tau^2``.
    random_walk : (3,) array, u s^0.5
        ``N``: angle random walk (rad/sqrt(s)) or velocity random walk (m/s/sqrt(s)); variance ``N^2 / tau``.
    bias_instability : (3,) array, u
        ``B``; variance ``(2 ln 2 / pi) B^2``.
    rate_random_walk : (3,) array, u/s^0.5
        ``K``; variance ``K^2 tau / 3``.
    *_sigma : (3,) arrays
        One-sigma of each.
    allan : AllanDeviation
        What they were fitted to.
    """

    quantisation: Array
    random_walk: Array
    bias_instability: Array
    rate_random_walk: Array
    quantisation_sigma: Array
    random_walk_sigma: Array
    bias_instability_sigma: Array
    rate_random_walk_sigma: Array
    allan: AllanDeviation

    def variance(self, tau: ArrayLike) -> Array:
        """Allan variance of the fitted model at `tau` (M,), shape (M, 3)."""
        squares = np.stack([self.quantisation, self.random_walk, self.bias_instability, self.rate_random_walk])
        return _shapes(np.asarray(tau, dtype=np.float64)) @ squares**2


def overlapping_adev(
    data: ArrayLike,
    interval: float,
    taus: ArrayLike | None = None,
    kind: Literal["rates", "increments"] = "rates",
) -> AllanDeviation:
    """Overlapping Allan deviation.

    ``sigma^2(m T) = sum_k (theta[k+2m] - 2 theta[k+m] + theta[k])^2 / (2 (m T)^2 (N + 1 - 2m))`` with `theta`
    the integral of the rate (NIST SP 1065, section 5.2.4).

    Parameters
    ----------
    data : (N,) or (N, axes) array
        Rates, or increments over one interval each.
    interval : float, s
        Sampling interval ``T``.
    taus : (M,) array, s, optional
        Averaging times, rounded to whole intervals; those that do not fit (below one interval, above half the
        record) are left out, doubles are merged. Default: octaves, up to a quarter of the record.
    kind : {"rates", "increments"}
        What a row is.

    Raises
    ------
    UsageError
        Fewer than three rows, an interval that is not positive, or no averaging time that fits.
    """
    rows = np.asarray(data, dtype=np.float64)
    count = rows.shape[0]
    if count < 3 or not interval > 0.0:
        raise UsageError(
            f"Allan deviation of {count} rows at an interval of {interval} s; expected at least 3 rows and a "
            "positive interval"
        )
    if taus is None:
        m = 2 ** np.arange(max(1, int(np.log2(count / 4)) + 1))
    else:
        m = np.unique(np.rint(np.asarray(taus, dtype=np.float64) / interval).astype(np.int64))
        m = m[(m >= 1) & (2 * m <= count)]
    if m.size == 0:
        raise UsageError(
            f"none of the averaging times fits; choose between {interval:g} s and half the record, "
            f"{count * interval / 2:g} s"
        )
    tau: Array = m.astype(np.float64) * interval
    deviation = np.empty((m.size, *rows.shape[1:]))
    mean = rows.mean(axis=0)
    for axis in np.ndindex(rows.shape[1:]):  # one by one: of a long log all at once are much memory
        theta = np.zeros(count + 1)
        # The mean is removed first: the second difference does not see it, rounding does.
        np.cumsum(rows[:, *axis] - mean[axis], out=theta[1:])
        if kind == "rates":
            theta *= interval
        for i, step in enumerate(m.tolist()):
            deviation[i, *axis] = math.sqrt(_mean_square(theta, step) / 2.0) / tau[i]
    relative: Array = np.sqrt(0.5 / _degrees_of_freedom(count, m))
    sigma: Array = deviation * relative.reshape(-1, *[1] * (rows.ndim - 1))
    return AllanDeviation(tau, deviation, sigma)


def _mean_square(theta: Array, step: int) -> float:
    """Of second differences over so many rows."""
    count, total = len(theta) - 2 * step, 0.0
    for part in row_blocks(count):
        early, middle, late = (theta[part.start + shift : part.stop + shift] for shift in (0, step, 2 * step))
        total += float(np.sum((late - 2.0 * middle + early) ** 2))
    return total / count


def fit_noise(data: ArrayLike, interval: float, kind: Literal["rates", "increments"]) -> NoiseCoefficients:
    """Noise coefficients of three like channels at rest, (N, 3), evenly sampled; see `truenorth.quality.noise`."""
    allan = overlapping_adev(data, interval, kind=kind)
    values, sigmas = np.zeros((4, 3)), np.full((4, 3), np.nan)
    for axis in range(3):
        values[:, axis], sigmas[:, axis], _ = fit_shapes(
            _shapes(allan.tau), allan.deviation[:, axis], allan.sigma[:, axis]
        )
    return NoiseCoefficients(*values, *sigmas, allan)  # type: ignore[call-arg]


def _shapes(tau: Array) -> Array:
    """(M, 4) Allan variance of the four processes for coefficients of one."""
    return np.stack([3.0 / tau**2, 1.0 / tau, np.full_like(tau, 2.0 * np.log(2.0) / np.pi), tau / 3.0], axis=-1)


def fit_shapes(shapes: Array, deviation: Array, sigma: Array) -> tuple[Array, Array, float]:
    """Coefficients (S,) and sigmas (S,) of the set of processes that explains an Allan deviation (M,) best, and the misfit.

    `shapes` (M, S) are the Allan variances of the processes for coefficients of one. The misfit is the sum of squared
    logarithmic residuals, each in units of its sigma.

    Small least-squares problems, one for each set of processes, replace an iterative solver; a set
    with a square below zero is out, and a process must lower chi-square by `WORTH` to be taken. The weights
    are the fitted variance's; the measured one, whose weights favour small values, only starts the iteration.

    Real sensors have vibration, filters and resonances that the four processes lack. Where chi-square shows it, a
    relative error of the model joins the weights until it no longer does, so that no part of the curve rules;
    residuals are then meant on the logarithmic scale of the plot.
    """
    coefficients, sigmas = np.zeros(shapes.shape[1]), np.full(shapes.shape[1], np.nan)
    usable = deviation > 0.0
    if np.count_nonzero(usable) < 2:
        return coefficients, sigmas, 0.0
    shapes, variance = shapes[usable], deviation[usable] ** 2
    relative = 2.0 * sigma[usable] / deviation[usable]
    lag = np.abs(np.subtract.outer(np.arange(variance.size), np.arange(variance.size)))
    correlation = OCTAVE_CORRELATION**lag

    for model_error in MODEL_ERRORS:
        model = variance
        for _ in range(3 if model_error == 0.0 else 5):
            size = model if model_error == 0.0 else _logarithmic_size(model, variance)
            cost, chosen, squares, solver = _best_processes(
                shapes, variance, 1.0 / (np.hypot(relative, model_error) * size)
            )
            model = shapes[:, chosen] @ squares
        spread = cost / max(1, variance.size - len(chosen))
        if spread < MISFIT:
            break

    covariance = solver @ correlation @ solver.T  # of the squares; the weighted rows have unit variance
    coefficients[list(chosen)] = np.sqrt(squares)
    sigmas[list(chosen)] = np.sqrt(max(1.0, spread) * np.diag(covariance)) / (2.0 * np.sqrt(squares))
    misfit = float(np.sum((np.log(shapes[:, chosen] @ squares / variance) / relative) ** 2))
    return coefficients, sigmas, misfit


def _logarithmic_size(model: Array, variance: Array) -> Array:
    """Scale of residuals whose weighted normal equations are those of ``sum (log model - log variance)^2``."""
    log_ratio = np.log(model / variance)
    near = np.abs(log_ratio) < 1e-6
    logarithmic_mean = np.where(near, model, (model - variance) / np.where(near, 1.0, log_ratio))
    return np.asarray(np.sqrt(model * logarithmic_mean))


Fit = tuple[float, tuple[int, ...], Array, Array]


def _best_processes(shapes: Array, variance: Array, weights: Array) -> Fit:
    """The set that explains it best, of those whose squares are positive; each process must be worth its place."""
    fits: list[Fit] = []
    for sets in _sets(shapes.shape[1], variance.size):
        squares, solvers, costs = _fit_processes(shapes, variance * weights, weights, sets)
        for k in np.flatnonzero(~np.any(squares <= 0.0, axis=1)):
            fits.append((float(costs[k]), tuple(sets[k].tolist()), squares[k], solvers[k]))
    return min(fits, key=lambda fit: fit[0] + WORTH * len(fit[1]))


@cache
def _sets(processes: int, most: int) -> list[NDArray[np.int64]]:
    """Sets of one, two, .. processes, at most so many: (C, size) each."""
    sizes = range(1, min(processes, most) + 1)
    return [np.array(list(combinations(range(processes), size))) for size in sizes]


def _fit_processes(shapes: Array, wanted: Array, weights: Array, sets: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Squared coefficients (C, size), solvers (C, size, M) and chi-squares (C,) of sets of processes (C, size)."""
    rows = np.swapaxes(shapes.T[sets] * weights, 1, 2)
    scale = np.linalg.norm(rows, axis=1)  # the shapes differ by many powers of ten
    solvers = np.linalg.pinv(rows / scale[:, None]) / scale[:, :, None]
    squares = solvers @ wanted
    left = (rows @ squares[:, :, None])[:, :, 0] - wanted
    return squares, solvers, np.sum(left**2, axis=1)


def _degrees_of_freedom(count: int, m: NDArray[np.int64]) -> Array:
    """Equivalent degrees of freedom for white rate noise (NIST SP 1065, table 5: white FM); at least one."""
    points = count + 1
    terms = 3.0 * (points - 1) / (2.0 * m) - 2.0 * (points - 2) / points
    return np.maximum(1.0, terms * 4.0 * m**2 / (4.0 * m**2 + 5.0))
