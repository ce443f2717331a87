"""Fixes from outside as rows of a filter of the errors of a course: what they show, and how well over a step of many epochs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.marine import DP, PHI

Array = NDArray[np.float64]


class FixRows(NamedTuple):
    """Fixes at the epochs from the switch on: place error east, north (m), heading error (rad), (K+1-start, 3), NaN where none."""

    z: Array
    sigma: Array

    @staticmethod
    def rows(states: int) -> Array:
        """(3, n) what a fix shows of this many states."""
        H = np.zeros((3, states))
        H[:2, DP], H[2, PHI.stop - 1] = np.eye(2), 1.0
        return H

    def sigma_of_steps(self, stride: int, count: int) -> Array:
        """(count, 3) of all fixes within each step of `stride` epochs, weighed together; infinite where there is none."""
        information = np.where(np.isfinite(self.z), self.sigma**-2.0, 0.0)[1 : 1 + count * stride]
        with np.errstate(divide="ignore"):
            sigma: Array = information.reshape(count, stride, 3).sum(axis=1) ** -0.5
        return sigma
