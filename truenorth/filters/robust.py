"""Kalman filters that do not believe every measurement: chi-square gates and robust weights.

Rows are judged one after the other, each by its innovation *given the rows before it* in units of its sigma, ``e``:

========  ===================================================================================================
rule      weight of a row, which takes part with the variance ``r / weight``
========  ===================================================================================================
gate      1 while e^2 keeps below the chi-square quantile, else 0
huber     1 for e <= k0, else ``k0 / e``
igg3      1 for e <= k0; ``k0 / e ((k1 - e) / (k1 - k0))^2`` for e <= k1; else 0
========  ===================================================================================================

A gate can also judge the whole epoch by its NIS. Weights are found once an epoch, not iterated.

Sources: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4 (gate); P. J. Huber, Robust estimation of a location parameter, Ann. Math. Stat. 35, 1964; Y. Yang, L. Song,
T. Xu, Robust estimator for correlated observations based on bifactor equivalent weights, J. Geodesy 76, 2002 (IGG III).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, Unpack, get_args

import numpy as np

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import (
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    NOT_POSITIVE,
    SOUND,
    Workspace,
    innovate,
    remember_largest,
    row_variance,
    still_positive,
    update_by_row,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem

Weighting = Literal["huber", "igg3"]
GATE_ROWS, GATE_EPOCHS, HUBER, IGG3 = range(4)


class Rule(NamedTuple):
    """How rows are judged; `largest_nis` by the number of rows present."""

    kind: int
    k0: float
    k1: float
    patience: int
    largest_nis: Array


class Judged(NamedTuple):
    """Innovations of an epoch, their covariance, and the weights of its rows."""

    nu: Array
    W: Array
    weights: Array


@dataclass(frozen=True)
class Gate:
    """A chi-square gate.

    Parameters
    ----------
    probability : float
        With which a good row (or epoch) passes.
    by : "row" or "epoch"
        Judge each row, given those before it, or all rows of an epoch together.
    patience : int, optional
        After so many rejections in a row the next one is believed: a filter that is wrong itself finds back.

    Raises
    ------
    UsageError
        An option out of range.
    """

    probability: float = 0.999
    by: Literal["row", "epoch"] = "row"
    patience: int | None = None

    def __post_init__(self) -> None:
        """Check the options."""
        if not 0.0 < self.probability < 1.0:
            raise UsageError(f"probability is {self.probability}, expected a number between 0 and 1")
        if self.by not in ("row", "epoch"):
            raise UsageError(f'by is {self.by!r}, expected "row" or "epoch"')
        if self.patience is not None and self.patience < 1:
            raise UsageError(f"patience is {self.patience}, expected at least 1")

    def limits(self, rows: int) -> tuple[int, float, int, Array]:
        """As the kernels take it: rule, largest row in sigma, patience, largest NIS by number of rows present."""
        from scipy.special import chdtri

        quantiles = np.append(0.0, chdtri(np.arange(1.0, rows + 1.0), 1.0 - self.probability))
        k0 = float(np.sqrt(chdtri(1.0, 1.0 - self.probability)))
        rule = GATE_ROWS if self.by == "row" else GATE_EPOCHS
        return rule, k0, np.iinfo(np.int64).max if self.patience is None else self.patience, quantiles


@borrowing(forceinline=True)
def weight_of(rule: int, e: float, k0: float, k1: float) -> float:
    """Weight of a row whose innovation is `e` sigma large."""
    if e <= k0:
        return 1.0
    if rule == HUBER:
        return k0 / e
    if rule == IGG3 and e < k1:
        return k0 / e * ((k1 - e) / (k1 - k0)) ** 2
    return 0.0


@borrowing(forceinline=True)
def squared(nu: Array, W: Array) -> tuple[float, int]:
    """``nu' W^-1 nu`` of the rows present and their number; by elimination, destroys both."""
    total, present = 0.0, 0
    for j in range(len(nu)):
        if np.isnan(nu[j]):
            continue
        present += 1
        total += nu[j] * nu[j] / W[j, j]
        for i in range(j + 1, len(nu)):
            part = W[i, j] / W[j, j]
            nu[i] -= part * nu[j]
            for k in range(j + 1, len(nu)):
                W[i, k] -= part * W[j, k]
    return total, present


