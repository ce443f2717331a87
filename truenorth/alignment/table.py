"""What an alignment over positions of a turntable tells besides attitude and biases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.touched import Touch
from truenorth.core.attitude import euler_from_dcm

Array = NDArray[np.float64]

PPM = 1e-6


@dataclass(frozen=True)
class TablePosition:
    """One position.

    Attributes
    ----------
    start, stop : float, s
        On the record's clock.
    C_nb : (3, 3) array
        Attitude in its middle.
    turn : (3,) array, rad
        Rotation vector from the position before, body axes; zero of the first.
    """

    start: float
    stop: float
    C_nb: Array
    turn: Array

    def summary(self) -> dict[str, Any]:
        """Times and angles in datasheet units."""
        heading, pitch, roll = (float(np.degrees(angle)) for angle in euler_from_dcm(self.C_nb))
        return {
            "start_s": self.start,
            "stop_s": self.stop,
            "turned_deg": float(np.degrees(np.linalg.norm(self.turn))),
            "heading_deg": heading,
            "pitch_deg": pitch,
            "roll_deg": roll,
        }


@dataclass(frozen=True)
class TurntableErrors:
    """Positions, and the sensors' errors that turns bring to light.

    Attributes
    ----------
    positions : tuple of TablePosition
    touch : Touch or None
        A step of the specific force that no turn explains.
    gyro_matrix, gyro_matrix_sigma : (3, 3) arrays
        ``w_hat = (I + M) w + bias``: scale factors on the diagonal, misalignments beside it.
    accel_matrix, accel_matrix_sigma : (3, 3) arrays
    arm, arm_sigma : (3,) arrays, m
        Place of the IMU from where the table's axes meet.
    """

    positions: tuple[TablePosition, ...]
    touch: Touch | None
    gyro_matrix: Array
    gyro_matrix_sigma: Array
    accel_matrix: Array
    accel_matrix_sigma: Array
    arm: Array
    arm_sigma: Array

    def summary(self, heading_known: bool) -> dict[str, Any]:
        """For the flat summary of the alignment."""
        positions = [position.summary() for position in self.positions]
        if not heading_known:
            for position in positions:
                position["heading_deg"] = None
        return {
            "positions": positions,
            "touched_at_s": None if self.touch is None else self.touch.time,
            "gyro_scale_factor_ppm": (np.diag(self.gyro_matrix) / PPM).tolist(),
            "gyro_scale_factor_sigma_ppm": (np.diag(self.gyro_matrix_sigma) / PPM).tolist(),
            "accel_scale_factor_ppm": (np.diag(self.accel_matrix) / PPM).tolist(),
            "accel_scale_factor_sigma_ppm": (np.diag(self.accel_matrix_sigma) / PPM).tolist(),
            "lever_arm_m": self.arm.tolist(),
            "lever_arm_sigma_m": self.arm_sigma.tolist(),
        }
