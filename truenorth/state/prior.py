"""What is known of the errors at the start beyond a covariance of the fifteen states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WholeBiases:
    """How to take apart the biases of a start into their constant and their slow part."""

    # (6,): variance a priori of what is constant of the gyro and accelerometer biases, (rad/s)^2 and (m/s^2)^2
    constant: Array
    averaged: float = 0.0  # s; they are means over the time before the start; 0: they hold at the start