@borrowing(forceinline=True)
def judge_and_update(
    size: Size,
    w: Workspace,
    correlated: bool,
    rule: int,
    k0: float,
    k1: float,
    patience: int,
    rejected: Array,
    weights: Array,
) -> tuple[int, float]:
    """Condition on the rows present, each with its weight; the failure if any, and the log-likelihood of what was used.

    A weight given beforehand (0 or 1, by a gate for the epoch) stands; NaN asks for a judgement of the row.
    """
    log_likelihood = 0.0
    remember_largest(size, w)
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]) or weights[row] == 0.0:
            continue
        nu, variance, h_s = row_variance(size, w, row, correlated)
        if not variance > 0.0:
            return NO_INNOVATION_VARIANCE, log_likelihood
        if np.isnan(weights[row]):
            weights[row] = weight_of(rule, abs(nu) / np.sqrt(variance), k0, k1)
            if weights[row] == 0.0 and rejected[row] >= patience:
                weights[row] = 1.0
            rejected[row] = rejected[row] + 1.0 if weights[row] == 0.0 else 0.0
            if weights[row] == 0.0:
                continue
        more = w.R[row, row] * (1.0 / weights[row] - 1.0)
        w.R[row, row] += more
        variance += more
        log_likelihood -= 0.5 * (nu * nu / variance + np.log(variance) + LOG_2PI)
        update_by_row(size, w, row, nu, variance, h_s, correlated, True)
    if not still_positive(size, w):
        return NOT_POSITIVE, log_likelihood
    return SOUND, log_likelihood


def room(size: Size, rows: int, options: Rule) -> Judged:
    """For one epoch."""
    return Judged(np.zeros(rows), np.zeros((rows, rows)), np.zeros(rows))


def condition(
    size: Size, w: Workspace, options: Rule, own: Judged, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """On the rows present, each with its weight; the memory counts rejections in a row."""
    rows = w.z.shape[0]
    innovate(size, w, own.nu, own.W)
    nis, _ = squared(own.nu, own.W)
    for row in range(rows):
        own.weights[row] = np.nan
    if options.kind == GATE_EPOCHS and present > 0:
        taken = nis <= options.largest_nis[present] or memory[0] >= options.patience
        memory[0] = 0.0 if taken else memory[0] + 1.0
        for row in range(rows):
            own.weights[row] = 1.0 if taken else 0.0
    failure, log_likelihood = judge_and_update(
        size, w, correlated, options.kind, options.k0, options.k1, options.patience, memory, own.weights
    )
    return failure, nis, log_likelihood


def report(size: Size, w: Workspace, options: Rule, own: Judged, memory: Array, figures: Array) -> None:
    """The weights."""
    for row in range(len(figures)):
        figures[row] = np.nan if np.isnan(w.z[row]) else own.weights[row]


variant(Rule, room=room, condition=condition, report=report)


def gated(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    probability: float = 0.999,
    by: Literal["row", "epoch"] = "row",
    patience: int | None = None,
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter with a chi-square gate.

    `system`, `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    probability, by, patience
        Of a :class:`Gate`.

    Returns
    -------
    Estimates
        `adaptation` holds each row's weight: 1 taken, 0 rejected, NaN absent. `nis` is of all rows present, taken or
        not; `log_likelihood` of those taken.

    Raises
    ------
    UsageError
        An option out of range.
    """
    kind, k0, believed, quantiles = Gate(probability, by, patience).limits(system.rows)
    return _robust(system, state, Rule(kind, k0, k0, believed, quantiles), **running)


def robust(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    weighting: Weighting = "huber",
    k0: float | None = None,
    k1: float = 4.0,
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter with robust weights.

    `system`, `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    weighting : "huber" or "igg3"
    k0 : float, optional
        Innovation in sigma up to which a row has full weight; 1.345 (Huber), 1.5 (IGG III) as a rule.
    k1 : float
        Innovation in sigma from which a row has none (IGG III).

    Returns
    -------
    Estimates
        `adaptation` holds each row's weight, NaN where absent. `nis` is of all rows with full weight;
        `log_likelihood` of those used, with their weights.

    Raises
    ------
    UsageError
        An option out of range.
    """
    if weighting not in get_args(Weighting):
        raise UsageError(f'weighting is {weighting!r}, expected "huber" or "igg3"')
    rule = HUBER if weighting == "huber" else IGG3
    full = (1.345 if rule == HUBER else 1.5) if k0 is None else float(k0)
    if not full > 0.0:
        raise UsageError(f"k0 is {full}, expected a positive number")
    if rule == IGG3 and not k1 > full:
        raise UsageError(f"k1 is {k1}, expected more than k0 = {full}")
    no_limit = np.zeros(system.rows + 1)
    return _robust(system, state, Rule(rule, full, float(k1), np.iinfo(np.int64).max, no_limit), **running)


def _robust(system: LinearSystem, state: FilterState | None, rule: Rule, **running: Unpack[Running]) -> Estimates:
    memory = np.zeros(max(system.rows, 1))
    return run_linear(rule, system, state, memory=memory, adaptation=system.rows, **running)
