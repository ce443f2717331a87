"""The Gaussian-sum filter: several hypotheses, each a normal distribution with a filter of its own, weighed by the data.

Where one normal distribution cannot stand for what is known, as for an azimuth of which nothing is known at all, a sum
of narrower ones can: each is carried on by any filter of this package as a run of its own, and Bayes' rule multiplies
its weight by the likelihood that its filter found. On linear systems the sum is exact; on nonlinear ones as good as the
filter is over the width of one hypothesis.

Sources: H. W. Sorenson, D. L. Alspach, Recursive Bayesian estimation using Gaussian sums, Automatica 7, 1971; D. L.
Alspach, H. W. Sorenson, Nonlinear Bayesian estimation using Gaussian sum approximations, IEEE Trans. Autom. Control 17,
1972 (eqs. 21-30).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import Array
from truenorth.filters.system import Estimates

STEP = 1.0 / 0.6  # of a hypothesis' sigma to the next one: the sum of equal ones then ripples by .16 % ...
REACH = 3.5  # ... and reaches so many sigmas of the whole to both sides


@dataclass(frozen=True)
class Hypotheses:
    """A sum of L normal distributions.

    Parameters
    ----------
    weight : (..., L) array
        They sum to 1.
    x : (..., L, s) array
    P : (..., L, n, n) array
    """

    weight: Array
    x: Array
    P: Array

    @property
    def mean(self) -> Array:
        """(..., s) mean of the sum."""
        return np.asarray(np.einsum("...l,...ls->...s", self.weight, self.x))

    @property
    def covariance(self) -> Array:
        """(..., n, n) covariance of the sum: within the hypotheses and among them."""
        away = self.x - self.mean[..., None, :]
        return np.asarray(
            np.einsum("...l,...lij->...ij", self.weight, self.P + away[..., :, None] * away[..., None, :])
        )

    @property
    def likeliest(self) -> tuple[Array, Array]:
        """(..., s), (..., n, n): state and covariance of the hypothesis with the largest weight."""
        best = np.argmax(self.weight, axis=-1)[..., None]
        return (
            np.take_along_axis(self.x, best[..., None], axis=-2)[..., 0, :],
            np.take_along_axis(self.P, best[..., None, None], axis=-3)[..., 0, :, :],
        )


@dataclass(frozen=True)
class GaussianSum:
    """What a Gaussian-sum filter found after the last epoch.

    Attributes
    ----------
    hypotheses : Hypotheses
    log_likelihood : (...) array
        Of all measurements since the beginning, all hypotheses together.
    estimates : Estimates
        Of each hypothesis; the last run axis is theirs.
    """

    hypotheses: Hypotheses
    log_likelihood: Array
    estimates: Estimates


def gaussian_sum(
    filter: Callable[..., Estimates],
    system: Any,
    start: Hypotheses | GaussianSum,
    **options: Any,
) -> GaussianSum:
    """Filter each hypothesis and weigh it.

    Parameters
    ----------
    filter : callable
        A filter of this package that carries one normal distribution: `kalman`, `extended`, `gauss_hermite`, ...
    system : LinearSystem or NonlinearSystem
        Its `x0` and `P0` are not looked at.
    start : Hypotheses or GaussianSum
        What is known before the first epoch (see :func:`split`, :func:`around_circle`), or an earlier call's result to
        go on from.
    **options
        Of the filter.

    Raises
    ------
    UsageError
        Hypotheses whose shapes do not fit.
    DataError
        Weights that are negative or do not sum to 1; no hypothesis explains the data; or the filter of one broke down,
        naming run and epoch.
    """
    hypotheses = start.hypotheses if isinstance(start, GaussianSum) else start
    if isinstance(start, Hypotheses):
        _check(hypotheses)
        state = None
    else:
        state = start.estimates.state
    L = hypotheses.weight.shape[-1]
    before = np.zeros(()) if state is None else state.log_likelihood
    found = filter(_for_each(system, hypotheses), state, **options)
    with np.errstate(divide="ignore"):
        log_weight = np.log(hypotheses.weight) + found.log_likelihood - before
    largest = np.max(log_weight, axis=-1, keepdims=True)
    if not np.all(np.isfinite(largest)):
        run = np.argwhere(~np.isfinite(largest[..., 0]))[0].tolist()
        raise DataError(f"run {run}: none of {L} hypotheses explains the measurements; start from wider ones")
    total = largest[..., 0] + np.log(np.sum(np.exp(log_weight - largest), axis=-1))
    weight = np.exp(log_weight - total[..., None])
    earlier = start.log_likelihood if isinstance(start, GaussianSum) else 0.0
    return GaussianSum(Hypotheses(weight, found.state.x, found.state.P), np.asarray(earlier + total), found)


def split(x: ArrayLike, P: ArrayLike, state: int, count: int) -> Hypotheses:
    """Split a normal distribution along one state into a sum of narrower ones.

    The other states keep what they have in common with it. The sum has the mean and, to about 1 %, the variance of the
    whole.

    Parameters
    ----------
    x : (n,) array_like
    P : (n, n) array_like
    state : int
        Along which it is split.
    count : int
        Hypotheses, at least 6; each has ``4.2 / (count - 1)`` of the whole sigma.

    Raises
    ------
    UsageError
        Fewer than 6 hypotheses, a state that is not there or has no variance.
    """
    x, P = np.asarray(x, float), np.asarray(P, float)
    _check_split(x, state, count, 6)
    variance = P[state, state]
    if not variance > 0.0:
        raise UsageError(f"state {state} has the variance {variance}; what is known exactly cannot be split")
    # In sigmas of the whole: centres are spread by sqrt(1 - s^2), REACH of these to both sides, and each hypothesis has
    # the sigma s. Their sum ripples as little as STEP says where two are STEP s sqrt(1 - s^2) from each other.
    s = 2.0 * REACH / STEP / (count - 1)
    spread = math.sqrt(1.0 - s * s)
    at = np.linspace(-REACH * spread, REACH * spread, count)
    weight = np.exp(-0.5 * (at / spread) ** 2)
    column = P[:, state] / math.sqrt(variance)
    return Hypotheses(
        weight / weight.sum(),
        x + at[:, None] * column,
        np.tile(P - (1.0 - s * s) * np.outer(column, column), (count, 1, 1)),
    )


def around_circle(x: ArrayLike, P: ArrayLike, state: int, count: int) -> Hypotheses:
    """Hypotheses all around the circle for an angle of which nothing is known, equally likely.

    Parameters
    ----------
    x : (n,) array_like
        The first hypothesis.
    P : (n, n) array_like
        Of the other states; what it says of the angle and of what the others have in common with it is not used.
    state : int
        The angle, rad.
    count : int
        Hypotheses, ``2 pi / count`` from each other, with .6 of that as sigma.

    Raises
    ------
    UsageError
        Fewer than 2 hypotheses, or a state that is not there.
    """
    x, P = np.asarray(x, float), np.array(P, float)
    _check_split(x, state, count, 2)
    step = 2.0 * math.pi / count
    P[state, :] = P[:, state] = 0.0
    P[state, state] = (step / STEP) ** 2
    several = np.tile(x, (count, 1))
    several[:, state] += step * np.arange(count)
    return Hypotheses(np.full(count, 1.0 / count), several, np.tile(P, (count, 1, 1)))


def _check_split(x: Array, state: int, count: int, least: int) -> None:
    if count < least:
        raise UsageError(f"count is {count}, expected at least {least} hypotheses")
    if not 0 <= state < len(x):
        raise UsageError(f"state is {state}, expected one of 0 to {len(x) - 1}")


def _check(hypotheses: Hypotheses) -> None:
    L = hypotheses.weight.shape[-1]
    if hypotheses.x.shape[-2] != L or hypotheses.P.shape[-3] != L:
        raise UsageError(
            f"hypotheses: weight has shape {hypotheses.weight.shape}, x {hypotheses.x.shape}, P {hypotheses.P.shape}; "
            "expected (..., L), (..., L, s), (..., L, n, n)"
        )
    if not np.all(hypotheses.weight >= 0.0) or not np.allclose(hypotheses.weight.sum(axis=-1), 1.0, atol=1e-9):
        raise DataError("hypotheses: weight is negative or does not sum to 1")


def _for_each(system: Any, hypotheses: Hypotheses) -> Any:
    """The system with a run axis for the hypotheses behind all others."""
    arrays: dict[str, Array] = {"x0": hypotheses.x, "P0": hypotheses.P}
    for name, axes in system.axes.items():
        a = getattr(system, name)
        if a is not None and name not in arrays and a.ndim > len(axes):
            arrays[name] = np.expand_dims(a, a.ndim - len(axes))
    return replace(system, **arrays)
