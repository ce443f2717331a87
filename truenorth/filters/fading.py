"""Fading Kalman filters: the past is trusted less where the innovations are larger than the filter expects.

What the innovations e really scatter is remembered row by row, ``V = (rho V + e^2) / (1 + rho)``, and compared with
what the filter expects, ``H P H' + H S + S' H' + R``. Where V is larger, factors make the two equal:

==========  ======================================  ==============================================================
kind        predicted covariance                    factors
==========  ======================================  ==============================================================
single      ``lam Phi P Phi' + Q``                  ``lam = sum(V - r - h Q h') / sum(h Phi P Phi' h')``
noise       ``Phi P Phi' + Q``, and ``R = lam R``   ``lam = sum(V - h (Phi P Phi' + Q) h') / sum(r)``
multiple    ``Lam Phi P Phi' Lam + Q``              ``lam_i^2 = (V - r - h Q h') / (h Phi P Phi' h')`` of state i
improved    ``Lam (Phi P Phi' + Q) Lam``            ``lam_i^2 = (V - r) / (h (Phi P Phi' + Q) h')`` of state i
==========  ======================================  ==============================================================

with sums over the rows present, ``r = R_jj + 2 h s`` of row j, and no factor below 1. For the multiple kinds each row
measures one state, and the states that no row measures keep a factor of 1.

Sources: Q. Xia, M. Rao, Y. Ying, X. Shen, Adaptive fading Kalman filter with an application, Automatica 30, 1994
(single); "Rotary SINS self-alignment under dynamic disturbance" (multiple, its eq. 37; improved, eqs. 41, 42, 47-50).
The paper's rho of .95 remembers only about two epochs: ``1 + rho`` is the memory. Its eq. 42 is kept for the improved
kind; for the multiple one N and J leave Q out, as its eq. 37 does, or the factors would not do what they are for.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, mirror, propagate_covariance, transposed_times
from truenorth.filters.drive import History, drive
from truenorth.filters.recursion import (
    Histories,
    Workspace,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    predict_state,
    update,
    workspace,
)
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs

Fading = Literal["single", "noise", "multiple", "improved"]
SINGLE, NOISE, MULTIPLE, IMPROVED = range(4)


@compiled(forceinline=True)
def remember(size: Size, w: Workspace, rho: float, V: Array) -> None:
    """``V = (rho V + e^2) / (1 + rho)`` of each row present; ``e^2`` the first time."""
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        e = w.z[row] - dot(size, w.H[row], w.x)
        if np.isnan(V[row]):
            V[row] = e * e
        else:
            V[row] = (rho * V[row] + e * e) / (1.0 + rho)


@compiled(forceinline=True)
def factor(wanted: float, there: float, cap: float) -> float:
    """How much larger `there` must be; at least 1, at most `cap`; 1 where nothing is there."""
    if not (there > 0.0 and wanted > there):
        return 1.0
    return min(wanted / there, cap)


@compiled(forceinline=True)
def fade(size: Size, w: Workspace, kind: int, softening: float, cap: float, V: Array, lam: Array, Lam: Array) -> None:
    """From ``P = Phi P Phi'`` to the predicted covariance; `lam` holds the factors, of rows or, in front, of all."""
    N, rows = len(size), w.z.shape[0]
    wanted, there = 0.0, 0.0
    for i in range(N):
        Lam[i] = 1.0
    for row in range(rows):
        if kind in (MULTIPLE, IMPROVED):
            lam[row] = 1.0
        if np.isnan(w.z[row]):
            continue
        h = w.H[row]
        transposed_times(size, w.P, h, w.a)
        old = dot(size, w.a, h)
        transposed_times(size, w.Q, h, w.a)
        new = dot(size, w.a, h)
        cross = 2.0 * dot(size, h, w.S_t[row])
        noise = softening * w.R[row, row] + cross
        if kind == SINGLE:
            wanted += V[row] - noise - new
            there += old
        elif kind == NOISE:
            wanted += V[row] - old - new - cross
            there += w.R[row, row]
        else:
            if kind == MULTIPLE:
                lam[row] = np.sqrt(factor(V[row] - noise - new, old, cap * cap))
            else:
                lam[row] = np.sqrt(factor(V[row] - noise, old + new, cap * cap))
            for i in range(N):
                if h[i] != 0.0:
                    Lam[i] = lam[row]
    past = 1.0
    if kind in (SINGLE, NOISE):
        lam[0] = factor(wanted, there, cap)
    if kind == SINGLE:
        past = lam[0]
    if kind == NOISE:
        for i in range(rows):
            for j in range(rows):
                w.R[i, j] *= lam[0]
    for i in range(N):
        for j in range(N):
            if kind == IMPROVED:
                w.P[i, j] = Lam[i] * Lam[j] * (w.P[i, j] + w.Q[i, j])
            else:
                w.P[i, j] = past * (Lam[i] * Lam[j]) * w.P[i, j] + w.Q[i, j]
    mirror(size, w.P)


