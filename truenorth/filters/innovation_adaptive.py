"""The measurement noise from a window of innovations or of residuals.

Of the last N measurements of a row, with the predicted covariance P- and the filtered P+::

    innovation:  r = mean(nu^2 - h P- h'),   nu = z - h x-
    residual:    r = mean(e^2 + h P+ h'),    e  = z - h x+

The first is right also where the given R is far off, but as a difference it may be negative and is held within
limits. The second is never negative; since P+ and e follow from the R in use, it comes nearer with each window only.
Where the window reaches back before the first measurement, the given R stands in.

Sources: R. K. Mehra, On the identification of variances and adaptive Kalman filtering, IEEE Trans. Autom. Control 15,
1970; A. H. Mohamed, K. P. Schwarz, Adaptive Kalman filtering for INS/GPS, J. of Geodesy 73, 1999, eqs. 8 and 13.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, Unpack, get_args

import numpy as np

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, transposed_times
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import SOUND, Workspace, update
from truenorth.filters.sage_husa import check_independent_rows, check_limits
from truenorth.filters.system import Estimates, FilterState, LinearSystem

AdaptiveKind = Literal["innovation", "residual"]


class InnovationAdaptive(NamedTuple):
    """Options of :func:`innovation_adaptive`; `before`: by innovations, else by residuals."""

    length: int
    before: bool
    smallest: float
    largest: float


@borrowing(forceinline=True)
def observe(size: Size, w: Workspace, window: Array, seen: Array, sign: float) -> None:
    """Put ``(z - h x)^2 + sign h P h'`` of each row present into its window, in the place of the oldest."""
    for row in range(w.z.shape[0]):
        if np.isnan(w.z[row]):
            continue
        nu = w.z[row] - dot(size, w.H[row], w.x)
        transposed_times(size, w.P, w.H[row], w.a)
        window[row, int(seen[row]) % window.shape[1]] = nu * nu + sign * dot(size, w.a, w.H[row])
        seen[row] += 1.0


@borrowing(forceinline=True)
def take_noise(w: Workspace, window: Array, seen: Array, smallest: float, largest: float) -> None:
    """R of each row from its window; the given one in the places not yet filled."""
    length = window.shape[1]
    for row in range(w.z.shape[0]):
        given = w.R[row, row]
        count = int(min(seen[row], length))
        total = (length - count) * given
        for i in range(count):
            total += window[row, i]
        w.R[row, row] = min(max(total / length, smallest * given), largest * given)


def adapt(size: Size, w: Workspace, options: InnovationAdaptive, own: Any, memory: Array) -> None:
    """R from the windows; the memory holds how many each row has seen, then the windows."""
    rows = w.z.shape[0]
    window = memory[rows:].reshape(rows, options.length)
    if options.before:
        observe(size, w, window, memory[:rows], -1.0)
    take_noise(w, window, memory[:rows], options.smallest, options.largest)


def condition(
    size: Size, w: Workspace, options: InnovationAdaptive, own: Any, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """On the rows present, then look at the residuals."""
    if present == 0:
        return SOUND, 0.0, 0.0
    failure, nis, log_likelihood = update(size, w, correlated, True)
    rows = w.z.shape[0]
    if not options.before:
        observe(size, w, memory[rows:].reshape(rows, options.length), memory[:rows], 1.0)
    return failure, nis, log_likelihood


def report(size: Size, w: Workspace, options: InnovationAdaptive, own: Any, memory: Array, figures: Array) -> None:
    """The variances."""
    for row in range(len(figures)):
        figures[row] = w.R[row, row]


variant(InnovationAdaptive, adapt=adapt, condition=condition, report=report)


def innovation_adaptive(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    kind: AdaptiveKind = "innovation",
    window: int = 50,
    smallest: float = 1e-2,
    largest: float = 1e4,
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter that takes the measurement noise from a window of innovations or residuals.

    `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    system, smallest, largest
        As of :func:`truenorth.filters.sage_husa`.
    kind : "innovation" or "residual"
    window : int
        Measurements of a row that count; the variance scatters by ``sqrt(2 / window)`` and more.

    Returns
    -------
    Estimates
        `adaptation` holds each row's variance.

    Raises
    ------
    UsageError
        An option out of range, R not diagonal, or S given.
    """
    if kind not in get_args(AdaptiveKind):
        raise UsageError(f'kind is {kind!r}, expected "innovation" or "residual"')
    if window < 1:
        raise UsageError(f"window is {window}, expected at least 1 measurement")
    check_limits(smallest, largest)
    check_independent_rows(system)

    options = InnovationAdaptive(int(window), kind == "innovation", float(smallest), float(largest))
    memory = np.zeros(system.rows * (1 + window))
    return run_linear(options, system, state, memory=memory, adaptation=system.rows, **running)
