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
    """One position."""

    start: float  # s; on the record's clock
    stop: float  # s
    C_nb: Array  # (3, 3): attitude in its middle
    turn: Array  # (3,) rad: rotation vector from the position before, body axes; zero of the first

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
    """Positions, and the sensors' errors that turns bring to light."""

    positions: tuple[TablePosition, ...]
    touch: Touch | None  # a step of the specific force that no turn explains
    gyro_matrix: Array  # (3: ``w_hat = (I + M) w + bias``: scale factors on the diagonal, misalignments off it
    gyro_matrix_sigma: Array  # 3)
    accel_matrix: Array  # (3
    accel_matrix_sigma: Array  # 3)
    arm: Array  # (3,) m: place of the IMU from where the table's axes meet
    arm_sigma: Array  # (3,) m

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
