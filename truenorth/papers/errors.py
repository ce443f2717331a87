"""Errors of attitude of the runs of a study, and what a filter says of them: written once for all papers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.consistency import nees

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AttitudeErrors:
    """Errors of attitude, estimated minus true, of any leading shape.

    Attributes
    ----------
    phi : (..., 3) array, rad
        East, north, up.
    sigma : (..., 3) array, rad
        What the method says of them; NaN where it says nothing.
    nees : (...) array
        Of phi, over 3; NaN without a covariance.
    """

    phi: Array
    sigma: Array
    nees: Array

    @classmethod
    def of(cls, phi: Array, P: Array, **more: Any) -> Self:
        """Of errors (..., 3) whose covariance (..., 3, 3) is claimed; `more` are the fields of a class of one's own."""
        return cls(phi, np.sqrt(np.diagonal(P, axis1=-2, axis2=-1)), nees(phi, P) / 3, **more)

    @classmethod
    def with_sigma(cls, phi: Array, sigma: Array | float = np.nan, **more: Any) -> Self:
        """Of errors (..., 3) of which their sigmas are claimed, or nothing at all."""
        return cls(phi, np.broadcast_to(sigma, phi.shape), np.full(phi.shape[:-1], np.nan), **more)

    @staticmethod
    def together(runs: Sequence[AttitudeErrors]) -> AttitudeErrors:
        """Of all runs, along a new first axis."""
        return AttitudeErrors(*(np.array([getattr(run, name) for run in runs]) for name in ("phi", "sigma", "nees")))


def near_from(phi_u: Array, limit: float, times: Array) -> Array:
    """(runs,) the time from which each run of (runs, K) stays within a limit to the end; infinite where it does not.

    `times` (K,) are given for the first epoch that is near; 0: near throughout.
    """
    off = np.abs(phi_u) > limit
    first = np.where(off.any(axis=1), off.shape[1] - np.argmax(off[:, ::-1], axis=1), 0)
    return np.asarray(np.where(first == 0, 0.0, np.append(times, np.inf)[first]))


def level(phi: Array) -> Array:
    """(...) RMS of the two tilts of (..., 3)."""
    return np.asarray(np.sqrt(np.mean(phi[..., :2] ** 2, axis=-1)))
