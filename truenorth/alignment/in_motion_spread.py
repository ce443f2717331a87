"""How far headings lie apart that explain a log as well, and how the level of a vehicle that circles leans as they turn.

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

NEAR = 1.0  # rad, of heading, in which level leans in proportion


@dataclass(frozen=True)
class Spread:
    """One sigma of heading besides the filter's, rad, and the level (2,) along east and north that goes with a radian of it."""

    heading: float = 0.0
    lean: Array = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def of(cls, attitudes: Sequence[Array], best: int, weight: Array) -> Spread:
        """Of attitudes ``C_nb`` (3, 3) that are right with these chances, about the one at `best`."""
        C, others = attitudes[best], np.stack(attitudes)
        R = others @ C.T
        off = np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])
        level = np.cross(C[2], others[:, 2]) @ C[:2].T
        near = weight * (np.abs(off) < NEAR)
        turned = float(near @ off**2)
        lean = -(near * off) @ level / turned if turned > 0.0 else np.zeros(2)
        return cls(math.sqrt(float(weight @ off**2)), lean)

    def and_more(self, *heading: float) -> Spread:
        """With further sigmas of heading, rad."""
        return replace(self, heading=math.hypot(self.heading, *heading))

    def covariance(self, known: float) -> Array:
        """(3, 3) what it adds to that of phi, rad^2, whose variance of heading is `known`: none is larger than of any heading."""
        room = math.sqrt(max(UNIFORM_SIGMA**2 - known, 0.0))
        phi = min(self.heading, room) * np.append(self.lean, 1.0)
        return np.outer(phi, phi)
