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
from typing import Literal, get_args

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size
from truenorth.filters.drive import History, drive
from truenorth.filters.recursion import (
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    NOT_POSITIVE,
    SOUND,
    Histories,
    Workspace,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict,
    row_variance,
    still_positive,
    update_by_row,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs

Weighting = Literal["huber", "igg3"]
GATE_ROWS, GATE_EPOCHS, HUBER, IGG3 = range(4)


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


@compiled(forceinline=True)
def weight_of(rule: int, e: float, k0: float, k1: float) -> float:
    """Weight of a row whose innovation is `e` sigma large."""
    if e <= k0:
        return 1.0
    if rule == HUBER:
        return k0 / e
    if rule == IGG3 and e < k1:
        return k0 / e * ((k1 - e) / (k1 - k0)) ** 2
    return 0.0


@compiled(forceinline=True)
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


@compiled(forceinline=True)
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
    for i in range(len(size)):
        w.largest[i] = max(w.largest[i], w.P[i, i])
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


@compiled
def robust_runs(
    size: Size,
    system: Runs,
    epochs: int,
    rule: int,
    k0: float,
    k1: float,
    patience: int,
    largest_nis: Array,
    out: Histories,
) -> None:
    """Gated or robust filter of each run; `largest_nis` by the number of rows present."""
    rows = system.z.shape[2]
    w = workspace(size, rows)
    nu, W, weights = np.zeros(rows), np.zeros((rows, rows)), np.zeros(rows)
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        rejected = out.memory[run]
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict(size, w)
            _, correlated = load_measurement(size, system, run, epoch, w)
            innovate(size, w, nu, W)
            if out.innovation.shape[1] > 0:
                for i in range(rows):
                    out.innovation[run, epoch, i] = nu[i]
                    for j in range(rows):
                        out.innovation_covariance[run, epoch, i, j] = W[i, j]
            nis, present = squared(nu, W)
            for row in range(rows):
                weights[row] = np.nan
            if rule == GATE_EPOCHS and present > 0:
                taken = nis <= largest_nis[present] or rejected[0] >= patience
                rejected[0] = 0.0 if taken else rejected[0] + 1.0
                for row in range(rows):
                    weights[row] = 1.0 if taken else 0.0
            failure, log_likelihood = judge_and_update(size, w, correlated, rule, k0, k1, patience, rejected, weights)
            if not conclude(out, run, epoch, failure, nis, log_likelihood):
                break
            if out.innovation.shape[1] > 0:
                for row in range(rows):
                    out.adaptation[run, epoch, row] = np.nan if np.isnan(w.z[row]) else weights[row]
            keep(out, run, epoch, epochs - 1, w)


def gated(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    probability: float = 0.999,
    by: Literal["row", "epoch"] = "row",
    patience: int | None = None,
    history: History = "last",
    innovations: bool | None = None,
    workers: int = 1,
) -> Estimates:
    """Kalman filter with a chi-square gate.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call, to go on from.
    probability : float
        With which a good row (or epoch) passes.
    by : "row" or "epoch"
        Judge each row, given those before it, or all rows of an epoch together.
    patience : int, optional
        After so many rejections in a row the next one is believed: a filter that is wrong itself finds back.
    history, innovations, workers
        As in :func:`truenorth.filters.kalman`.

    Returns
    -------
    Estimates
        `adaptation` holds each row's weight: 1 taken, 0 rejected, NaN absent. `nis` is of all rows present, taken or
        not; `log_likelihood` of those taken.

    Raises
    ------
    UsageError
        An option out of range.
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    gate = Gate(probability, by, patience)
    rule, k0, believed, quantiles = gate.limits(system.rows)
    return _robust(system, state, rule, k0, k0, believed, quantiles, history, innovations, workers)


def robust(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    weighting: Weighting = "huber",
    k0: float | None = None,
    k1: float = 4.0,
    history: History = "last",
    innovations: bool | None = None,
    workers: int = 1,
) -> Estimates:
    """Kalman filter with robust weights.

    Parameters
    ----------
    system : LinearSystem
    state : FilterState, optional
        From an earlier call, to go on from.
    weighting : "huber" or "igg3"
    k0 : float, optional
        Innovation in sigma up to which a row has full weight; 1.345 (Huber), 1.5 (IGG III) as a rule.
    k1 : float
        Innovation in sigma from which a row has none (IGG III).
    history, innovations, workers
        As in :func:`truenorth.filters.kalman`.

    Returns
    -------
    Estimates
        `adaptation` holds each row's weight, NaN where absent. `nis` is of all rows with full weight;
        `log_likelihood` of those used, with their weights.

    Raises
    ------
    UsageError
        An option out of range.
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    if weighting not in get_args(Weighting):
        raise UsageError(f'weighting is {weighting!r}, expected "huber" or "igg3"')
    rule = HUBER if weighting == "huber" else IGG3
    full = (1.345 if rule == HUBER else 1.5) if k0 is None else float(k0)
    if not full > 0.0:
        raise UsageError(f"k0 is {full}, expected a positive number")
    if rule == IGG3 and not k1 > full:
        raise UsageError(f"k1 is {k1}, expected more than k0 = {full}")
    none = np.zeros(system.rows + 1)
    return _robust(system, state, rule, full, float(k1), np.iinfo(np.int64).max, none, history, innovations, workers)


def _robust(
    system: LinearSystem,
    state: FilterState | None,
    rule: int,
    k0: float,
    k1: float,
    patience: int,
    largest_nis: Array,
    history: History,
    innovations: bool | None,
    workers: int,
) -> Estimates:
    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        robust_runs(size, runs, epochs, rule, k0, k1, patience, largest_nis, out)

    return drive(
        kernel,
        system,
        state,
        history=history,
        innovations=innovations,
        workers=workers,
        memory=np.zeros(max(system.rows, 1)),
        adaptation=system.rows,
    )
