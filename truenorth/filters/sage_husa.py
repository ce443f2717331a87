"""The Sage-Husa filter: the variance of each measurement row is estimated from the innovations as they come.

Of an innovation nu with the predicted covariance P, ``E nu^2 = h P h' + r``, so that with fading weights
``r = (1 - d) r + d (nu^2 - h P h')``, ``d = (1 - b) / (1 - b^(k+1))`` at the row's k-th measurement: the plain mean at
first, a memory of ``1 / (1 - b)`` measurements later. A single difference may well be negative; the estimate is held
within limits about the given R. Estimating Q and R at once from the same innovations is not observable in general and
is known to diverge: only R is estimated.

Source: A. P. Sage, G. W. Husa, Adaptive filtering with unknown prior statistics, Joint Automatic Control Conf., 1969;
R. K. Mehra, Approaches to adaptive filtering, IEEE Trans. Autom. Control 17, 1972 (what can be observed).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Unpack

import numpy as np

from truenorth.core.compiled import borrowing
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size, dot, transposed_times
from truenorth.filters.drive import Running
from truenorth.filters.linear import run_linear, variant
from truenorth.filters.recursion import Workspace
from truenorth.filters.system import Estimates, FilterState, LinearSystem


class SageHusa(NamedTuple):
    """Options of :func:`sage_husa`."""

    b: float
    smallest: float
    largest: float


@borrowing(forceinline=True)
def estimate_noise(size: Size, w: Workspace, b: float, smallest: float, largest: float, r: Array, fade: Array) -> None:
    """Bring `r` of each row present up to date and put it into R; `fade` holds ``b^k``."""
    for row in range(w.z.shape[0]):
        given = w.R[row, row]
        if np.isnan(r[row]):
            r[row] = given
        if not np.isnan(w.z[row]):
            nu = w.z[row] - dot(size, w.H[row], w.x)
            transposed_times(size, w.P, w.H[row], w.a)
            fade[row] *= b
            d = (1.0 - b) / (1.0 - fade[row])
            r[row] = (1.0 - d) * r[row] + d * (nu * nu - dot(size, w.a, w.H[row]))
            r[row] = min(max(r[row], smallest * given), largest * given)
        w.R[row, row] = r[row]


def adapt(size: Size, w: Workspace, options: SageHusa, own: Any, memory: Array) -> None:
    """R by the estimate; the memory holds the variances, then ``b^k``."""
    rows = w.z.shape[0]
    estimate_noise(size, w, options.b, options.smallest, options.largest, memory[:rows], memory[rows:])


def report(size: Size, w: Workspace, options: SageHusa, own: Any, memory: Array, figures: Array) -> None:
    """The variances."""
    for row in range(len(figures)):
        figures[row] = memory[row]


variant(SageHusa, adapt=adapt, report=report)


def sage_husa(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    b: float = 0.99,
    smallest: float = 1e-2,
    largest: float = 1e4,
    **running: Unpack[Running],
) -> Estimates:
    """Kalman filter that estimates the measurement noise (Sage and Husa).

    `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    system : LinearSystem
        With a diagonal R, which is what each row begins with, and without S.
    b : float
        Forgetting factor; the memory is ``1 / (1 - b)`` measurements.
    smallest, largest : float
        Limits of the estimated variance, in units of the given one.

    Returns
    -------
    Estimates
        `adaptation` holds each row's estimated variance.

    Raises
    ------
    UsageError
        An option out of range, R not diagonal, or S given.
    """
    if not 0.0 < b < 1.0:
        raise UsageError(f"b is {b}, expected a number between 0 and 1")
    check_limits(smallest, largest)
    check_independent_rows(system)

    memory = np.concatenate([np.full(system.rows, np.nan), np.ones(system.rows)])
    options = SageHusa(float(b), float(smallest), float(largest))
    return run_linear(options, system, state, memory=memory, adaptation=system.rows, **running)


def check_independent_rows(system: LinearSystem) -> None:
    """The noise of each row stands alone: R is diagonal and there is no S."""
    off = system.R * (1.0 - np.eye(system.rows))
    if off.any():
        raise UsageError("R is not diagonal: to estimate variances row by row, decorrelate the measurements first")
    if system.S is not None and system.S.any():
        raise UsageError("S is given: variances estimated row by row need noise uncorrelated with the process noise")


def check_limits(smallest: float, largest: float) -> None:
    """Limits of an estimated variance hold the given one between them."""
    if not 0.0 < smallest <= 1.0 <= largest:
        raise UsageError(f"smallest is {smallest} and largest {largest}, expected 0 < smallest <= 1 <= largest")
