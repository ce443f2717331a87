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

from typing import Literal, NamedTuple, Unpack, get_args

import numpy as np

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, mirror, propagate_covariance, transposed_times
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import Workspace, predict_state
from truenorth.filters.system import Estimates, FilterState, LinearSystem

Fading = Literal["single", "noise", "multiple", "improved"]
SINGLE, NOISE, MULTIPLE, IMPROVED = range(4)


class FadingOptions(NamedTuple):
    """Options of the fading and of the strong tracking filter."""

    kind: int
    rho: float
    softening: float
    cap: float


class Factors(NamedTuple):
    """Of an epoch: of the rows or, in front, of all; of the states; and zeros in the place of Q."""

    of_rows: Array
    of_states: Array
    no_noise: Array


@borrowing(forceinline=True)
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


@borrowing(forceinline=True)
def factor(wanted: float, there: float, cap: float) -> float:
    """How much larger `there` must be; at least 1, at most `cap`; 1 where nothing is there."""
    if not (there > 0.0 and wanted > there):
        return 1.0
    return min(wanted / there, cap)


@borrowing(forceinline=True)
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


def room(size: Size, rows: int, options: FadingOptions) -> Factors:
    """Factors of one."""
    return Factors(np.ones(max(rows, 1)), np.ones(len(size)), np.zeros((len(size), len(size))))


def predict(size: Size, w: Workspace, options: FadingOptions, own: Factors) -> None:
    """``x = Phi x + u``, ``P = Phi P Phi'``: Q follows when the factors are known."""
    predict_state(size, w)
    propagate_covariance(size, w.Phi, w.Phi_t, own.no_noise, w.P, w.temporary)


def adapt(size: Size, w: Workspace, options: FadingOptions, own: Factors, memory: Array) -> None:
    """Remember the innovations, and fade the past."""
    remember(size, w, options.rho, memory)
    fade(size, w, options.kind, options.softening, options.cap, memory, own.of_rows, own.of_states)


def report(size: Size, w: Workspace, options: FadingOptions, own: Factors, memory: Array, figures: Array) -> None:
    """The factors."""
    for i in range(len(figures)):
        figures[i] = own.of_rows[i]


variant(FadingOptions, room=room, predict=predict, adapt=adapt, report=report)


def fading(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    kind: Fading,
    rho: float = 0.95,
    cap: float = np.inf,
    **running: Unpack[Running],
) -> Estimates:
    """Fading Kalman filter; the kinds are those of the table above.

    `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    system : LinearSystem
        For "multiple" and "improved", each row of H has one element that is not zero, and no two rows the same.
    kind : "single", "noise", "multiple" or "improved"
        Known as SAKF on P, SAKF on R, MAKF and IMAKF.
    rho : float
        Weight of the past in V, where the newest innovation has 1; the memory is ``1 + rho`` epochs.
    cap : float
        Largest factor.

    Returns
    -------
    Estimates
        `adaptation` holds the factors: one of the epoch, or one a row. `innovation_covariance` is that with factors.

    Raises
    ------
    UsageError
        An option out of range, or a row that measures several states.
    """
    if kind not in get_args(Fading):
        raise UsageError(f'kind is {kind!r}, expected "single", "noise", "multiple" or "improved"')
    number = get_args(Fading).index(kind)
    if number in (MULTIPLE, IMPROVED):
        _check_rows(system.H)
    return faded(system, state, FadingOptions(number, float(rho), 1.0, float(cap)), **running)


def faded(
    system: LinearSystem, state: FilterState | None, options: FadingOptions, **running: Unpack[Running]
) -> Estimates:
    """Run the fading filter with options that are checked here."""
    check_factor_options(options.rho, options.softening, options.cap)
    return run_linear(
        options,
        system,
        state,
        memory=np.full(system.rows, np.nan),
        adaptation=system.rows if options.kind in (MULTIPLE, IMPROVED) else 1,
        **running,
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
