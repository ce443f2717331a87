"""The strong tracking filter: a fading filter with softening and cap.

Source: D. H. Zhou, P. M. Frank, Strong tracking filtering of nonlinear time-varying stochastic systems with coloured
noise, Int. J. Control 65, 1996: ``lam = max(1, tr(V - beta R - H Q H') / tr(H Phi P Phi' H'))``,
``P = lam Phi P Phi' + Q``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Unpack

import numpy as np

from truenorth.filters.drive import Running
from truenorth.filters.fading import SINGLE, FadingOptions, check_factor_options, faded
from truenorth.filters.system import Estimates, FilterState, LinearSystem


@dataclass(frozen=True)
class StrongTracking:
    """Strong tracking as an option of nonlinear filters: a factor on the predicted covariance, without Q.

    Parameters
    ----------
    softening, rho, cap : float
        As in :func:`strong_tracking`.

    Raises
    ------
    UsageError
        An option out of range.
    """

    softening: float = 1.0
    rho: float = 0.95
    cap: float = np.inf

    def __post_init__(self) -> None:
        """Check the options."""
        check_factor_options(self.rho, self.softening, self.cap)


def strong_tracking(
    system: LinearSystem,
    state: FilterState | None = None,
    *,
    softening: float = 1.0,
    rho: float = 0.95,
    cap: float = np.inf,
    **running: Unpack[Running],
) -> Estimates:
    """Strong tracking filter.

    `system`, `state` and ``**running`` are as of :func:`truenorth.filters.kalman`, which also says when a DataError is raised.

    Parameters
    ----------
    softening : float
        beta, at least 1: how much larger than expected the measurement noise may look before the factor fires; at 1
        the filter is the fading filter of kind "single".
    rho, cap
        As of :func:`truenorth.filters.fading`.

    Returns
    -------
    Estimates
        `adaptation` holds the factor.

    Raises
    ------
    UsageError
        An option out of range.
    """
    return faded(system, state, FadingOptions(SINGLE, float(rho), float(softening), float(cap)), **running)
