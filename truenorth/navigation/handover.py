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
    """The joint estimate of an alignment that estimated biases.

    Attributes
    ----------
    C_nb : (3, 3) array
        Attitude of the IMU itself, also where it turns on the body.
    accel_bias : (3,) array, m/s^2
        What acts as accelerometer bias: scale factor, misalignment and gravity's error as well.
    P : (9, 9) array
        Covariance of phi (E, N, U), gyro bias and `accel_bias` (IMU axes), the deflection of the vertical included.
    prior : (6,) array
        Variance a priori of what acts as gyro and accelerometer bias.
    """

    C_nb: Array
    accel_bias: Array
    P: Array
    prior: Array
