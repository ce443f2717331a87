"""What navigation goes on from: attitude and what acts as biases, estimated together.

Heading error and east gyro bias of an alignment at rest cancel each other, and so do tilt and accelerometer bias: what
is left of them in navigation is far less than either.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Handover:
    """The joint estimate of an alignment that estimated biases."""

    C_nb: Array  # (3, 3): attitude of the IMU itself, also where it turns on the body
    # (3,) m/s^2: what acts as accelerometer bias: scale factor, misalignment and gravity's error as well
    accel_bias: Array
    # (9, 9): covariance of phi (E, N, U), gyro bias and `accel_bias` (IMU axes), the deflection of the vertical included
    P: Array
    prior: Array  # (6,): variance a priori of what acts as gyro and accelerometer bias
