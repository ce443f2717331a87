"""How far guesses of a heading lie apart that explain a log as well, in heading and in the level that each of them ends with.

A vehicle that goes round in a steady circle feels the same force all the time. Its poor accelerometers and gyros let a heading that
is wrong by ``h`` turn the centripetal acceleration, ``a h``; a level that leans by as much of gravity makes up for it, and biases
for what that takes of the gyros. So tracks from guesses of different headings end with different levels, and who does not know the
heading knows the level no better than that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import UNIFORM_SIGMA

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """(3, 3) second moment of phi besides the filter's, rad^2, and of which guesses: (K, 3) phi and (K,) chance of each."""

    moment: Array = field(default_factory=lambda: np.zeros((3, 3)))
    phi: Array = field(default_factory=lambda: np.zeros((0, 3)))
    chance: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, attitudes: Sequence[Array], best: int, weight: Array) -> Spread:
        """Of attitudes ``C_nb`` (3, 3) that are right with these chances, about the one at `best`."""
        C, others = attitudes[best], np.stack(attitudes)
        R = others @ C.T
        phi = np.cross(C[2], others[:, 2]) @ C.T  # of level alone, whatever heading
        phi[:, 2] = -np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])
        return cls((weight[:, None] * phi).T @ phi, phi, weight)

    def beyond(self, heading: float) -> Spread:
        """Of guesses alone that are farther off in heading than this, rad: nearer ones are in the covariance of one track."""
        far = np.abs(self.phi[:, 2]) > heading
        return Spread((self.chance[far, None] * self.phi[far]).T @ self.phi[far], self.phi[far], self.chance[far])

    def and_more(self, *heading: float) -> Spread:
        """With further sigmas of heading, rad."""
        return replace(self, moment=self.moment + np.diag([0.0, 0.0, math.hypot(*heading) ** 2]))

    @property
    def heading(self) -> float:
        """One sigma, rad."""
        return math.sqrt(float(self.moment[2, 2]))

    def covariance(self, known: float) -> Array:
        """(3, 3) what it adds to that of phi, rad^2, whose variance of heading is `known`: none is larger than of any heading."""
        room = math.sqrt(max(UNIFORM_SIGMA**2 - known, 0.0))
        scale = np.array([1.0, 1.0, min(1.0, room / max(self.heading, 1e-12))])
        return self.moment * np.outer(scale, scale)
