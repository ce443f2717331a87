"""A group of error states beyond the fifteen of the INS: what it is called, its prior, and how it runs by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Group:
    """Constants, Gauss-Markov processes or random walks.

    Attributes
    ----------
    name : str
        Such as "odometer scale".
    sigma : (n,) array
        One-sigma at the start, and of the stationary process where it has a correlation time.
    correlation_time : float, s
        Infinite: a constant, or a random walk.
    walk : float
        Density of a random walk, sigma's unit/sqrt(s).
    """

    name: str
    sigma: Array
    correlation_time: float = math.inf
    walk: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", np.atleast_1d(np.asarray(self.sigma, dtype=np.float64)))
        if not (np.all(self.sigma >= 0.0) and self.correlation_time > 0.0 and self.walk >= 0.0):
            raise UsageError(f"{self.name}: a sigma, a correlation time or a walk is negative or not a number")