@compiled
def fading_runs(
    size: Size, system: Runs, epochs: int, kind: int, rho: float, softening: float, cap: float, out: Histories
) -> None:
    """Fading filter of each run."""
    N, rows = len(size), system.z.shape[2]
    w = workspace(size, rows)
    nothing, Lam, lam = np.zeros((N, N)), np.ones(N), np.ones(max(rows, 1))
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict_state(size, w)
            propagate_covariance(size, w.Phi, w.Phi_t, nothing, w.P, w.temporary)
            present, correlated = load_measurement(size, system, run, epoch, w)
            remember(size, w, rho, out.memory[run])
            fade(size, w, kind, softening, cap, out.memory[run], lam, Lam)
            if out.innovation.shape[1] > 0:
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
                for i in range(out.adaptation.shape[2]):
                    out.adaptation[run, epoch, i] = lam[i]
            if present > 0:
                failure, nis, log_likelihood = update(size, w, correlated, True)
                if not conclude(out, run, epoch, failure, nis, log_likelihood):
                    break
            keep(out, run, epoch, epochs - 1, w)


def fading(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    kind: Fading,
    rho: float = 0.95,
    cap: float = np.inf,
    history: History = "last",
    innovations: bool | None = None,
    workers: int = 1,
) -> Estimates:
    """Fading Kalman filter; the kinds are those of the table above.

    Parameters
    ----------
    system : LinearSystem
        For "multiple" and "improved", each row of H has one element that is not zero, and no two rows the same.
    state : FilterState, optional
        From an earlier call with the same kind, to go on from.
    kind : "single", "noise", "multiple" or "improved"
        Known as SAKF on P, SAKF on R, MAKF and IMAKF.
    rho : float
        Weight of the past in V beside 1 for the newest innovation; the memory is ``1 + rho`` epochs.
    cap : float
        Largest factor.
    history, innovations, workers
        As in :func:`truenorth.filters.kalman`.

    Returns
    -------
    Estimates
        `adaptation` holds the factors: one of the epoch, or one a row. `innovation_covariance` is that with factors.

    Raises
    ------
    UsageError
        An option out of range, or a row that measures several states.
    DataError
        As :func:`truenorth.filters.kalman`.
    """
    if kind not in get_args(Fading):
        raise UsageError(f'kind is {kind!r}, expected "single", "noise", "multiple" or "improved"')
    number = get_args(Fading).index(kind)
    if number in (MULTIPLE, IMPROVED):
        _check_rows(system.H)
    return faded(system, state, number, rho, 1.0, cap, history, innovations, workers)


def faded(
    system: LinearSystem,
    state: FilterState | None,
    kind: int,
    rho: float,
    softening: float,
    cap: float,
    history: History,
    innovations: bool | None,
    workers: int,
) -> Estimates:
    """Run the fading kernel, its options checked."""
    check_factor_options(rho, softening, cap)

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        fading_runs(size, runs, epochs, kind, float(rho), float(softening), float(cap), out)

    return drive(
        kernel,
        system,
        state,
        history=history,
        innovations=innovations,
        workers=workers,
        memory=np.full(system.rows, np.nan),
        adaptation=system.rows if kind in (MULTIPLE, IMPROVED) else 1,
    )


def check_factor_options(rho: float, softening: float, cap: float) -> None:
    """Refuse a memory, a softening or a cap out of range."""
    if not rho >= 0.0 or not np.isfinite(rho):
        raise UsageError(f"rho is {rho}, expected a number of at least 0")
    if not cap >= 1.0:
        raise UsageError(f"cap is {cap}, expected at least 1")
    if not softening >= 1.0 or not np.isfinite(softening):
        raise UsageError(f"softening is {softening}, expected a number of at least 1")


def _check_rows(H: Array) -> None:
    """Each row measures one state, and no two rows the same."""
    measured = H != 0.0
    many = np.argwhere(measured.sum(axis=-1) > 1)
    if len(many):
        raise UsageError(
            f"H: row {many[0][-1]} at epoch {many[0][-2]} measures several states; multiple fading factors need rows "
            "that measure one state each (use the kind single or noise)"
        )
    twice = np.argwhere(measured.sum(axis=-2) > 1)
    if len(twice):
        raise UsageError(f"H: state {twice[0][-1]} is measured by several rows at epoch {twice[0][-2]}; expected one")
